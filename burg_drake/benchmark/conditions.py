"""Conditions of a benchmark that differ from those of its suite, to see how robust a planner is."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from burg_drake.core import Ranges, Units, require_ranges, setting


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """How far sensor, calibration and friction are from what the suite says. Change one at a time.

    Attributes:
        depth_noise: standard deviations of the depth, as a multiple of the sensor's. Holes and
            flying pixels stay.
        camera_shift: standard deviation of the error of the camera's position along each axis, in
            the pose that the planner is told [m].
        camera_turn: standard deviation of the error of its orientation about each axis [rad].
        friction: friction coefficient of the object that is grasped, as a multiple of its own.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True
    RANGES: ClassVar[Ranges] = {
        "depth_noise": (0.0, 100.0),
        "camera_shift": (0.0, 1.0),
        "camera_turn": (0.0, math.pi),
        "friction": (0.01, 100.0),
    }

    depth_noise: float = setting(
        1.0, "standard deviations of depth, as a multiple of the sensor's", metavar="FACTOR", low=0
    )
    camera_shift: float = setting(
        0.0, "error of the camera's position in the told pose", unit=Units.millimetres, low=0
    )
    camera_turn: float = setting(
        0.0, "error of the camera's orientation in the told pose", unit=Units.degrees, low=0
    )
    friction: float = setting(
        1.0, "friction of grasped objects, as a multiple of their own", metavar="FACTOR", above=0
    )

    def __post_init__(self) -> None:
        require_ranges(self)

    @property
    def changes(self) -> dict[str, float]:
        """Values that differ from those of the suite, by name."""
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }

    def __str__(self) -> str:
        """Such as `depth noise x 2`; `as in the suite` if nothing differs."""
        return ", ".join(_TEXTS[name](value) for name, value in self.changes.items()) or (
            "as in the suite"
        )


_TEXTS: dict[str, Any] = {
    "depth_noise": lambda value: f"depth noise x {value:g}",
    "camera_shift": lambda value: f"camera shift {1e3 * value:g} mm",
    "camera_turn": lambda value: f"camera turn {math.degrees(value):g} deg",
    "friction": lambda value: f"friction x {value:g}",
}
