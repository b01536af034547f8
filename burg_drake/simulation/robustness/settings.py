"""What robustness is tested with: loads, friction coefficients and noise.

It is apart from the tests, as who only asks for them needs no simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from burg_drake.core import DEGREES, MILLIMETRES, PERCENT, InvalidInputError, setting


@dataclass(frozen=True, kw_only=True)
class LoadSettings:
    """How a grip is loaded.

    Attributes:
        smallest, largest: accelerations that are tried [g].
        tolerance: relative distance between the largest that is borne and the next that is not.
        slide: the target has left its place when its point at the grasp has moved in the hand by
            more than this [m]; it has left, too, when a finger does not touch it.
        tug_rise: a tug grows to its full force in this time [s], which it then keeps ...
        tug_time: ... for this long [s]; less if the target is at rest under it.
        frequency: of shaking [Hz].
        periods: of shaking; the amplitude grows during the first one.
    """

    smallest: float = 0.05
    largest: float = 50.0
    tolerance: float = 0.03
    slide: float = 0.005
    tug_rise: float = 0.05
    tug_time: float = 0.2
    frequency: float = 5.0
    periods: int = 3

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest < self.largest:
            raise InvalidInputError(
                f"loads are from {self.smallest:g} to {self.largest:g} g; the smallest must be"
                " above 0, the largest above the smallest"
            )
        for name in ("tolerance", "slide", "tug_rise", "tug_time", "frequency", "periods"):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"{name} is {getattr(self, name):g}; give more than 0")


@dataclass(frozen=True, kw_only=True)
class FrictionSettings:
    """Which coefficients are tried.

    Attributes:
        smallest, largest: coefficients.
        tolerance: relative distance between the smallest that lifts and the next that does not.
    """

    smallest: float = 0.02
    largest: float = 2.0
    tolerance: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest < self.largest:
            raise InvalidInputError(
                f"friction is from {self.smallest:g} to {self.largest:g}; the smallest must be"
                " above 0, the largest above the smallest"
            )
        if not self.tolerance > 0.0:
            raise InvalidInputError(f"tolerance is {self.tolerance:g}; give more than 0")


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations.

    Attributes:
        translation: of the grasp in the target, along each axis [m].
        rotation: of the grasp in the target, about each axis [rad].
        mass: of the target, relative.
        friction: of the target's coefficient, relative.
    """

    translation: float = setting(
        0.005, "noise of the grasp along each axis", unit=MILLIMETRES, low=0
    )
    rotation: float = setting(
        math.radians(5.0), "noise of the grasp about each axis", unit=DEGREES, low=0
    )
    mass: float = setting(0.1, "noise of the object's mass", unit=PERCENT, low=0)
    friction: float = setting(
        0.2, "noise of the object's friction coefficient", unit=PERCENT, low=0
    )

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < math.inf:
                raise InvalidInputError(f"noise of the {name} is {value:g}; give 0 or more")
