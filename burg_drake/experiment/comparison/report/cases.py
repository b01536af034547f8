"""Sections about single grasps and verdicts: where simulation and reality disagree."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from burg_drake.core.grasps import outcome_label
from burg_drake.core.terminal import format_count, format_number
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    command,
    element,
    folded,
    join,
    section,
    table,
)
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.disagreement import Disagreement
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.report.figures import share_mark
from burg_drake.experiment.comparison.wording import cell_name

MOST_CASES = 50
MOST_STOPPED = 30


def case_section(comparison: Comparison, judged: Judgement, photos: Path | None) -> Html | None:
    """The wrong verdicts with the way to look at them; nothing where there are none.

    Args:
        comparison: the comparison.
        judged: what it says of one judge.
        photos: folder of the trials file from that of the page; None without trials.
    """
    if not judged.disagreements:
        return None
    tables = []
    apart = judged.unpredictable
    beyond = {} if apart is None else apart.outcomes
    predicted_successes = 0 if apart is None else apart.predicted_successes
    of = [d for d in judged.disagreements if d.kind == "fp"]
    groups = [
        (
            cell_name(comparison, "fp"),
            [d for d in of if d.ended not in beyond],
            round(judged.selected.fp) - predicted_successes,
        ),
        (
            "success predicted, failed for reasons that the hand alone cannot predict",
            [d for d in of if d.ended in beyond],
            predicted_successes,
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
            shown = min(len(cases), MOST_CASES)
            more = f", the first {shown}" if total > shown else ""
            tables += [
                element("h3", f"{title}: {format_count(total)}{more}", class_="case"),
                _case_table(cases[:MOST_CASES], photos),
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
            cells += [offset, _note(case, photos)]
        cells.append(join(*(command(line) for line in case.replays)))
        rows.append(
            element(
                "tr",
                *(element("td", c, data_label=h) for h, c in zip(head, cells, strict=True)),
            )
        )
    return table(head, rows, style="cases")


def _note(case: Disagreement, photos: Path | None) -> Child:
    """The note, and a link to the photo."""
    if not case.photo or photos is None:
        return case.note
    link = element("a", "photo", href=quote((photos / case.photo).as_posix()))
    return join(case.note, " " if case.note else "", link)


def stopped_section(comparison: Comparison, judged: Judgement, of: str) -> Html:
    """What became of grasps by verdict and the body in the way; `of` says of which."""
    rows = [
        element(
            "tr",
            element("th", outcome_label(row.outcome), scope="row"),
            element("td", row.blocker or "", class_="faint"),
            element("td", row.stage),
            element("td", format_count(row.trials), class_="number", data_label="trials"),
            element("td", share_mark(row.successes), class_="estimate", data_label="succeeded"),
        )
        for row in judged.stopped[:MOST_STOPPED]
    ]
    more = ""
    if len(judged.stopped) > MOST_STOPPED:
        more = f" The first {MOST_STOPPED} of {len(judged.stopped)}."
    head = ["simulated", "body in the way", "stage", "trials", "succeeded, 95 % interval"]
    text = f"For each simulated outcome: how many of these grasps succeeded.{more}"
    if comparison.kind == "runs":
        head[0], head[-1] = "first run", "success in the second, 95 % interval"
        text = (
            "For each outcome in the first run: how many of these grasps succeeded in the"
            f" second run.{more}"
        )
    return section(
        f"How each verdict turned out{of}",
        text,
        table(head, rows, numbers=(3,), style="groups"),
    )


def outcome_section(comparison: Comparison, judged: Judgement, of: str) -> Html:
    """Simulated outcomes by what happened; `of` says of which trials."""
    happened = sorted({name for row in judged.outcomes.values() for name in row})
    rows = []
    for simulated, row in judged.outcomes.items():
        cells = [
            element("td", row.get(name, "·"), class_="number" if name in row else "number zero")
            for name in happened
        ]
        rows.append(element("tr", element("th", outcome_label(simulated), scope="row"), *cells))
    runs = comparison.kind == "runs"
    head = ["first run" if runs else "simulated", *(outcome_label(n) for n in happened)]
    judge, other = ("in simulation", "on the robot")
    if runs:
        judge, other = "in the first run", "in the second"
    numbers = range(1, len(head))
    style = "matrix" if len(head) > 6 else ""
    return folded(
        f"Outcome by outcome{of}",
        f"Rows: how grasps ended {judge}. Columns: how they ended {other}.",
        table(head, rows, numbers=numbers, style=style),
    )
