"""The page of a comparison: one self-contained HTML file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

from burg_drake.core import CONTESTED_CONFIDENCE, format_count, format_number, outcome_label
from burg_drake.evaluation import command, folded_section, header, html_page, section, table, tiles
from burg_drake.experiment.comparison.agreement_between_runs import MarginDifference, PartedGrasp
from burg_drake.experiment.comparison.compared_runs import Side
from burg_drake.experiment.comparison.comparison import (
    PERCENT_MEASURES,
    Comparison,
    agreement_sentence,
    bias_sentence,
    bracketed_interval,
    cell_name,
    estimate_text,
    have_identical_rows,
    headline_agreement,
    headline_sentence,
    margin_title,
    outlier_sentence,
    population_agreement,
    population_difference_sentence,
    selection_suffix,
    unpredictable_sentence,
)
from burg_drake.experiment.comparison.comparison_figures import (
    figure_section,
    group_section,
    margin_section,
    matrix_section,
    placement_section,
    reliability_plot,
    standing_out_section,
    unpredictable_section,
)
from burg_drake.experiment.comparison.estimates import Estimate
from burg_drake.experiment.comparison.figure_tables import (
    CONFIDENCE_HEADING,
    deciding_stages,
    labelled_row,
    named_row,
    number_cells,
    run_agreement_table,
    verdict_table,
)
from burg_drake.experiment.comparison.group_agreement import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Disagreement, Judgement
from burg_drake.experiment.comparison.margin_calibration import MarginCalibration
from burg_drake.visualization import Child, Html, element, join


def comparison_page(
    comparison: Comparison,
    path: str | Path = "compare.html",
    line: str = "",
    more: Sequence[Child] = (),
) -> str:
    """The page as HTML.

    Args:
        comparison: what it shows.
        path: where the page will be, so that its links to photos hold there.
        line: the command that makes it again; left out if empty.
        more: further sections.
    """
    c = comparison
    kind = {
        "trials": "Simulation against reality",
        "simulators": "Two simulations against reality",
        "runs": "Simulation against simulation",
    }[c.kind]
    title = ", ".join(c.first.scenes[:3]) + (" and others" if len(c.first.scenes) > 3 else "")
    title = f"{title} on {c.first.station}"
    folder = files("burg_drake.experiment.comparison")
    return html_page(
        f"{kind}: {title}",
        element("style", Html((folder / "style.css").read_text(encoding="utf-8"))),
        header(kind, title, _subtitle(c)),
        _lead_paragraph(c),
        *(element("p", note, class_="notice") for note in c.notes),
        *_sections(c, _photo_folder(c, Path(path))),
        *more,
        _settings_section(c),
        section("How to repeat it", "The same inputs give the same page.", command(line))
        if line
        else None,
    )


def _subtitle(c: Comparison) -> str:
    what = "grasps" if c.kind == "runs" else "trials"
    counts = "as long as the object is held" if c.success == "held" else "nothing else disturbed"
    sides = [c.first, *([c.second] if c.second else []), c.reference]
    who = " against ".join(side.label for side in (sides[0], sides[-1]))
    if c.second:
        who = f"{c.first.label} and {c.second.label} against {c.reference.label}"
    return f"{format_count(c.coverage.compared)} {what}: {who}; success: {c.success}, {counts}"


def _lead_paragraph(c: Comparison) -> Html:
    if have_identical_rows(c):
        return element("p", element("b", headline_sentence(c)), class_="lead")
    found = headline_agreement(c.judgement)
    entries: list[tuple[str, Child, str]] = [
        _figure_tile(
            "Same verdict" if c.kind == "runs" else "Right verdicts", found.accuracy, "accuracy"
        ),
        _figure_tile("Precision", found.precision, "precision"),
        _figure_tile("Recall", found.recall, "recall"),
        _figure_tile("Matthews correlation", found.matthews, "matthews"),
        _figure_tile("Cohen's kappa", found.kappa, "kappa"),
    ]
    what, whose = "trials", "of the selected trials"
    if population_agreement(c.judgement) is not None:
        whose = f"estimated for the {round(sum(found.cells)):,} grasps that the trials stand for"
    if c.kind == "simulators":
        whose += " (first simulator)"
    elif c.kind == "runs":
        what = "grasps"
        whose = "of the first run, with the second run in the place of what happened"
    return element(
        "div",
        element(
            "p",
            element("b", _keep_percent_signs(headline_sentence(c))),
            _keep_percent_signs(f" {' '.join(filter(None, _further_sentences(c)))}"),
            class_="lead",
        ),
        tiles(entries),
        element(
            "p",
            f"Figures {whose}, with 95 % intervals that assume independent {what}. Those"
            " on one object are alike, so the range for other objects is wider.",
            class_="note",
        ),
    )


def _further_sentences(c: Comparison) -> list[str]:
    """The sentences after the first one; empty ones are left out."""
    judged = c.judgement
    if c.kind == "simulators":
        return [population_difference_sentence(c)]
    return [bias_sentence(c), unpredictable_sentence(judged), outlier_sentence(judged)]


def _keep_percent_signs(text: str) -> str:
    """Keeps per cent signs with their numbers."""
    return text.replace(" %", "\u00a0%")


def _figure_tile(name: str, found: Estimate, key: str) -> tuple[str, Child, str]:
    percent = key in PERCENT_MEASURES
    if found.value is None:
        return name, "-", found.reason
    if percent:
        return name, f"{100 * found.value:.0f} %", f"{bracketed_interval(found, percent=True)} %"
    return name, estimate_text(found, percent=False), bracketed_interval(found, percent=False)


def _sections(c: Comparison, photos: Path | None) -> list[Html | None]:
    judged = [("", c.judgement)]
    if c.other is not None:
        judged = [("first", c.judgement), ("second", c.other)]
    if have_identical_rows(c):
        return []
    parts = [*agreement_sections(c), matrix_section(c, judged), _difference_section(c)]
    parts.append(figure_section(c, judged))
    for name, judgement in judged:
        parts += [_name_simulator(part, name) for part in _judge_sections(c, judgement, photos)]
    return parts


def _judge_sections(c: Comparison, judgement: Judgement, photos: Path | None) -> list[Html | None]:
    right = "same verdict in both runs" if c.kind == "runs" else "right verdicts"
    text = f"Share of {right}, precision and recall, with 95 % intervals."
    of = selection_suffix(c)
    return [
        unpredictable_section(judgement),
        standing_out_section(judgement) if c.kind != "runs" else None,
        group_section(f"By object{of}", text, "object", judgement.objects),
        group_section(f"By scene{of}", text, "scene", judgement.scenes)
        if len(judgement.scenes) > 1
        else None,
        placement_section(judgement, of),
        margin_section(c, judgement),
        stopped_section(c, judgement, of),
        case_section(c, judgement, photos),
        outcome_section(c, judgement, of),
    ]


def _name_simulator(part: Html | None, name: str) -> Html | None:
    """Says in a section's title which simulator it is about."""
    if part is None or not name:
        return part
    return Html(part.replace("</h2>", f" ({name} simulator)</h2>", 1))


def _difference_section(c: Comparison) -> Html | None:
    """Whether one of two simulators is right more often."""
    d = c.difference
    if d is None or d.p_value is None or d.difference.value is None:
        return None
    points = bracketed_interval(d.difference, percent=True)
    text = (
        f"{population_difference_sentence(c)} Both are right in {d.both} of {d.trials} trials, only"
        f" the first in {d.only_first}, only the second in {d.only_second}, neither in"
        f" {d.neither}. In these trials the first is right {100 * d.difference.value:+.1f}"
        f" percentage points more often {points}; McNemar's exact test of equally many right"
        f" verdicts: p = {d.p_value:.3g}."
    )
    return section("Which simulator is right more often?", text.lstrip())


def _settings_section(c: Comparison) -> Html:
    """What was compared, what was left out, in what runs differ."""
    facts: list[tuple[str, str]] = []
    sides = [("predictions", c.first), ("second simulation", c.second), ("truth", c.reference)]
    if c.kind == "runs":
        sides = [("first run", c.first), ("second run", c.reference)]
    facts += [(name, _describe_side(side)) for name, side in sides if side is not None]
    v = c.coverage
    facts.append(("compared", format_count(v.compared)))
    if c.kind == "runs":
        facts.append(("only in the first", format_count(v.only_first)))
        facts.append(("only in the second", format_count(v.only_second)))
        facts.append(("same id, other grasp", format_count(v.other_content)))
    facts += [(f"left out: {k.replace('_', ' ')}", format_count(n)) for k, n in v.left_out.items()]
    facts += [("differs", text) for text in c.settings]
    facts.append(("intervals", f"95 %, bootstrap seed {c.seed}"))
    entries = [join(element("dt", name), element("dd", fact)) for name, fact in facts]
    return section("What was compared", "", element("dl", *entries, class_="facts"))


def _describe_side(side: Side) -> str:
    hashes = ", ".join(side.hashes[:6]) + (" and others" if len(side.hashes) > 6 else "")
    how = "" if side.kind == "trials" else f", mode {side.mode}, {side.engines}"
    run = "runs" if len(side.hashes) > 1 else "run"
    return f"{side.path}{how}, station {side.station}, {run} {hashes}"


def _photo_folder(c: Comparison, path: Path) -> Path | None:
    """Folder of the trials file from that of the page."""
    if c.reference.kind != "trials":
        return None
    folder = Path(c.reference.path).absolute().parent
    return Path(os.path.relpath(folder, path.absolute().parent))


def case_section(comparison: Comparison, judged: Judgement, photos: Path | None) -> Html | None:
    """The wrong verdicts with the way to look at them; nothing where there are none.

    Args:
        comparison: the comparison.
        judged: what it says of one judge.
        photos: folder of the trials file from that of the page; None without trials.
    """
    max_rows = 50  # Wrong verdicts in the table.
    if not judged.disagreements:
        return None
    tables: list[Html] = []
    apart = judged.unpredictable
    beyond = {} if apart is None else apart.outcomes
    promised = 0 if apart is None else apart.predicted_successes
    false_successes = [d for d in judged.disagreements if d.kind == "fp"]
    groups = [
        (
            cell_name(comparison, "fp"),
            [d for d in false_successes if d.ended not in beyond],
            round(judged.selected.fp) - promised,
        ),
        (
            "success predicted, failed for reasons that the hand alone cannot predict",
            [d for d in false_successes if d.ended in beyond],
            promised,
        ),
        (
            cell_name(comparison, "fn"),
            [d for d in judged.disagreements if d.kind == "fn"],
            round(judged.selected.fn),
        ),
    ]
    for name, cases, total in groups:
        title = name.capitalize()
        if cases:
            shown = min(len(cases), max_rows)
            more = f", the first {shown}" if total > shown else ""
            tables += [
                element("h3", f"{title}: {format_count(total)}{more}", class_="case"),
                _case_table(cases[:max_rows], photos),
            ]
    text = "Each command shows the trial in simulation."
    return section("Where they disagree", text, *tables)


def _case_table(cases: Sequence[Disagreement], photos: Path | None) -> Html:
    real = any(case.trial is not None for case in cases)
    head = ["trial", "object", "simulated", "happened"] if real else ["object", "first", "second"]
    head += ["offset", "note"] if real else []
    head.append("replay")
    rows = []
    for case in cases:
        verdict = outcome_label(case.simulated)
        cells: list[Child] = [case.trial] if real else []
        cells += [
            case.object,
            f"{verdict} ({case.blocker})" if case.blocker else verdict,
            outcome_label(case.ended),
        ]
        if real:
            offset = "-" if case.offset_mm is None else f"{format_number(case.offset_mm)} mm"
            cells += [offset, _note_and_photo(case, photos)]
        cells.append(join(*(command(line) for line in case.replays)))
        rows.append(labelled_row(head, cells))
    return table(head, rows, style="cases")


def _note_and_photo(case: Disagreement, photos: Path | None) -> Child:
    """The note, and a link to the photo."""
    if not case.photo or photos is None:
        return case.note
    link = element("a", "photo", href=quote((photos / case.photo).as_posix()))
    return join(case.note, " " if case.note else "", link)


def stopped_section(comparison: Comparison, judged: Judgement, of: str) -> Html:
    """What became of grasps by verdict and the body in the way; `of` says of which."""
    max_rows = 30
    more = f" The first {max_rows} of {len(judged.stopped)}."
    more = more if len(judged.stopped) > max_rows else ""
    text = f"For each simulated outcome: how many of these grasps succeeded.{more}"
    if comparison.kind == "runs":
        text = (
            "For each outcome in the first run: how many of these grasps succeeded in the"
            f" second run.{more}"
        )
    found = verdict_table(comparison, judged).html("groups", max_rows)
    return section(f"How each verdict turned out{of}", text, found)


def outcome_section(comparison: Comparison, judged: Judgement, of: str) -> Html:
    """Simulated outcomes by what happened; `of` says of which trials."""
    happened = sorted({name for row in judged.outcomes.values() for name in row})
    rows = []
    for simulated, row in judged.outcomes.items():
        cells = [
            element("td", row.get(name, "·"), class_="number" if name in row else "number zero")
            for name in happened
        ]
        rows.append(named_row(outcome_label(simulated), *cells))
    runs = comparison.kind == "runs"
    head = ["first run" if runs else "simulated", *(outcome_label(n) for n in happened)]
    judge, other = ("in simulation", "on the robot")
    if runs:
        judge, other = "in the first run", "in the second"
    numbers = range(1, len(head))
    style = "matrix" if len(head) > 6 else ""
    return folded_section(
        f"Outcome by outcome{of}",
        f"Rows: how grasps ended {judge}. Columns: how they ended {other}.",
        table(head, rows, numbers=numbers, style=style),
    )


def agreement_sections(comparison: Comparison) -> list[Html | None]:
    """All that is known of two runs beside each other; nothing of other comparisons."""
    found = comparison.agreement
    if found is None:
        return []
    return [
        section(
            "Agreement on holding",
            agreement_sentence(comparison),
            _group_table("object", found.objects),
        ),
        _stage_section(found.stages, found.apart),
        _disagreement_section(found.parted),
        _confidence_section(found.confidence),
        _margin_bin_section(found.margins),
        _margin_difference_section(found.differences),
    ]


def _group_table(head: str, groups: Sequence[FactorGroup]) -> Html:
    max_rows = 60  # The JSON has all.
    return run_agreement_table(head, groups).html("groups", max_rows)


def _stage_section(
    stages: Mapping[str, Mapping[str, int]], apart: Mapping[str, Mapping[str, int]]
) -> Html:
    """All grasps by stage and stage, with those that only one run holds in brackets."""
    columns, rows = deciding_stages(stages), []
    for stage, row in stages.items():
        cells = []
        for name in columns:
            count, parted = row.get(name, 0), apart.get(stage, {}).get(name, 0)
            text = f"{format_count(count)} ({format_count(parted)})" if parted else count or "·"
            cells.append(element("td", text, class_="number" if count else "number zero"))
        rows.append(named_row(stage, *cells))
    text = (
        "Rows: the stage that decided in the first run. Columns: in the second run. In"
        " brackets: grasps that only one of the runs holds."
    )
    head = ["first run", *(f"{name} in the second" for name in columns)]
    return section("Where the runs disagree", text, table(head, rows, numbers=range(1, len(head))))


def _disagreement_section(parted: Sequence[PartedGrasp]) -> Html | None:
    """The first grasps that only one run holds, and how to look at them in either."""
    max_rows = 50  # Grasps in the table; the JSON has all.
    if not parted:
        return None
    head = ["grasp", "first", "second", "confidence of the first", "replay"]
    rows = []
    for one in parted[:max_rows]:
        cells: tuple[Child, ...] = (
            one.grasp,
            outcome_label(one.first),
            outcome_label(one.second),
            "-" if one.confidence is None else f"{one.confidence:.3f}",
            join(*(command(line) for line in one.replays)),
        )
        rows.append(labelled_row(head, cells))
    text = (
        f"{format_count(len(parted))} grasps. The commands show each one in the first and"
        " in the second run."
    )
    if len(parted) > max_rows:
        text += f" The first {max_rows}; the JSON has all."
    return section("Grasps that only one of the runs holds", text, table(head, rows, style="cases"))


def _confidence_section(groups: Sequence[FactorGroup]) -> Html | None:
    if not groups:
        return None
    text = (
        "Share of grasps on which the runs agree (both hold the object, or neither"
        f" does), by the confidence of the first run's verdict. Below {CONTESTED_CONFIDENCE:g} a"
        " verdict is contested."
    )
    return section(
        "Do the runs disagree on contested grasps?", text, _group_table(CONFIDENCE_HEADING, groups)
    )


def _margin_bin_section(margins: Sequence[MarginCalibration]) -> Html | None:
    if not margins:
        return None
    text = (
        "Share of grasps on which the runs agree, in bins of about equally many grasps"
        " along the first run's margin, with Wilson's intervals. Only grasps whose"
        " margin both runs measured count. Where the share falls, the verdict depends on"
        " the engine. Line: the monotone curve that fits best; dashes: the share of all"
        " grasps."
    )
    plots = (reliability_plot(c, "share on which the runs agree") for c in margins)
    return section(
        "Do the runs disagree at small margins?",
        text,
        element("div", *plots, class_="charts plots"),
    )


def _margin_difference_section(differences: Sequence[MarginDifference]) -> Html | None:
    if not differences:
        return None
    rows = []
    for one in differences:
        title, unit, size = margin_title(one.name)
        values = (one.median, one.median_size, one.within)
        cells = (f"{format_number(size * value)} {unit}".rstrip() for value in values)
        rows.append(named_row(title, *number_cells([format_count(one.grasps), *cells])))
    head = ["margin", "grasps", "median difference", "median size", "90 % within"]
    return section(
        "How much margins differ",
        "Second run minus first run, for grasps that both executed; sizes are absolute"
        " differences.",
        table(head, rows, numbers=range(1, len(head)), style="figures"),
    )
