"""The page of a comparison: one self-contained HTML file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

from burg_drake.core import NO_VALUE, format_count, format_number, outcome_label
from burg_drake.evaluation import command, folded_section, header, html_page, section, table, tiles
from burg_drake.experiment.comparison.agreement_between_runs import RunAgreement
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
    no_outliers_sentence,
    outlier_sentence,
    population_agreement,
    population_difference_sentence,
    selection_suffix,
    success_description,
    too_few_trials_sentence,
    unpredictable_sentence,
)
from burg_drake.experiment.comparison.comparison_findings import (
    NamedJudgements,
    confidence_finding,
    deciding_stages,
    group_finding,
    margin_difference_finding,
    margin_finding,
    measure_finding,
    outlier_finding,
    parted_finding,
    placement_finding,
    run_agreement_finding,
    unpredictable_finding,
    verdict_finding,
)
from burg_drake.experiment.comparison.confusion_matrix import Agreement, Estimate
from burg_drake.experiment.comparison.finding_tables import (
    FindingTable,
    cross_table,
    named_row,
    reliability_plot,
)
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
        comparison: the comparison.
        path: path of the page; links to photos are relative to its folder.
        line: command that repeats the comparison; left out if empty.
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
    judgement = c.judgement
    if c.kind == "simulators":
        return [population_difference_sentence(c)]
    return [bias_sentence(c), unpredictable_sentence(judgement), outlier_sentence(judgement)]


def _keep_percent_signs(text: str) -> str:
    """Joins per cent signs to their numbers by no-break spaces."""
    return text.replace(" %", "\u00a0%")


def _figure_tile(name: str, estimate: Estimate, key: str) -> tuple[str, Child, str]:
    percent = key in PERCENT_MEASURES
    if estimate.value is None:
        return name, "-", estimate.reason
    if percent:
        return (
            name,
            f"{100 * estimate.value:.0f} %",
            f"{bracketed_interval(estimate, percent=True)} %",
        )
    return name, estimate_text(estimate, percent=False), bracketed_interval(estimate, percent=False)


def _sections(c: Comparison, photos: Path | None) -> list[Html | None]:
    judgements = [("", c.judgement)]
    if c.other is not None:
        judgements = [("first", c.judgement), ("second", c.other)]
    if have_identical_rows(c):
        return []
    parts = [] if c.agreement is None else _agreement_sections(c, c.agreement)
    parts += [_matrix_section(c, judgements), measure_finding(c, judgements).section()]
    for name, judgement in judgements:
        parts += [_name_simulator(part, name) for part in _judge_sections(c, judgement, photos)]
    return parts


def _judge_sections(c: Comparison, judgement: Judgement, photos: Path | None) -> list[Html | None]:
    parts: list[Html | None] = []
    if judgement.unpredictable is not None:
        parts.append(unpredictable_finding(judgement).section())
    if judgement.standing_out:
        parts.append(outlier_finding(judgement).section())
    elif c.kind != "runs":
        parts.append(section("What stands out", no_outliers_sentence(judgement)))
    parts.append(group_finding(c, "object", judgement.objects).section())
    if len(judgement.scenes) > 1:
        parts.append(group_finding(c, "scene", judgement.scenes).section())
    return [
        *parts,
        _placement_section(c, judgement),
        _margin_section(c, judgement),
        verdict_finding(c, judgement).section(),
        _case_section(c, judgement, photos),
        _outcome_section(c, judgement),
    ]


def _name_simulator(part: Html | None, name: str) -> Html | None:
    """Adds the simulator's name to a section's title."""
    if part is None or not name:
        return part
    return Html(part.replace("</h2>", f" ({name} simulator)</h2>", 1))


def _settings_section(c: Comparison) -> Html:
    """Section on compared and omitted grasps, and on differing settings of the runs."""
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
    d = c.difference
    if d is not None and d.difference.value is not None:
        points = f"{100 * d.difference.value:+.1f} percentage points"
        points += f" {bracketed_interval(d.difference, percent=True)}"
        text = f"first less second {points}; in both {d.both}, in neither {d.neither} trials"
        facts.append(("right verdicts", text))
    facts.append(("intervals", f"95 %, bootstrap seed {c.seed}"))
    entries = [join(element("dt", name), element("dd", fact)) for name, fact in facts]
    return section("What was compared", "", element("dl", *entries, class_="facts"))


def _describe_side(side: Side) -> str:
    hashes = ", ".join(side.hashes[:6]) + (" and others" if len(side.hashes) > 6 else "")
    how = "" if side.kind == "trials" else f", mode {side.mode}, {side.engines}"
    run = "runs" if len(side.hashes) > 1 else "run"
    return f"{side.path}{how}, station {side.station}, {run} {hashes}"


def _photo_folder(c: Comparison, path: Path) -> Path | None:
    """Folder of the trials file, relative to the folder of the page; None without trials."""
    if c.reference.kind != "trials":
        return None
    folder = Path(c.reference.path).absolute().parent
    return Path(os.path.relpath(folder, path.absolute().parent))


def _case_section(comparison: Comparison, judgement: Judgement, photos: Path | None) -> Html | None:
    """Section of the wrong verdicts with the commands that show them; None if there are none.

    Args:
        comparison: the comparison.
        judgement: assessment of one judge.
        photos: folder of the trials file, relative to the folder of the page; None without trials.
    """
    max_rows = 50  # Maximum number of wrong verdicts in the table.
    if not judgement.disagreements:
        return None
    tables: list[Html] = []
    unpredictable = judgement.unpredictable
    outcomes = {} if unpredictable is None else unpredictable.outcomes
    predicted_successes = 0 if unpredictable is None else unpredictable.predicted_successes
    false_successes = [d for d in judgement.disagreements if d.kind == "fp"]
    groups = [
        (
            cell_name(comparison, "fp"),
            [d for d in false_successes if d.ended not in outcomes],
            round(judgement.selected.fp) - predicted_successes,
        ),
        (
            "success predicted, failed for reasons that the hand alone cannot predict",
            [d for d in false_successes if d.ended in outcomes],
            predicted_successes,
        ),
        (
            cell_name(comparison, "fn"),
            [d for d in judgement.disagreements if d.kind == "fn"],
            round(judgement.selected.fn),
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
    found = FindingTable(style="cases")
    real = any(case.trial is not None for case in cases)
    if real:
        found.texts("trial", "object", "simulated", "happened", "offset", "note")
    else:
        found.texts("object", "first", "second")
    found.elements("replay")
    for case in cases:
        verdict = outcome_label(case.simulated)
        simulated = f"{verdict} ({case.blocker})" if case.blocker else verdict
        cells = [case.object, simulated, outcome_label(case.ended)]
        if real:
            offset = "-" if case.offset_mm is None else f"{format_number(case.offset_mm)} mm"
            cells = [f"{case.trial}", *cells, offset, _note_and_photo(case, photos)]
        found.row(*cells, join(*(command(line) for line in case.replays)))
    return found.page_table()


def _note_and_photo(case: Disagreement, photos: Path | None) -> str:
    """The note, and a link to the photo."""
    if not case.photo or photos is None:
        return case.note
    link = element("a", "photo", href=quote((photos / case.photo).as_posix()))
    return join(case.note, " " if case.note else "", link)


def _outcome_section(comparison: Comparison, judgement: Judgement) -> Html:
    """Section that counts grasps by simulated and actual outcome."""
    happened = sorted({name for row in judgement.outcomes.values() for name in row})
    rows = [
        (outcome_label(simulated), [row.get(name, NO_VALUE) for name in happened])
        for simulated, row in judgement.outcomes.items()
    ]
    head, judge, other = "simulated", "in simulation", "on the robot"
    if comparison.kind == "runs":
        head, judge, other = "first run", "in the first run", "in the second"
    style = "matrix" if len(happened) > 5 else ""
    return folded_section(
        f"Outcome by outcome{selection_suffix(comparison)}",
        f"Rows: how grasps ended {judge}. Columns: how they ended {other}.",
        cross_table(head, [outcome_label(name) for name in happened], rows, style),
    )


def _agreement_sections(comparison: Comparison, agreement: RunAgreement) -> list[Html | None]:
    """Sections on the agreement of two runs."""
    title, text = "Agreement on holding", agreement_sentence(comparison)
    parts: list[Html | None] = [
        run_agreement_finding("object", agreement.objects, title, text).section(),
        _stage_section(agreement),
    ]
    if agreement.parted:
        parts.append(parted_finding(agreement.parted).section())
    if agreement.confidence:
        parts.append(confidence_finding(agreement.confidence).section())
    if agreement.margins:
        parts.append(_margin_bin_section(agreement.margins))
    if agreement.differences:
        parts.append(margin_difference_finding(agreement.differences).section())
    return parts


def _stage_section(agreement: RunAgreement) -> Html:
    """Section that counts all grasps by the deciding stages of both runs, and in brackets the
    grasps that only one run holds.
    """
    columns = deciding_stages(agreement.stages)

    def cell(stage: str, other: str) -> Child:
        count = agreement.stages[stage].get(other, 0)
        parted = agreement.apart.get(stage, {}).get(other, 0)
        return f"{format_count(count)} ({format_count(parted)})" if parted else count or NO_VALUE

    rows = [(stage, [cell(stage, other) for other in columns]) for stage in agreement.stages]
    text = (
        "Rows: the stage that decided in the first run. Columns: in the second run. In"
        " brackets: grasps that only one of the runs holds."
    )
    heads = [f"{name} in the second" for name in columns]
    return section("Where the runs disagree", text, cross_table("first run", heads, rows))


def _margin_bin_section(margins: Sequence[MarginCalibration]) -> Html:
    text = (
        "Share of grasps on which the runs agree, in bins of about equally many grasps"
        " along the first run's margin, with Wilson's intervals. Only grasps whose"
        " margin both runs measured count. Where the share falls, the verdict depends on"
        " the engine. Line: the monotone curve that fits best; dashes: the share of all"
        " grasps."
    )
    plots = _plots(margins, "share on which the runs agree")
    return section("Do the runs disagree at small margins?", text, plots)


def _plots(calibrations: Sequence[MarginCalibration], vertical: str) -> Html:
    plots = (reliability_plot(c, vertical) for c in calibrations)
    return element("div", *plots, class_="charts plots")


def _margin_section(comparison: Comparison, judgement: Judgement) -> Html | None:
    """Section on margins and success, most informative first; None without margins."""
    max_plots = 4  # Maximum number of margins with a plot.
    defined = [c for c in judgement.calibration if c.auroc.value is not None]
    found = sorted(defined, key=_distance_from_chance, reverse=True)
    if found:
        plots = _plots(found[:max_plots], success_description(comparison))
        return margin_finding(comparison, found).section(plots)
    words = too_few_trials_sentence(comparison, judgement)
    title = f"Do margins predict {success_description(comparison)}?"
    return section(title, words) if words else None


def _distance_from_chance(calibration: MarginCalibration) -> float:
    """Distance of the AUROC's interval from chance, by which the margins to plot are selected."""
    area = calibration.auroc_weighted or calibration.auroc
    low, high = area.low, area.high
    return -1.0 if low is None or high is None else max(low - 0.5, 0.5 - high)


def _placement_section(comparison: Comparison, judgement: Judgement) -> Html | None:
    """Section of agreement by placement; None without real trials."""
    found, p = placement_finding(comparison, judgement), judgement.placement
    if found is None or p is None:
        return None
    plots = _plots([c for c in (p.largest, p.target) if c.trials], "right verdicts")
    return element("div", found.section(), plots)


def _matrix_section(comparison: Comparison, judgements: NamedJudgements) -> Html:
    """Section with confusion matrices of the trials, and of all grasps that they represent."""
    runs = comparison.kind == "runs"
    title = "Verdicts of both runs" if runs else "Verdicts and outcomes"
    blocks = []
    for name, judgement in judgements:
        suffix = f", {name}" if name else ""
        kind = "grasps" if runs else "selected trials"
        blocks.append(_matrix_table(comparison, f"{kind}{suffix}", judgement.selected))
        if judgement.all_grasps is not None:
            blocks.append(_matrix_table(comparison, f"all grasps{suffix}", judgement.all_grasps))
    text = "Rows: what the simulation predicted. Columns: what happened."
    if runs:
        text = "Rows: the first run. Columns: the second run."
    if any(judgement.all_grasps is not None for _, judgement in judgements):
        text += (
            " Each selected trial counts once; for all grasps it counts for all the"
            " grasps that it was chosen from."
        )
    return section(title, text, element("div", *blocks, class_="beside"))


def _matrix_table(comparison: Comparison, title: str, agreement: Agreement) -> Html:
    runs = comparison.kind == "runs"
    judge, other = ("in the first", "in the second") if runs else ("predicted", "on the robot")

    def cell(name: str, style: str) -> Html:
        value = format_count(round(getattr(agreement, name)))
        tip = cell_name(comparison, name)
        return element(
            "td", element("b", value), element("small", name.upper()), class_=style, title=tip
        )

    rows = [
        named_row(f"{verdict} {judge}", *cells)
        for verdict, cells in (
            ("success", (cell("tp", "right"), cell("fp", "wrong"))),
            ("failure", (cell("fn", "wrong"), cell("tn", "right"))),
        )
    ]
    head = ["", f"success {other}", f"failure {other}"]
    return element(
        "div", element("h3", title[0].upper() + title[1:]), table(head, rows, style="confusion")
    )
