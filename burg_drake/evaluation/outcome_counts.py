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
    """Index (N,) of each value among the members.

    Args:
        values: (N,) texts.
        members: allowed texts, at most 127.

    Raises:
        InvalidInputError: a value is not a member.
    """
    index = {str(member): k for k, member in enumerate(members)}
    if unknown := sorted({*values.names} - {*index}):
        raise InvalidInputError(f"{list_names(unknown)}: expected one of {list_names([*index])}")
    codes: NDArray[np.int8] = np.array([index[n] for n in values.names], dtype=np.int8)
    return codes.take(values.codes)


@dataclass(frozen=True)
class ShortLifts:
    """Grasps with room for only a part of the lift.

    Attributes:
        grasps: number of grasps with room for at least the shortest allowed lift.
        short: number of grasps without room for the whole lift.
        whole: length of the whole lift [m].
        median, least: median and smallest length of the shortened lifts [m].
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
    """Counts grasps whose lift was shortened for lack of room.

    Args:
        lift_height: (N,) column of a table, NaN for no lift [m].
        whole: length of the whole lift [m].

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
"""Metres; an object that the approach moves farther counts as pushed."""


@dataclass(frozen=True)
class OutcomeCounts:
    """Grasps of one object, or of all.

    Attributes:
        name: the object's name.
        judged: number of grasps.
        outcomes: number of grasps by outcome.
        decided: number of grasps by the stage that decided.
        failed: number of `simulation_failed` by the stage that failed.
        contested: number of executed grasps whose verdict is contested.
        contested_lifts: number of contested grasps whose outcome is `lifted`.
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
        """Number of grasps that passed the screen of the hand."""
        return self.judged - self.decided[Stage.CLEAR]

    @property
    def reachable(self) -> int:
        """Number of clear grasps that the arm can reach; `clear` if no arm was checked."""
        return self.clear - self.decided[Stage.REACHABLE]

    @property
    def planned(self) -> int:
        """Number of reachable grasps with an arm path; `reachable` if no arm was checked."""
        return self.reachable - self.decided[Stage.PLANNED]

    @property
    def executed(self) -> int:
        """Number of grasps whose trial came to an end."""
        return self.planned - self.failed[Stage.EXECUTED]

    @property
    def held(self) -> int:
        """Number of grasps whose target was held to the end."""
        return sum(count for outcome, count in self.outcomes.items() if outcome.held)

    @property
    def lifted(self) -> int:
        """Number of successful grasps: held, and nothing else was disturbed."""
        return self.outcomes[Outcome.LIFTED]

    @property
    def surely_lifted(self) -> int:
        """Number of successful grasps that are not contested."""
        return self.lifted - self.contested_lifts

    @property
    def surely_lost(self) -> int:
        """Number of executed grasps that failed and are not contested."""
        return self.executed - self.lifted - (self.contested - self.contested_lifts)

    @property
    def funnel(self) -> dict[str, int]:
        """Counts from the first stage to success, in descending order."""
        later = ("clear", "reachable", "planned", "executed", "held", "lifted")
        return {"candidates": self.judged, **{name: getattr(self, name) for name in later}}

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the share of executed grasps that are lifted."""
        return wilson_interval(self.lifted, self.executed)


@dataclass(frozen=True)
class StageCost:
    """CPU time of a stage.

    Attributes:
        name: name of the stage.
        grasps: number of grasps that went through it.
        seconds: total CPU time [s].
        median: median CPU time per grasp [s]; NaN if unknown.
    """

    name: str
    grasps: int
    seconds: float
    median: float

    @property
    def rate(self) -> float:
        """Grasps per second of CPU time."""
        return self.grasps / self.seconds if self.seconds > 0.0 else math.nan


@dataclass(frozen=True)
class Pushes:
    """Objects that arm or hand moved before the hand closed.

    Attributes:
        trials: number of trials with a simulated approach.
        pushed: number of trials in which any free object, also the target, moved by more than
            `MIN_PUSH`.
        largest: largest displacement of an object [m].
        target_pushed, target_largest: the same for the target alone.
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
    """Key figures of a run.

    Attributes:
        objects: counts by object, in the order of the scene.
        total: counts of all grasps.
        costs: CPU time by stage, sampling first.
        mode: mode of the run.
        pushes: objects pushed by the approach; None if no approach was simulated.
        lifts: grasps without room for the whole lift; None if there are none.
        notes: notes on missing or failed grasps, one sentence each; see `run_notes`.
        scenes: counts by scene of a run over many, in their order.
        knows_confidence: whether verdicts have a confidence; those of earlier releases, and of
            engines with custom settings, have none.
        settled_by: engines that have judged grasps again.
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
        """Names of the funnel's counts that apply to the mode, first to last.

        With the hand alone, `reachable` is included only if hands collide at the pregrasp.
        """
        absent = {"reachable", "planned"} if self.mode == "hand" else set()
        if self.total.reachable < self.total.clear:
            absent.discard("reachable")
        return [name for name in self.total.funnel if name not in absent]


def count_pushes(columns: Columns) -> Pushes | None:
    """Counts the pushes of approaches in the trials of a table; None if none were simulated."""
    if "pushed" not in columns:
        return None
    approached = np.isfinite(columns["pushed"])
    if not approached.any():
        return None
    pushed, instance = columns["pushed"][approached], columns["instance"][approached]
    target = np.zeros(len(pushed))
    for name in np.unique(instance):
        own = instance == name
        target[own] = columns[PUSHED_PREFIX + name][approached][own]
    return Pushes(
        trials=len(pushed),
        pushed=int((pushed > MIN_PUSH).sum()),
        largest=float(pushed.max()),
        target_pushed=int((target > MIN_PUSH).sum()),
        target_largest=float(target.max()),
    )


def stage_cost(columns: Columns, stage: Stage) -> StageCost:
    """CPU time of a stage, from its column."""
    cpu = columns[CPU_COLUMNS[stage]]
    cpu = cpu[np.isfinite(cpu)]
    median = float(np.median(cpu)) if len(cpu) else math.nan
    return StageCost(stage.value, len(cpu), float(cpu.sum()), median)
