"""What happened to the grasps from step to step, in sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from burg_drake.core.grasps import outcome_label
from burg_drake.core.terminal import format_percent
from burg_drake.experiment.gap.changes import Change
from burg_drake.experiment.gap.step_agreement import StepAgreement
from burg_drake.experiment.gap.steps import GapDocument, GapSteps, StepName
from burg_drake.experiment.trials import Success, succeeded

TITLES: dict[StepName, str] = {
    "hand": "hand alone",
    "reach": "with the arm",
    "arm": "whole arm executes",
    "placed": "objects displaced",
}
NOT_PREDICTABLE = "not predictable"
"""Column of trials that failed for reasons that a step's mode does not predict."""
VERBS: dict[Success, str] = {"lifted": "lifts", "held": "holds"}


def step_sentences(steps: GapSteps, changes: Sequence[Change], success: Success) -> list[str]:
    """One sentence or two a step."""
    hand = steps.first
    outcomes = [verdict.outcome for verdict in hand.verdicts.values()]
    good = sum(succeeded(outcome, success) for outcome in outcomes)
    sentences = [f"Of {len(outcomes)} grasps the hand alone {VERBS[success]} {good}."]
    sentences += [_sentence(change, steps.document) for change in changes]
    return sentences + [text for change in changes if (text := left_out(change))]


def left_out(change: Change) -> str:
    """What is said of grasps that a step leaves out; empty if there are none."""
    if not change.failed:
        return ""
    return (
        f"{TITLES[change.step].capitalize()}: {change.failed} could not be simulated here or in the"
        f" step before, and {'counts' if change.failed == 1 else 'count'} as neither lost nor won."
    )


def _sentence(change: Change, document: GapDocument) -> str:
    if change.successes == 0:
        return f"{TITLES[change.step].capitalize()}: no success is left that could be lost."
    lost, whole = len(change.lost), change.successes
    share = f" ({format_percent(lost / whole)})"
    left = whole - lost + len(change.won)
    won = f", {len(change.won)} {_are(len(change.won))} won" if change.won else ""
    if change.step == "reach":
        return (
            f"Of these {whole}, {lost}{share} {_are(lost)} lost to the arm{_causes(change)}{won};"
            f" {left} {_are(left)} left."
        )
    if change.step == "arm":
        return (
            f"Of these {whole}, {lost}{share} {_are(lost)} lost when the whole arm executes them"
            f"{_causes(change)}{won}; {left} {_are(left)} left."
        )
    low, high = change.share_lost
    return (
        f"When objects stand {_noise(document)} from where they should be (standard deviations),"
        f" {format_percent(lost / whole)} of the {whole} trials of these grasps in"
        f" {document.samples} displaced scenes fail{_causes(change)}; the 95 % interval is"
        f" {100 * low:.0f} to {100 * high:.0f} %."
    )


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _noise(document: GapDocument) -> str:
    return f"{document.place_mm:g} mm along x and y and {document.turn_deg:g} degrees"


def _causes(change: Change) -> str:
    """The outcomes that successes turn into, most frequent first."""
    into = Counter(move.after for move in change.lost)
    parts = [f"{count} {outcome_label(outcome)}" for outcome, count in into.most_common(4)]
    rest = into.total() - sum(count for _, count in into.most_common(4))
    return f" ({', '.join(parts)}{f', {rest} otherwise' if rest else ''})" if parts else ""


def reality_words(agreement: Sequence[StepAgreement]) -> str:
    """What the counts and the shares beside the robot are of."""
    if any(one.all_grasps is None for one in agreement):
        return "counts and shares are of the tried grasps, each counted once"
    grasps = round(max(sum(one.estimated.cells) for one in agreement))
    return (
        "counts are those of the tried grasps; precision, recall and accuracy are"
        f" estimated for the {grasps:,} grasps from which they were chosen"
    )


def replay_command(run: str, grasp: str) -> list[str]:
    """Words of the command that shows a grasp."""
    return ["burg-drake", "replay", run, "--grasp", grasp]
