"""The page of a comparison for people: one HTML file that needs nothing else."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from burg_drake.core.terminal import format_count
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    command,
    element,
    header,
    html_page,
    join,
    section,
    tiles,
)
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.report.agreement import agreement_sections
from burg_drake.experiment.comparison.report.cases import (
    case_section,
    outcome_section,
    stopped_section,
)
from burg_drake.experiment.comparison.report.figures import (
    figure_section,
    group_section,
    matrix_section,
    standing_out_section,
    unpredictable_section,
)
from burg_drake.experiment.comparison.report.margins import margin_section, placement_section
from burg_drake.experiment.comparison.wording import (
    IN_PERCENT,
    bias_words,
    difference_of_all_words,
    estimated,
    have_same_rows,
    headline,
    interval,
    number,
    of_selected,
    standing_out_words,
    unpredictable_words,
    weighted,
)
from burg_drake.experiment.pairing import Side
from burg_drake.experiment.statistics import Estimate

KINDS = {
    "trials": "Simulation against reality",
    "simulators": "Two simulations against reality",
    "runs": "Simulation against simulation",
}


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
    title = ", ".join(c.first.scenes[:3]) + (" and others" if len(c.first.scenes) > 3 else "")
    title = f"{title} on {c.first.station}"
    return html_page(
        f"{KINDS[c.kind]}: {title}",
        element("style", Html(_style())),
        header(KINDS[c.kind], title, _about(c)),
        _lead(c),
        *(element("p", note, class_="notice") for note in c.notes),
        *_sections(c, _photos(c, Path(path))),
        *more,
        _settings(c),
        section("How to repeat it", "The same inputs give the same page.", command(line))
        if line
        else None,
    )


def _style() -> str:
    folder = files("burg_drake.experiment.comparison.report")
    return (folder / "style.css").read_text(encoding="utf-8")


def _about(c: Comparison) -> str:
    what = "grasps" if c.kind == "runs" else "trials"
    counts = "as long as the object is held" if c.success == "held" else "nothing else disturbed"
    sides = [c.first, *([c.second] if c.second else []), c.reference]
    who = " against ".join(side.label for side in (sides[0], sides[-1]))
    if c.second:
        who = f"{c.first.label} and {c.second.label} against {c.reference.label}"
    return f"{format_count(c.coverage.compared)} {what}: {who}; success: {c.success}, {counts}"


def _lead(c: Comparison) -> Html:
    if have_same_rows(c):
        return element("p", element("b", headline(c)), class_="lead")
    found = estimated(c.judgement)
    entries: list[tuple[str, Child, str]] = [
        _tile("Same verdict" if c.kind == "runs" else "Right verdicts", found.accuracy, "accuracy"),
        _tile("Precision", found.precision, "precision"),
        _tile("Recall", found.recall, "recall"),
        _tile("Matthews correlation", found.matthews, "matthews"),
        _tile("Cohen's kappa", found.kappa, "kappa"),
    ]
    what, whose = "trials", "of the selected trials"
    if weighted(c.judgement) is not None:
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
            element("b", _unbroken(headline(c))),
            _unbroken(f" {' '.join(filter(None, _more_words(c)))}"),
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


def _more_words(c: Comparison) -> list[str]:
    """The sentences after the first one; empty ones are left out."""
    judged = c.judgement
    if c.kind == "simulators":
        return [difference_of_all_words(c)]
    return [bias_words(c), unpredictable_words(judged), standing_out_words(judged)]


def _unbroken(text: str) -> str:
    """Keeps per cent signs with their numbers."""
    return text.replace(" %", "\u00a0%")


def _tile(name: str, found: Estimate, key: str) -> tuple[str, Child, str]:
    percent = key in IN_PERCENT
    if found.value is None:
        return name, "-", found.reason
    if percent:
        return name, f"{100 * found.value:.0f} %", f"{interval(found, percent=True)} %"
    return name, number(found, percent=False), interval(found, percent=False)


def _sections(c: Comparison, photos: Path | None) -> list[Html | None]:
    judged = [("", c.judgement)]
    if c.other is not None:
        judged = [("first", c.judgement), ("second", c.other)]
    if have_same_rows(c):
        return []
    parts = [*agreement_sections(c), matrix_section(c, judged), _difference(c)]
    parts.append(figure_section(c, judged))
    for name, judgement in judged:
        parts += [_named(part, name) for part in _of_one(c, judgement, photos)]
    return parts


def _of_one(c: Comparison, judgement: Judgement, photos: Path | None) -> list[Html | None]:
    right = "same verdict in both runs" if c.kind == "runs" else "right verdicts"
    text = f"Share of {right}, precision and recall, with 95 % intervals."
    of = of_selected(c)
    parts = [
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
    return parts


def _named(part: Html | None, name: str) -> Html | None:
    """Says in a section's title which simulator it is about."""
    if part is None or not name:
        return part
    return Html(part.replace("</h2>", f" ({name} simulator)</h2>", 1))


def _difference(c: Comparison) -> Html | None:
    """Whether one of two simulators is right more often."""
    d = c.difference
    if d is None or d.p_value is None or d.difference.value is None:
        return None
    points = interval(d.difference, percent=True)
    text = (
        f"{difference_of_all_words(c)} Both are right in {d.both} of {d.trials} trials, only the"
        f" first in {d.only_first}, only the second in {d.only_second}, neither in {d.neither}. In"
        f" these trials the first is right {100 * d.difference.value:+.1f} percentage points more"
        f" often {points}; McNemar's exact test of equally many right verdicts:"
        f" p = {d.p_value:.3g}."
    )
    return section("Which simulator is right more often?", text.lstrip())


def _settings(c: Comparison) -> Html:
    """What was compared, what was left out, in what runs differ."""
    facts: list[tuple[str, str]] = []
    sides = [("predictions", c.first), ("second simulation", c.second), ("truth", c.reference)]
    if c.kind == "runs":
        sides = [("first run", c.first), ("second run", c.reference)]
    facts += [(name, _side(side)) for name, side in sides if side is not None]
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


def _side(side: Side) -> str:
    hashes = ", ".join(side.hashes[:6]) + (" and others" if len(side.hashes) > 6 else "")
    how = "" if side.kind == "trials" else f", mode {side.mode}, {side.engines}"
    run = "runs" if len(side.hashes) > 1 else "run"
    return f"{side.path}{how}, station {side.station}, {run} {hashes}"


def _photos(c: Comparison, path: Path) -> Path | None:
    """Folder of the trials file from that of the page."""
    if c.reference.kind != "trials":
        return None
    folder = Path(c.reference.path).absolute().parent
    return Path(os.path.relpath(folder, path.absolute().parent))
