"""How far objects have been moved and turned from where they stood."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Protocol

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, rotation_angle

TOPPLED = math.radians(45.0)
"""An object whose axis that was upright is tilted by more than this lies [rad]."""


class PlacedBodies(Protocol):
    """What a tracker has to know of a world."""

    def X_WB(self, body: BodyIndex) -> Array:
        """(4, 4) of a body."""
        ...

    def center(self, body: BodyIndex) -> Array:
        """Centre of mass (3,) of a body in the world [m]."""
        ...

    def corners(self, body: BodyIndex) -> Array:
        """(N, 3) corners of a body's convex hull in its frame [m]."""
        ...


class MotionTracker:
    """Watches bodies: the point of each that has moved farthest, how far it has turned, and how its
    centre of mass moves.

    Args:
        world: with the bodies where they stand. No point of a body moves farther than the corner
            of its hull that moves farthest.
        bodies: which to watch.

    Attributes:
        farthest: largest displacement of each body's farthest point since the start [m].
        turned: largest rotation of each body since the start [rad].
    """

    def __init__(self, world: PlacedBodies, bodies: Iterable[BodyIndex]) -> None:
        self._world = world
        self._start = {index: self._pose(index) for index in bodies}
        self._last = {index: self._center(index) for index in self._start}
        self.farthest = dict.fromkeys(self._start, 0.0)
        self.turned = dict.fromkeys(self._start, 0.0)

    def update(self, still: Collection[BodyIndex]) -> float:
        """Measures; those in `still` are at rest.

        Returns:
            The largest motion of a centre of mass since the last look [m].
        """
        largest = 0.0
        for index in self._start.keys() - still:
            moved, angle = self._since_start(index)
            self.farthest[index] = max(self.farthest[index], moved)
            self.turned[index] = max(self.turned[index], angle)
            center = self._center(index)
            largest = max(largest, float(np.linalg.norm(center - self._last[index])))
            self._last[index] = center
        return largest

    def toppled(self, bodies: Mapping[str, BodyIndex]) -> list[str]:
        """Names of those of the bodies that lie now, and stood at the start."""
        upright = math.cos(TOPPLED)
        tilts = {name: self._pose(i)[0][2] @ self._start[i][0][2] for name, i in bodies.items()}
        return [name for name, cosine in tilts.items() if cosine < upright]

    def _since_start(self, index: BodyIndex) -> tuple[float, float]:
        """How far the farthest point of a body is from where it was [m], and its rotation [rad].

        The way of a point is linear in its place on the body, and its length convex: no point
        within the hull has gone farther than every corner.
        """
        (R_WB, p_WB), (R_WB_start, p_WB_start) = self._pose(index), self._start[index]
        p_PP_W = self._world.corners(index) @ (R_WB - R_WB_start).T + (p_WB - p_WB_start)
        farthest = math.sqrt((p_PP_W * p_PP_W).sum(axis=1).max())
        return farthest, float(rotation_angle(R_WB @ R_WB_start.T))

    def _pose(self, index: BodyIndex) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of a body in the world [m]."""
        X_WB = self._world.X_WB(index)
        return X_WB[:3, :3], X_WB[:3, 3]

    def _center(self, index: BodyIndex) -> Array:
        return self._world.center(index)
