"""The answer to one question about the robustness of a grasp, and how journals keep it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.evaluation.stages import Decision
from burg_drake.simulation.robustness import HoldForces

WEIGHT, FRICTION = "weight", "friction"
IN_NUMBERS = Outcome.LIFTED
"""Outcome in journals of an answer that is in numbers alone."""


@dataclass(frozen=True)
class ProbeAnswer:
    """The answer to a probe.

    Workers return it and journals keep it in the form of a verdict, with its numbers in the place
    of the margins. A verdict needs an outcome: `lifted` stands for an answer in numbers, as only
    what was lifted has one. A journal has no infinity, which stands for a limit beyond all that is
    tried.

    Attributes:
        test: one of `settings.TESTS`.
        outcome: how the trial ended. Of `noise` that is the answer; the other tests have one only
            where the object was not held, and None where their answer is in numbers.
        forces: what the grip bears, of `tug` and `shake`.
        friction: smallest coefficient that lifts, of `friction`.
    """

    test: str
    outcome: Outcome | None = None
    forces: HoldForces | None = None
    friction: float | None = None

    @property
    def failed(self) -> bool:
        """Whether the test has no answer, because the object was not held."""
        return self.test != "noise" and self.outcome is not None

    def decision(self) -> Decision:
        """The form in which workers return it."""
        numbers: dict[str, float] = {}
        if self.forces is not None:
            numbers = {**self.forces.accelerations, WEIGHT: self.forces.weight}
        if self.friction is not None:
            numbers = {FRICTION: self.friction}
        return Decision(IN_NUMBERS if self.outcome is None else self.outcome, margins=numbers)

    @classmethod
    def from_verdict(cls, test: str, verdict: Verdict) -> ProbeAnswer:
        """The answer that a journal has kept; of a trial, only how it ended."""
        if test == "noise" or verdict.outcome is not IN_NUMBERS:
            return cls(test, verdict.outcome)
        numbers = {name: _unlimited(value) for name, value in verdict.margins.items()}
        if test == "friction":
            return cls(test, friction=numbers[FRICTION])
        weight = numbers.pop(WEIGHT)
        return cls(test, forces=HoldForces(numbers, weight))


def _unlimited(value: float) -> float:
    return math.inf if math.isnan(value) else value
