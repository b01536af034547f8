"""Steps of the gap as sentences, tables for a terminal, and JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from burg_drake.core import TextTable, format_percent, outcome_label, plain_data
from burg_drake.evaluation import count_pushes
from burg_drake.experiment.comparison.comparison import bracketed_interval, json_values
from burg_drake.experiment.comparison.confusion_matrix import Estimate
from burg_drake.experiment.comparison.finding_tables import FindingTable
from burg_drake.experiment.gap.gap_steps import (
    Change,
    GapDocument,
    GapSteps,
    StepAgreement,
    StepName,
    successes_by_object,
)
from burg_drake.experiment.trials.trial_sheet import Success, is_success
from burg_drake.visualization import Html, interval_mark, join

GAP_STEP_TITLES: dict[StepName, str] = {
    "hand": "hand alone",
    "reach": "with the arm",
    "arm": "whole arm executes",
    "placed": "objects displaced",
}
"""Titles of the steps."""


def step_sentences(steps: GapSteps, changes: Sequence[Change], success: Success) -> list[str]:
    """One or two sentences per step."""
    verbs = {"lifted": "lifts", "held": "holds"}  # Verb by the criterion of success.
    hand = steps.first
    outcomes = [verdict.outcome for verdict in hand.verdicts.values()]
    good = sum(is_success(outcome, success) for outcome in outcomes)
    sentences = [f"Of {len(outcomes)} grasps the hand alone {verbs[success]} {good}."]
    sentences += [_change_sentence(change, steps.document) for change in changes]
    return sentences + [text for change in changes if (text := left_out_sentence(change))]


def left_out_sentence(change: Change) -> str:
    """Sentence about grasps omitted by a step; empty if there are none."""
    if not change.failed:
        return ""
    counts = "counts" if change.failed == 1 else "count"
    return (
        f"{GAP_STEP_TITLES[change.step].capitalize()}: {change.failed} could not be simulated here"
        f" or in the step before, and {counts} as neither lost nor won."
    )


def _change_sentence(change: Change, document: GapDocument) -> str:
    if change.successes == 0:
        return (
            f"{GAP_STEP_TITLES[change.step].capitalize()}: no success is left that could be lost."
        )
    lost, whole = len(change.lost), change.successes
    share = f" ({format_percent(lost / whole)})"
    left = whole - lost + len(change.won)
    won = f", {len(change.won)} {_is_or_are(len(change.won))} won" if change.won else ""
    outcomes = _failure_outcomes(change)
    if change.step != "placed":
        cause = "to the arm" if change.step == "reach" else "when the whole arm executes them"
        return (
            f"Of these {whole}, {lost}{share} {_is_or_are(lost)} lost {cause}{outcomes}{won};"
            f" {left} {_is_or_are(left)} left."
        )
    low, high = change.share_lost
    return (
        f"When objects stand {document.place_mm:g} mm along x and y and {document.turn_deg:g}"
        " degrees from where they should be (standard deviations),"
        f" {format_percent(lost / whole)} of the {whole} trials of these grasps in"
        f" {document.samples} displaced scenes fail{outcomes}; the 95 % interval"
        f" is {100 * low:.0f} to {100 * high:.0f} %."
    )


def _is_or_are(count: int) -> str:
    return "is" if count == 1 else "are"


def _failure_outcomes(change: Change) -> str:
    """Outcomes into which successes turn, most frequent first, in brackets."""
    outcomes = Counter(move.after for move in change.lost)
    parts = [f"{count} {outcome_label(outcome)}" for outcome, count in outcomes.most_common(4)]
    rest = outcomes.total() - sum(count for _, count in outcomes.most_common(4))
    return f" ({', '.join(parts)}{f', {rest} otherwise' if rest else ''})" if parts else ""


def reality_sentence(agreement: Sequence[StepAgreement]) -> str:
    """Sentence about the grasps that the counts and shares of agreement with the robot describe."""
    if any(one.all_grasps is None for one in agreement):
        return "counts and shares are of the tried grasps, each counted once"
    grasps = round(max(sum(one.estimated.cells) for one in agreement))
    return (
        "counts are those of the tried grasps; precision, recall and accuracy are"
        f" estimated for the {grasps:,} grasps from which they were chosen"
    )


def replay_arguments(run: str, grasp: str) -> list[str]:
    """Arguments of the command that shows a grasp."""
    return ["burg-drake", "replay", run, "--grasp", grasp]


def steps_view(steps: GapSteps, changes: Sequence[Change]) -> TextTable:
    """Table of grasps that each step keeps and loses."""
    table = TextTable("Where grasps are lost", caption=_caption(steps))
    table.names("step").numbers(
        "before", "lost", "won", "left", "lost %", "95 % CI", "not simulated"
    )
    table.texts("turned into")
    for change in changes:
        lost, whole = len(change.lost), change.successes
        low, high = change.share_lost
        outcomes = Counter(outcome_label(move.after) for move in change.lost)
        table.row(
            GAP_STEP_TITLES[change.step],
            *(str(n) for n in (whole, lost, len(change.won), whole - lost + len(change.won))),
            format_percent(lost / whole) if whole else "-",
            f"{100 * low:.0f}-{100 * high:.0f} %" if whole else "-",
            str(change.failed),
            ", ".join(f"{name} {count}" for name, count in outcomes.most_common()),
        )
    return table


def _caption(steps: GapSteps) -> str:
    document = steps.document
    if not document.samples:
        return ""
    return (
        f"objects displaced: {document.place_mm:g} mm and {document.turn_deg:g} degrees (standard"
        f" deviations) in {document.samples} scenes; each grasp counts once a scene"
    )


def reality_table(agreement: Sequence[StepAgreement]) -> FindingTable:
    """Table of each step's agreement with the robot."""
    measures = ("precision", "recall", "accuracy")
    sentence = reality_sentence(agreement)
    found = FindingTable(
        title="Compared with the robot",
        caption=f"{sentence}; positive: success predicted",
        text=(
            "Real trials compared with each step's verdicts on the same grasps, with 95 %"
            " intervals. Positive means: success is predicted (in displaced scenes: in more"
            f" than half of them). Here {sentence}. "
            "Not predictable are trials with a failure that the step cannot predict, for example"
            " that the arm has no path if the step judges the hand alone."
        ),
    )
    found.names("step").numbers("trials", "TP", "FP", "FN", "TN", "not predictable")
    found.shares(*measures, interval=False)
    for one in agreement:
        trials, cells = one.selected.trials, (f"{cell:g}" for cell in one.selected.cells)
        shares = (_share_cell(one.estimated.figure(name)) for name in measures)
        found.row(GAP_STEP_TITLES[one.step], f"{trials}", *cells, f"{one.unpredictable}", *shares)
    return found


def _share_cell(estimate: Estimate) -> tuple[str, Html]:
    if estimate.value is None or estimate.low is None or estimate.high is None:
        return "-", Html("-")
    mark = interval_mark(estimate.value, estimate.low, estimate.high)
    text = f"{100 * estimate.value:.0f} {bracketed_interval(estimate, percent=True)} %"
    return text, join(mark, f" {format_percent(estimate.value)}")


def gap_json(
    steps: GapSteps,
    changes: Sequence[Change],
    agreement: Sequence[StepAgreement],
    success: Success,
) -> dict[str, Any]:
    """All figures and changed grasps as JSON values."""
    arm = next((step.runs[0] for step in steps.steps if step.name == "arm"), None)
    pushed = None if arm is None else count_pushes(arm.results)
    return {
        "success": success,
        "asked": plain_data(steps.document),
        "story": step_sentences(steps, changes, success),
        "steps": [
            {
                "name": step.name,
                "runs": [str(run.path) for run in step.runs],
                "outcomes": dict(
                    Counter(v.outcome.value for run in step.runs for v in run.verdicts.values())
                ),
                "objects": {
                    name: {"successes": good, "grasps": all}
                    for name, (good, all) in successes_by_object(step, success).items()
                },
            }
            for step in steps.steps
        ],
        "changes": [_change_json(change) for change in changes],
        "pushed": None if pushed is None else asdict(pushed),
        "reality": [
            {
                "step": one.step,
                "weighted": False,
                **json_values(one.selected),
                "all_grasps": json_values(one.all_grasps),
                "unpredictable": one.unpredictable,
            }
            for one in agreement
        ],
    }


def _change_json(change: Change) -> dict[str, Any]:
    low, high = change.share_lost
    return {
        "step": change.step,
        "successes": change.successes,
        "lost": len(change.lost),
        "won": len(change.won),
        "not_simulated": change.failed,
        "share_lost": {"low": low, "high": high},
        "flow": [
            {"before": a.value, "after": b.value, "count": n}
            for (a, b), n in change.flow.most_common()
        ],
        "blockers": dict(change.blockers.most_common()),
        "grasps": [
            {
                "grasp": move.grasp,
                "object": move.object,
                "before": move.before.value,
                "after": move.after.value,
                "blocker": move.blocker,
                "replay": replay_arguments(move.run, move.grasp),
            }
            for move in (*change.lost, *change.won)
        ],
    }
