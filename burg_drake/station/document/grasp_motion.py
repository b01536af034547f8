"""How the hand goes to a grasp and away from it: lengths and directions of the straight
segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, FieldError
from burg_drake.core.documents import Vector3, require_ranges

RANGES = {
    "standoff": (0.0, 1.0),
    "retreat": (0.0, 1.0),
    "lift_height": (0.0, 2.0),
    "least_lift": (0.0, 2.0),
}
"""Lengths that an arm may go [m]."""
SHORTEST = 1e-3
"""Least way of the hand with the object, retreat and lift together [m]: with less, nothing would
tell a grasp that holds from one that does not."""


@dataclass(frozen=True, kw_only=True)
class GraspMotion:
    """Straight ways of the hand, without turning: from the pregrasp along the approach to the
    grasp; then, with the object, back along the approach, and from there along the lift.

    The defaults are those of Rudorfer et al., "BURG-Toolkit" (2022). MoveIt calls `least_lift` the
    minimum and `lift_height` the desired distance of the post-grasp retreat.

    Attributes:
        standoff: from pregrasp to grasp [m].
        retreat: way back along the approach with the object, before the lift [m].
        lift_height: length of the lift [m].
        least_lift: what has to be free of it [m]: the hand rises as high as there is room, but no
            less than this; None if the whole lift has to be free.
        lift_direction: of the lift in the world; of any length above 0.
    """

    standoff: float = 0.10
    retreat: float = 0.0
    lift_height: float = 0.30
    least_lift: float | None = None
    lift_direction: Vector3 = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        x, y, z = (float(part) for part in self.lift_direction)  # arrays are no part of documents
        object.__setattr__(self, "lift_direction", (x, y, z))
        ranges = {k: v for k, v in RANGES.items() if getattr(self, k) is not None}
        require_ranges(self, ranges)
        if self.least_lift is not None and self.least_lift > self.lift_height:
            raise FieldError(
                f"least_lift is {self.least_lift:g} m, more than lift_height, {self.lift_height:g}"
                " m; the hand rises by no more than lift_height",
                "least_lift",
            )
        if not np.linalg.norm(self.lift_direction) > 1e-9:
            raise FieldError(
                f"lift_direction {list(self.lift_direction)} has no length; give a direction in the"
                " world, such as [0, 0, 1] for up",
                "lift_direction",
            )
        shortest = self.retreat + self.shortest
        if shortest < SHORTEST:
            raise FieldError(
                f"retreat and lift together may be as short as {1e3 * shortest:g} mm; the hand"
                f" has to go {1e3 * SHORTEST:g} mm at least with the object",
                "least_lift" if self.least_lift is not None else "lift_height",
            )

    @property
    def shortest(self) -> float:
        """The part of the lift that has to be free [m]."""
        return self.lift_height if self.least_lift is None else self.least_lift

    @property
    def direction_W(self) -> Array:
        """(3,) unit vector of the lift in the world."""
        u = np.array(self.lift_direction, dtype=float)
        return np.asarray(u / np.linalg.norm(u))
