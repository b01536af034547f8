"""Counts of outcomes by object, stage and scene, with rates, intervals, CPU time and pushes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    CPU_COLUMNS,
    PUSHED_PREFIX,
    Array,
    InvalidInputError,
    Mode,
    Outcome,
    Stage,
    list_names,
    wilson_interval,
)
from burg_drake.evaluation.results_table import Columns, TextValues


def member_codes(values: TextValues, members: Sequence[str]) -> NDArray[np.int8]:
    """Place of each value (N,) among the members.

    Args:
        values: (N,) texts.
        members: what they can be, at most 127.

    Raises:
        InvalidInputError: a value is none of them.
    """
    places = {str(member): place for place, member in enumerate(members)}
    if strange := sorted({*values.names} - {*places}):
        raise InvalidInputError(f"{list_names(strange)}: expected one of {list_names([*places])}")
    codes: NDArray[np.int8] = np.array([places[n] for n in values.names], dtype=np.int8)
    return codes.take(values.codes)


@dataclass(frozen=True)
class ShortLifts:
    """Grasps with room for a part of the lift.

    Attributes:
        grasps: how many have room for any of the lifts that were allowed.
        short: how many of them for less than the whole one.
        whole: its length [m].
        median, least: of the short ones [m].
    """

    grasps: int
    short: int
    whole: float
    median: float
    least: float

    def __str__(self) -> str:
        text = (
            f"For {self.short} of {self.grasps} grasps there is no room to lift the whole"
            f" {1e3 * self.whole:g} mm: "
        )
        if self.short == 1:
            return f"{text}it is lifted {1e3 * self.least:.0f} mm."
        least = f"the shortest lift is {1e3 * self.least:.0f} mm"
        return f"{text}the median is {1e3 * self.median:.0f} mm, {least}."


def count_short_lifts(lift_height: Array, whole: float) -> ShortLifts | None:
    """Counts them.

    Args:
        lift_height: (N,) column of a table, NaN where there is no lift [m].
        whole: length of the lift that was asked for [m].

    Returns:
        None if no lift is short.
    """
    known = lift_height[np.isfinite(lift_height)]
    short = known[known < whole - 1e-9]
    if not len(short):
        return None
    return ShortLifts(len(known), len(short), whole, float(np.median(short)), float(short.min()))


STAGES_BY_MODE: dict[Mode, tuple[Stage, ...]] = {
    "hand": (Stage.CLEAR, Stage.EXECUTED),
    "reach": (Stage.CLEAR, Stage.REACHABLE, Stage.EXECUTED),
    "arm": tuple(Stage),
}
"""Stages whose CPU time is known; `reachable` includes the search for motions."""
MIN_PUSH = 0.001
"""Metres; objects that the approach moved by more were pushed."""


@dataclass(frozen=True)
class OutcomeCounts:
    """Grasps of one object, or of all.

    Attributes:
        name: the object's name.
        judged: number of grasps.
        outcomes: number of grasps by outcome.
        decided: number of grasps by the stage that decided.
        failed: number of `simulation_failed` by the stage that failed.
        contested: number of executed grasps whose verdict is contested ...
        contested_lifts: ... and how many of these are lifted so far.
        settled: number of grasps that another engine has judged again.
    """

    name: str
    judged: int
    outcomes: Counter[Outcome]
    decided: Counter[Stage]
    failed: Counter[Stage]
    contested: int = 0
    contested_lifts: int = 0
    settled: int = 0

    @property
    def clear(self) -> int:
        """Grasps that passed the screen of the hand."""
        return self.judged - self.decided[Stage.CLEAR]

    @property
    def reachable(self) -> int:
        """Those where the arm can be, too; the same as `clear` where it was not asked."""
        return self.clear - self.decided[Stage.REACHABLE]

    @property
    def planned(self) -> int:
        """Those to which the arm can move, too, and from there up; likewise."""
        return self.reachable - self.decided[Stage.PLANNED]

    @property
    def executed(self) -> int:
        """Those whose trial came to an end."""
        return self.planned - self.failed[Stage.EXECUTED]

    @property
    def held(self) -> int:
        """Those whose target was held to the end."""
        return sum(count for outcome, count in self.outcomes.items() if outcome.held)

    @property
    def lifted(self) -> int:
        """Those that succeeded: held, and nothing else was disturbed."""
        return self.outcomes[Outcome.LIFTED]

    @property
    def surely_lifted(self) -> int:
        """Those that succeeded, and are not contested."""
        return self.lifted - self.contested_lifts

    @property
    def surely_lost(self) -> int:
        """Executed grasps that did not succeed, and are not contested."""
        return self.executed - self.lifted - (self.contested - self.contested_lifts)

    @property
    def funnel(self) -> dict[str, int]:
        """Counts from the first stage to success; none is larger than the one before."""
        later = ("clear", "reachable", "planned", "executed", "held", "lifted")
        return {"candidates": self.judged, **{name: getattr(self, name) for name in later}}

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share of executed grasps that are lifted."""
        return wilson_interval(self.lifted, self.executed)


@dataclass(frozen=True)
class StageCost:
    """CPU time of a stage.

    Attributes:
        name: of the stage.
        grasps: how many it looked at.
        seconds: CPU time in all [s].
        median: CPU time of the median grasp [s]; NaN where it is not known.
    """

    name: str
    grasps: int
    seconds: float
    median: float

    @property
    def rate(self) -> float:
        """Grasps a second of CPU time."""
        return self.grasps / self.seconds if self.seconds > 0.0 else math.nan


@dataclass(frozen=True)
class Pushes:
    """What arm or hand moved before the hand closed.

    Attributes:
        trials: in which it went to the grasp.
        pushed: those in which it moved any free object, the target too, by more than `MIN_PUSH`.
        largest: displacement of any of them [m].
        target_pushed, target_largest: the same of the target alone.
    """

    trials: int
    pushed: int
    largest: float
    target_pushed: int
    target_largest: float

    def __str__(self) -> str:
        text = f"The approach moved an object by more than {1e3 * MIN_PUSH:g} mm"
        text += f" in {self.pushed} of {self.trials} trials"
        if self.pushed:
            text += f" (largest {1e3 * self.largest:.1f} mm)"
            text += f", the object to be grasped in {self.target_pushed}"
        if self.target_pushed:
            text += f" (largest {1e3 * self.target_largest:.1f} mm)"
        return f"{text}."


@dataclass(frozen=True)
class Summary:
    """A run in numbers.

    Attributes:
        objects: by object, in the order of the scene.
        total: all together.
        costs: by stage, sampling first.
        mode: what was asked about each grasp.
        pushes: what the approaches pushed; None where none were simulated.
        lifts: where there is no room for the whole lift; None if there is wherever there is any.
        notes: what is missing, and why, one sentence each; see `run_notes`.
        scenes: by scene, in a run over many, in their order.
        knows_confidence: whether verdicts have a confidence; those of earlier releases, and of
            engines with settings of their own, have none.
        settled_by: the engines that have judged grasps again.
    """

    objects: tuple[OutcomeCounts, ...]
    total: OutcomeCounts
    costs: tuple[StageCost, ...]
    mode: Mode
    pushes: Pushes | None = None
    lifts: ShortLifts | None = None
    notes: tuple[str, ...] = ()
    scenes: tuple[OutcomeCounts, ...] = ()
    knows_confidence: bool = False
    settled_by: tuple[str, ...] = ()

    @property
    def steps(self) -> list[str]:
        """Names of the funnel's counts that the mode has, first to last. With the hand alone, the
        pregrasp is the part of what can be reached that may be in a collision."""
        absent = {"reachable", "planned"} if self.mode == "hand" else set()
        if self.total.reachable < self.total.clear:
            absent.discard("reachable")
        return [name for name in self.total.funnel if name not in absent]


def count_pushes(columns: Columns) -> Pushes | None:
    """What approaches pushed in the trials of a table; None if none were simulated."""
    if "pushed" not in columns:
        return None
    went = np.isfinite(columns["pushed"])
    if not went.any():
        return None
    anything, instance = columns["pushed"][went], columns["instance"][went]
    target = np.zeros(len(anything))
    for name in np.unique(instance):
        own = instance == name
        target[own] = columns[PUSHED_PREFIX + name][went][own]
    return Pushes(
        trials=len(anything),
        pushed=int((anything > MIN_PUSH).sum()),
        largest=float(anything.max()),
        target_pushed=int((target > MIN_PUSH).sum()),
        target_largest=float(target.max()),
    )


def stage_cost(columns: Columns, stage: Stage) -> StageCost:
    """CPU time of a stage, from its column."""
    cpu = columns[CPU_COLUMNS[stage]]
    cpu = cpu[np.isfinite(cpu)]
    median = float(np.median(cpu)) if len(cpu) else math.nan
    return StageCost(stage.value, len(cpu), float(cpu.sum()), median)
