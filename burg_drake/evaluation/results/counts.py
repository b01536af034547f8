"""The counts that a run is summed up in: by object, outcome and stage, rates, CPU time."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from burg_drake.core import wilson_interval
from burg_drake.core.grasps import CPU_COLUMNS, PUSHED, Mode, Outcome, Stage
from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.results.shortened_lifts import ShortLifts

ARM_STAGES = (Stage.REACHABLE.value, Stage.PLANNED.value)
"""Counts of the funnel that a run without the arm does not have."""
STAGES: dict[Mode, tuple[Stage, ...]] = {
    "hand": (Stage.CLEAR, Stage.EXECUTED),
    "reach": (Stage.CLEAR, Stage.REACHABLE, Stage.EXECUTED),
    "arm": tuple(Stage),
}
"""Stages whose cost is known by mode; that of `reachable` includes the search for motions, that of
`planned` is their timing."""
PUSH = 0.001
"""Objects that the approach moved by more than this were pushed [m]."""


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
        return {
            "candidates": self.judged,
            "clear": self.clear,
            "reachable": self.reachable,
            "planned": self.planned,
            "executed": self.executed,
            "held": self.held,
            "lifted": self.lifted,
        }

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
        pushed: those in which it moved any free object, the target too, by more than `PUSH`.
        largest: displacement of any of them [m].
        target_pushed, target_largest: the same of the target alone.
    """

    trials: int
    pushed: int
    largest: float
    target_pushed: int
    target_largest: float

    def __str__(self) -> str:
        text = f"The approach moved an object by more than {1e3 * PUSH:g} mm"
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
        notes: what is missing, and why, one sentence each; see `notes`.
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
        absent = set() if self.mode != "hand" else set(ARM_STAGES)
        if self.total.reachable < self.total.clear:
            absent.discard(Stage.REACHABLE.value)
        return [name for name in self.total.funnel if name not in absent]


def pushes(columns: Columns) -> Pushes | None:
    """What approaches pushed in the trials of a table; None if none were simulated."""
    if "pushed" not in columns:
        return None
    went = np.isfinite(columns["pushed"])
    if not went.any():
        return None
    anything, instance = columns["pushed"][went], columns["instance"][went]
    target = np.zeros(len(anything))
    for name in np.unique(instance):
        of = instance == name
        target[of] = columns[PUSHED + name][went][of]
    return Pushes(
        trials=len(anything),
        pushed=int((anything > PUSH).sum()),
        largest=float(anything.max()),
        target_pushed=int((target > PUSH).sum()),
        target_largest=float(target.max()),
    )


def stage_cost(columns: Columns, stage: Stage) -> StageCost:
    """CPU time of a stage, from its column."""
    cpu = columns[CPU_COLUMNS[stage]]
    cpu = cpu[np.isfinite(cpu)]
    median = float(np.median(cpu)) if len(cpu) else math.nan
    return StageCost(stage.value, len(cpu), float(cpu.sum()), median)
