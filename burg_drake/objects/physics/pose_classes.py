"""Which of an object's stable poses an orientation belongs to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from burg_drake.core import Array
from burg_drake.objects.library import StablePose
from burg_drake.objects.physics.landscape import (
    ROLL_MARGIN,
    TILT_MARGIN,
    NeutralEquilibrium,
    PotentialLandscape,
)
from burg_drake.objects.physics.stability import same_minimum
from burg_drake.objects.physics.symmetry import SymmetrySearch

NEAR_ANGLE = TILT_MARGIN
"""What is tilted from a pose by less than this is in the pose [rad]; as for quasi-static poses, of
which those parted by a smaller tilt are one."""

SAME_FACET = np.deg2rad(0.5)
"""Directions that differ by less are one, written with different digits [rad]."""


class PoseClasses:
    """Tells the pose of an object that has come to rest.

    An orientation belongs to a pose that is near; to a rolling one if it can roll there; to that
    in whose basin of the landscape it is, unless it is much higher up; and to the pose for which
    such a one is the same by symmetry.

    Args:
        poses: the known poses.
        landscape: of the object.
        search: gives that for the symmetries of the surface about the centre of mass; called if
            they are needed.

    Attributes:
        downs: (3,) unit vector of O that points down, of each pose.
    """

    def __init__(
        self,
        poses: Sequence[StablePose],
        landscape: PotentialLandscape,
        search: Callable[[], SymmetrySearch],
    ) -> None:
        self.poses, self.landscape = tuple(poses), landscape
        self.downs = [-pose.X_SO.matrix()[2, :3] for pose in poses]
        self._make_search = search
        self._neutral: dict[int, NeutralEquilibrium] = {}

    def angle(self, k: int, down: Array) -> float:
        """From pose k to direction `down` (3,), rolling not counted [rad]."""
        turn = angle_between(self.downs[k], down)
        if self.poses[k].rolls:
            if k not in self._neutral:
                self._neutral[k] = self.landscape.neutral(self.downs[k])
            turn = min(turn, self._neutral[k].angle(down))
        return turn

    def find(self, down: Array) -> tuple[int, float] | None:
        """The pose that an object with `down` (3,) down is in.

        Returns:
            Number of the pose, and the angle from it up to symmetry [rad]; None if it is in none.
        """
        angles = [self.angle(k, down) for k in range(len(self.poses))]
        k = int(np.argmin(angles))
        if angles[k] <= NEAR_ANGLE:
            return k, angles[k]
        lowest = self.landscape.basin(down)
        level = float(self.landscape.height(lowest))
        height = float(self.landscape.height(down))
        if angle_between(lowest, down) > NEAR_ANGLE and height * np.cos(ROLL_MARGIN) > level:
            return None
        for k in np.argsort([angle_between(known, lowest) for known in self.downs]).tolist():
            if angle_between(self.downs[k], lowest) < SAME_FACET:
                return k, angles[k]
            near = abs(level - float(self.landscape.height(self.downs[k])))
            if near > self._search.tolerance:
                continue
            if same_minimum(self.landscape, self._search.find(), lowest, self.downs[k]):
                return k, angle_between(lowest, down)
        return None

    @cached_property
    def _search(self) -> SymmetrySearch:
        return self._make_search()


def angle_between(a: Array, b: Array) -> float:
    """Of unit vectors (3,), exact for small angles [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
