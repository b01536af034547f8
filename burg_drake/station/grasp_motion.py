"""Motion of the hand around a grasp: lengths and directions of its straight segments."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from burg_drake.core import FieldError, Ranges, Units, Vector3, require_ranges, setting

if TYPE_CHECKING:
    from burg_drake.core import Array

MOTION_LENGTH_RANGES = {
    "standoff": (0.0, 1.0),
    "retreat": (0.0, 1.0),
    "lift_height": (0.0, 2.0),
    "least_lift": (0.0, 2.0),
}
"""Metres, range of each length."""


def _length_setting(default: float | None, field: str, help: str, name: str = "") -> Any:
    """Declares a length with its range."""
    low, high = (1000.0 * bound for bound in MOTION_LENGTH_RANGES[field])
    return setting(
        default,
        help,
        name=name,
        unit=Units.millimetres_by_division,
        low=low,
        high=high,
        noun="a length",
    )


@dataclass(frozen=True, kw_only=True)
class GraspMotion:
    """How the hand goes straight to a grasp and away from it.

    From the pregrasp to the grasp, back by the retreat, and up by the lift.

    The defaults are those of Rudorfer et al., "BURG-Toolkit" (2022). MoveIt calls `least_lift` the
    minimum and `lift_height` the desired distance of the post-grasp retreat.

    Attributes:
        standoff: distance from pregrasp to grasp [m].
        retreat: distance back along the approach with the object, before the lift [m].
        lift_height: length of the lift [m].
        least_lift: length of the lift that has to be free of obstacles [m]; the hand rises as far
            as there is room. If left out, all of `lift_height` has to be free.
        lift_direction: direction of the lift in the world, of any length.
    """

    RANGES: ClassVar[Ranges] = MOTION_LENGTH_RANGES

    standoff: float = _length_setting(0.10, "standoff", "length of the straight approach")
    retreat: float = _length_setting(
        0.0, "retreat", "length of the retreat along the approach, before the lift"
    )
    lift_height: float = _length_setting(0.30, "lift_height", "length of the lift", "lift_mm")
    least_lift: float | None = _length_setting(
        None, "least_lift", "lift as far as there is room, at least by this"
    )
    lift_direction: Vector3 = setting(
        (0.0, 0.0, 1.0), "direction of the lift in the world (0 0 1: up)", metavar=("X", "Y", "Z")
    )

    def __post_init__(self) -> None:
        min_lift = 1e-3  # Metres of retreat and lift together, without which no failure shows.
        x, y, z = (float(part) for part in self.lift_direction)  # arrays are no part of documents
        object.__setattr__(self, "lift_direction", (x, y, z))
        require_ranges(self)
        if self.least_lift is not None and self.least_lift > self.lift_height:
            raise FieldError(
                f"least_lift is {self.least_lift:g} m, more than lift_height ("
                f"{self.lift_height:g} m); give at most lift_height",
                "least_lift",
            )
        if not math.hypot(*self.lift_direction) > 1e-9:
            raise FieldError(
                f"lift_direction {list(self.lift_direction)} has length 0; give a"
                " direction in the world, such as [0, 0, 1] for up",
                "lift_direction",
            )
        shortest = self.retreat + self.shortest
        if shortest < min_lift:
            raise FieldError(
                f"retreat and lift together may be as short as {1e3 * shortest:g} mm; the"
                f" hand must move at least {1e3 * min_lift:g} mm with the object",
                "least_lift" if self.least_lift is not None else "lift_height",
            )

    @property
    def shortest(self) -> float:
        """The part of the lift that has to be free [m]."""
        return self.lift_height if self.least_lift is None else self.least_lift

    @property
    def direction_W(self) -> Array:
        """(3,) unit vector of the lift in the world."""
        import numpy as np

        u = np.array(self.lift_direction, dtype=float)
        return np.asarray(u / np.linalg.norm(u))
