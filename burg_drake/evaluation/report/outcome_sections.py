"""Sections of the report about outcomes: opening, stages, counts by object, certainty, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import (
    NO_VALUE,
    Outcome,
    Stage,
    clustered_interval,
    format_duration,
    format_number,
    format_percent,
)
from burg_drake.evaluation.outcome_counts import OutcomeCounts, Summary
from burg_drake.evaluation.report.page_elements import GROUP_CLASSES, ReportSection
from burg_drake.visualization import OUTCOME_GROUPS, PageTable

STAGE_LOSSES = {
    stage: tuple(o for o in Outcome if o.stage is stage and o is not Outcome.SIMULATION_FAILED)
    for stage in Stage
}
"""Outcomes by the stage at which they end, without failed simulations."""
STEP_LOSSES = {
    "clear": STAGE_LOSSES[Stage.CLEAR],
    "reachable": STAGE_LOSSES[Stage.REACHABLE],
    "planned": STAGE_LOSSES[Stage.PLANNED],
    "executed": (Outcome.SIMULATION_FAILED,),
    "held": tuple(o for o in STAGE_LOSSES[Stage.EXECUTED] if not o.held),
    "lifted": (Outcome.LIFTED_DISTURBED, Outcome.LIFTED_TURNED),
}
"""Outcomes that end a grasp before each step of the funnel."""


CountedBar = tuple[OutcomeCounts, list[tuple[int, str, str]]]
"""Counts of grasps, and count, CSS class and tooltip of each part of their bar."""


def outcome_bar(counts: OutcomeCounts) -> CountedBar:
    """A bar of grasps by groups of outcomes."""
    parts = []
    for group in OUTCOME_GROUPS:
        inside = {o: counts.outcomes[o] for o in group.outcomes if counts.outcomes[o]}
        detail = ", ".join(f"{count} {outcome_text(o)}" for o, count in inside.items())
        parts.append((sum(inside.values()), GROUP_CLASSES[group.name], f"{group.name}: {detail}"))
    return counts, parts


def object_bars(summary: Summary) -> list[CountedBar]:
    """A bar for each object, and one for the total of several objects.

    Of more than 40 objects, only the 40 with the lowest success rates get a bar.
    """
    max_objects = 40
    objects = list(summary.objects)
    if len(objects) > max_objects:
        objects = worst_first(objects)[:max_objects]
    return [outcome_bar(group) for group in _add_total(objects, summary)]


def _add_total(objects: list[OutcomeCounts], summary: Summary) -> list[OutcomeCounts]:
    """The objects, and the total of several objects."""
    return [*objects, summary.total] if len(objects) > 1 else objects


def worst_first(groups: Sequence[OutcomeCounts]) -> list[OutcomeCounts]:
    """Groups sorted by success rate of executed grasps, lowest first.

    Groups without executed grasps come first; among equal rates, the less certain ones do.
    """

    def rank(group: OutcomeCounts) -> tuple[float, float]:
        return (group.lifted / group.executed if group.executed else -1.0), group.interval[0]

    return sorted(groups, key=rank)


def count_section(summary: Summary) -> ReportSection:
    """Matrix of objects and outcomes."""
    seen = [o for o in Outcome if summary.total.outcomes[o]]
    groups = _add_total(list(summary.objects), summary)
    rows = [[group.name, *(group.outcomes[o] or NO_VALUE for o in seen)] for group in groups]
    head = ["object", *(outcome_text(o) for o in seen)]
    matrix = PageTable(head, rows, range(1, len(head)), "matrix", total=len(groups) > 1)
    return ReportSection("Counts", "Every grasp ends with exactly one outcome.", matrix)


def cost_section(summary: Summary) -> ReportSection:
    """CPU time by stage."""
    head = ["stage", "grasps", "CPU time", "median", "grasps per CPU second"]
    rows = []
    for cost in summary.costs:
        durations = format_duration(cost.seconds), format_duration(cost.median)
        rows.append([cost.name, cost.grasps, *durations, format_number(cost.rate)])
    text = "CPU time of the worker processes, without their start."
    if summary.mode != "hand":
        text += " The time for reachable includes the search for motions of the arm."
    if summary.mode == "arm":
        text += " The time for planned is that of timing them."
    return ReportSection("Cost", text, PageTable(head, rows, (1, 2, 3, 4)))


def outcome_text(outcome: Outcome) -> str:
    """Displayed name of an outcome."""
    return outcome.value.replace("_", " ")


STEP_MEANINGS = {
    "candidates": "grasps that were judged",
    "clear": "the open hand overlaps nothing",
    "reachable": "hand and arm reach the grasp",
    "planned": "the arm has a path there and can follow the lift",
    "executed": "the trial was simulated to its end",
    "held": "both fingers hold the object to the end",
    "lifted": "not turned in the hand, and nothing else was disturbed",
}
"""What the grasps counted at each step have passed."""


@dataclass(frozen=True)
class CascadeStep:
    """Grasps that pass a stage.

    Attributes:
        name: name of the step.
        passed: number of grasps.
        before: number of grasps that passed the previous step; 0 for the first step.
        lost: grasps that end here, by outcome, most frequent first.
    """

    name: str
    passed: int
    before: int
    lost: Mapping[Outcome, int]

    @property
    def meaning(self) -> str:
        """What the grasps have passed."""
        return STEP_MEANINGS[self.name]

    @property
    def lost_groups(self) -> list[tuple[str, int]]:
        """CSS class of each group of outcomes, and number of its grasps that end here."""
        return [
            (GROUP_CLASSES[group.name], sum(self.lost.get(o, 0) for o in group.outcomes))
            for group in OUTCOME_GROUPS
        ]


def cascade_steps(summary: Summary) -> list[CascadeStep]:
    """Grasps that pass or end at each stage."""
    found: list[CascadeStep] = []
    for step in summary.steps:
        counts = {o: summary.total.outcomes[o] for o in STEP_LOSSES.get(step, ())}
        lost = {o: n for o, n in sorted(counts.items(), key=lambda pair: -pair[1]) if n}
        before = found[-1].passed if found else 0
        found.append(CascadeStep(step, summary.total.funnel[step], before, lost))
    return found


CERTAINTY_CLASSES = {
    "lifted": GROUP_CLASSES["lifted"],
    "contested": "contested",
    "failed": GROUP_CLASSES["lost during lift or hold"],
}
"""CSS classes of certain and of contested verdicts."""


def certainty_bars(summary: Summary) -> list[CountedBar]:
    """A bar for each object with executed grasps; none if no verdict has a confidence."""
    if not summary.knows_confidence or not summary.total.executed:
        return []
    tried = [group for group in summary.objects if group.executed]
    return [_certainty_bar(group) for group in _add_total(tried, summary)]


def _certainty_bar(group: OutcomeCounts) -> CountedBar:
    lifts, losses = group.contested_lifts, group.contested - group.contested_lifts
    counts = (group.surely_lifted, group.contested, group.surely_lost)
    tips = (
        f"lifted: {group.surely_lifted}",
        f"contested: {lifts} lifted, {losses} failed",
        f"failed: {group.surely_lost}",
    )
    return group, list(zip(counts, CERTAINTY_CLASSES.values(), tips, strict=True))


def success_interval(summary: Summary, *, executed: bool) -> str:
    """The 95 % interval of the share of lifted grasps, such as "79 to 93 %".

    Args:
        summary: summary of a run, of one scene or of many.
        executed: share of the executed grasps, not of all.
    """
    groups = summary.scenes or (summary.total,)
    whole = [group.executed if executed else group.judged for group in groups]
    low, high = clustered_interval([group.lifted for group in groups], whole)
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def early_losses(summary: Summary) -> list[tuple[str, int]]:
    """Outcomes that end grasps before the trial, with their counts."""
    words = {
        "clear": "the open hand collides",
        "reachable": "hand or arm cannot reach the grasp",
        "planned": "the arm has no path",
        "executed": "the simulation failed",
    }
    counts = {
        text: sum(summary.total.outcomes[o] for o in STEP_LOSSES[step])
        for step, text in words.items()
    }
    return [(text, number) for text, number in counts.items() if number]


def spread_sentences(summary: Summary) -> list[str]:
    """Sentences about differences of success between scenes and between objects, if there are
    several.
    """
    found = _spread_sentence(summary.scenes, "scene"), _spread_sentence(summary.objects, "object")
    return [text for text in found if text]


def _spread_sentence(groups: Sequence[OutcomeCounts], what: str) -> str:
    """Sentence about the best and the worst of the tried objects or scenes."""
    min_scenes = 8  # From this number on, quartiles are shown in place of the extremes.
    tried = [group for group in groups if group.executed]
    if len(tried) < 2:
        return ""
    shares = [group.lifted / group.executed for group in tried]
    if min(shares) == max(shares):
        where = "In" if what == "scene" else "On"
        return f"{where} each {what} that was tried it is {format_percent(shares[0])}."
    if what == "scene" and len(tried) >= min_scenes:
        low, middle, high = np.quantile(shares, [0.25, 0.5, 0.75])
        return (
            f"In half of the scenes, success when executed is between {format_percent(low)} and"
            f" {format_percent(high)} (median {format_percent(middle)})."
        )
    low, high = (tried[shares.index(pick(shares))] for pick in (min, max))
    return (
        f"By {what}, success when executed is between {format_percent(min(shares))} ({low.name}:"
        f" {low.lifted} of {low.executed}) and {format_percent(max(shares))} ({high.name}:"
        f" {high.lifted} of {high.executed})."
    )
