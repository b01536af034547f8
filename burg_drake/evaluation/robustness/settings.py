"""What is asked about the robustness of each grasp."""

from __future__ import annotations

from dataclasses import dataclass, field

from burg_drake.core import InvalidInputError, UnknownNameError, nearest, setting
from burg_drake.simulation.robustness import FrictionSettings, LoadSettings, Noise

TESTS = ("tug", "shake", "friction", "noise")
LOADED_TESTS = ("tug", "shake")
"""Those that put loads on a grip, which needs Drake."""
DEFAULT_BEST = 3
"""So many of the best grasps of each object are asked about if none are named."""


@dataclass(frozen=True, kw_only=True)
class RobustnessSettings:
    """What is asked about each grasp.

    Attributes:
        tests: some of `TESTS`.
        loads: of tug and shake.
        friction: coefficients that are tried.
        noise: standard deviations of the perturbed repeats.
        repeats: number of perturbed repeats.
        seed: of the perturbations.
    """

    tests: tuple[str, ...] = TESTS
    loads: LoadSettings = field(default_factory=LoadSettings)
    friction: FrictionSettings = field(default_factory=FrictionSettings)
    noise: Noise = field(default_factory=Noise)
    repeats: int = setting(20, "repeats of each grasp with noise", metavar="K", low=1)
    seed: int = 0

    def __post_init__(self) -> None:
        for test in self.tests:
            if test not in TESTS:
                raise UnknownNameError(f"test {test!r} does not exist; {nearest(test, TESTS)}")
        if not self.tests or self.repeats < 1:
            raise InvalidInputError("give at least one test, and repeats from 1")

    def content(self, test: str) -> list[object]:
        """What decides about the answers of a test."""
        if test == "friction":
            return [vars(self.friction)]
        return [vars(self.noise), self.seed] if test == "noise" else [vars(self.loads)]
