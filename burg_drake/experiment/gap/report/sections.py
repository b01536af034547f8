"""Sections of the page on where grasps are lost."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence

import numpy as np

from burg_drake.core.grasps import PUSHED, Outcome, outcome_label
from burg_drake.core.terminal import format_percent
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    command,
    element,
    interval_mark,
    join,
    section,
    table,
)
from burg_drake.evaluation.results import PUSH, pushes
from burg_drake.experiment.gap.changes import Change, OutcomeChange, successes_by_object
from burg_drake.experiment.gap.report.flow import FlowColumn, flow_chart
from burg_drake.experiment.gap.report.sentences import (
    NOT_PREDICTABLE,
    TITLES,
    left_out,
    reality_words,
    replay_command,
)
from burg_drake.experiment.gap.step_agreement import StepAgreement
from burg_drake.experiment.gap.steps import GapSteps
from burg_drake.experiment.statistics import Estimate
from burg_drake.experiment.trials import Success

ROWS = 40
"""Grasps that a step's table lists."""
ABOUT = {
    "reach": "The same simulation of the hand, but only of grasps that the arm can execute: with"
    " a posture within its limits, a straight approach, a straight lift and a path, all"
    " free of collisions.",
    "arm": "The whole arm executes the grasps that it can reach, from the pregrasp on, with"
    " controllers that yield; here the hand may push objects before it closes.",
    "placed": "The hand goes where it was planned to go, but the objects stand a little off. It"
    " counts as a collision if the open hand overlaps a displaced object. The arm knows"
    " where things stand and plans its path again. Each grasp counts once a scene.",
}


def flow_section(steps: GapSteps, found: Sequence[Change]) -> Html | None:
    """The picture of all steps."""
    if not found:
        return None
    columns, scale = [], []
    for step in steps.steps:
        outcomes = Counter(v.outcome for run in step.runs for v in run.verdicts.values())
        plural = "" if len(step.runs) == 1 else "s"
        scenes = f" in {len(step.runs)} scene{plural}" if step.name == "placed" else ""
        columns.append(FlowColumn(TITLES[step.name] + scenes, outcomes))
        scale.append(1.0 / max(len(step.runs), 1))
    return section(
        "From step to step",
        "How grasps end in each step; the colour of a band is that of the outcome in the"
        " next step. In displaced scenes only grasps that succeeded in the step before"
        " are tried, each once a scene.",
        element("div", flow_chart(columns, [c.flow for c in found], scale), class_="scroll"),
    )


def objects_section(steps: GapSteps, success: Success) -> Html:
    """Successes of each object in each step."""
    by_step = [successes_by_object(step, success) for step in steps.steps]
    whole = by_step[0]
    head = ["object", "grasps", *(TITLES[step.name] for step in steps.steps)]
    rows = []
    for name, (_, grasps) in whole.items():
        cells: list[Child] = [grasps]
        for step, counts in zip(steps.steps, by_step, strict=True):
            good, all = counts.get(name, (0, 0))
            share = f"{good} of {all}" if all else "-"
            cells.append(share if step.name == "placed" else good)
        numbers = [element("td", cell, class_="number") for cell in cells]
        rows.append(element("tr", element("th", name, scope="row"), *numbers))
    return section(
        "By object",
        "Grasps of each object that succeed in each step; in displaced scenes, successful trials.",
        table(head, rows, numbers=tuple(range(1, len(head)))),
    )


def change_section(change: Change) -> Html:
    """What one step changes: outcomes, objects, bodies in the way, and the grasps."""
    title = TITLES[change.step].capitalize()
    lost, whole = len(change.lost), change.successes
    parts: list[Child] = []
    if whole:
        low, high = change.share_lost
        share = f"{lost} of {whole} successes are lost ({format_percent(lost / whole)})"
        mark = interval_mark(lost / whole, low, high)
        parts.append(element("p", f"{share} ", mark))
    if change.failed:
        parts.append(element("p", left_out(change)))
    if change.lost or change.won:
        parts += [_flow_table(change), _objects_table(change), _listing(change)]
    return section(title, ABOUT[change.step], *parts)


def _flow_table(change: Change) -> Html:
    """Outcomes before and after, where they differ."""
    moved = {pair: count for pair, count in change.flow.items() if pair[0] is not pair[1]}
    rows = []
    for (before, after), count in sorted(moved.items(), key=lambda item: -item[1]):
        blockers = Counter(
            m.blocker for m in change.moves if (m.before, m.after) == (before, after) and m.blocker
        )
        by = ", ".join(f"{name} {n}" for name, n in blockers.most_common(3))
        rows.append(
            element(
                "tr",
                element("td", outcome_label(before)),
                element("td", outcome_label(after)),
                element("td", count, class_="number"),
                element("td", by or "-", class_="faint"),
            )
        )
    head = ["before", "after", "grasps", "in the way"]
    return table(head, rows, numbers=(2,))


def _objects_table(change: Change) -> Html | None:
    """Which objects suffer."""
    lost = Counter(move.object for move in change.lost)
    if not lost:
        return None
    had = Counter(m.object for m in change.moves if m.lost or m.before.held)
    rows = [
        element(
            "tr",
            element("th", name, scope="row"),
            element("td", f"{count} of {had[name]}", class_="number"),
            element("td", ", ".join(f"{outcome_label(o)} {n}" for o, n in into.most_common(3))),
        )
        for name, count in lost.most_common()
        for into in [Counter(m.after for m in change.lost if m.object == name)]
    ]
    return table(["object", "lost", "what they become"], rows, numbers=(1,))


def _listing(change: Change) -> Html:
    """The grasps that change, and how to watch them."""
    moves = [*change.lost, *change.won]
    rows = [_listed(move) for move in moves[:ROWS]]
    first = shlex.join(replay_command(moves[0].run, moves[0].grasp))
    more = f", the first {ROWS} of {len(moves)}" if len(moves) > ROWS else ""
    inside = join(
        element("p", "To watch one of them (replay also shows what was in the way):"),
        command(first),
        table(["grasp", "before", "after", "in the way", "command"], rows),
    )
    return element("details", element("summary", f"Grasps that change{more}"), inside)


def _listed(move: OutcomeChange) -> Html:
    line = shlex.join(replay_command(move.run, move.grasp))
    return element(
        "tr",
        element("td", element("code", move.grasp)),
        element("td", outcome_label(move.before)),
        element("td", outcome_label(move.after)),
        element("td", move.blocker or "-", class_="faint"),
        element("td", element("code", line, class_="copy")),
    )


def push_section(steps: GapSteps) -> Html | None:
    """By how much the hand pushes objects before it closes."""
    arm = next((step.runs[0] for step in steps.steps if step.name == "arm"), None)
    sentence = None if arm is None else pushes(arm.results)
    if arm is None or sentence is None:
        return None
    columns = arm.results
    went = np.isfinite(columns["pushed"])
    target = np.array(
        [
            columns[PUSHED + str(name)][k] if PUSHED + str(name) in columns else np.nan
            for k, name in enumerate(columns["instance"])
        ]
    )
    rows = []
    for name in dict.fromkeys(columns["object"].tolist()):
        of = went & (columns["object"] == name)
        if not of.any():
            continue
        values = 1e3 * target[of]
        moved = values > 1e3 * PUSH
        held = np.array([Outcome(o).held for o in columns["outcome"][of]])
        cells: list[Child] = [
            int(of.sum()),
            int(moved.sum()),
            f"{np.median(values):.1f}",
            f"{values.max():.1f}",
            f"{int((held & moved).sum())} of {int(moved.sum())}",
            f"{int((held & ~moved).sum())} of {int((~moved).sum())}",
        ]
        numbers = [element("td", cell, class_="number") for cell in cells]
        rows.append(element("tr", element("th", name, scope="row"), *numbers))
    limit = f"{1e3 * PUSH:g} mm"
    head = ["object", "trials", f"pushed over {limit}", "median [mm]", "largest [mm]"]
    head += ["held if pushed", "held if not"]
    return section(
        "Pushed before the hand closes",
        f"{sentence} The table counts only the object to be grasped.",
        table(head, rows, numbers=(1, 2, 3, 4, 5, 6)),
    )


def reality_section(agreement: Sequence[StepAgreement]) -> Html | None:
    """What each step does to the agreement with the robot."""
    if not agreement or not agreement[0].found.trials:
        return None
    rows = []
    for one in agreement:
        cells: list[Child] = [one.found.trials, *(f"{cell:g}" for cell in one.found.cells)]
        cells.append(one.unpredictable)
        numbers = [element("td", cell, class_="number") for cell in cells]
        shares = [
            element("td", _estimate(one.estimated.figure(name)), class_="estimate")
            for name in ("precision", "recall", "accuracy")
        ]
        head = element("th", TITLES[one.step], scope="row")
        rows.append(element("tr", head, *numbers, *shares))
    names = ["step", "trials", "TP", "FP", "FN", "TN", NOT_PREDICTABLE]
    names += ["precision", "recall", "accuracy"]
    return section(
        "Compared with the robot",
        "Real trials compared with each step's verdicts on the same grasps, with 95 %"
        " intervals. Positive means: success is predicted (in displaced scenes: in more"
        f" than half of them). Here {reality_words(agreement)}. "
        f"{NOT_PREDICTABLE.capitalize()} are trials with a failure that the step cannot"
        " predict, for example that the arm has no path if the step judges the hand"
        " alone.",
        table(names, rows, numbers=(1, 2, 3, 4, 5, 6)),
    )


def _estimate(found: Estimate) -> Child:
    if found.value is None or found.low is None or found.high is None:
        return "-"
    return join(
        interval_mark(found.value, found.low, found.high), f" {format_percent(found.value)}"
    )
