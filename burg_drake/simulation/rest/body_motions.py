"""How far objects have been moved and turned from where they stood."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Protocol

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, rotation_angle

TOPPLED = math.radians(45.0)
"""An object topples only if its axis that was upright is tilted by more than this [rad] ..."""
HIGHER, HIGHER_SHARE = 0.003, 0.1
"""... and its centre of mass is higher or lower above its lowest point than it was, by more than
this [m] and this share of the height: what rolls keeps it."""


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
        self._height = {index: self._own_height(index) for index in self._start}
        self._overturned: set[BodyIndex] = set()
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
            if self._is_tilted(index) and self._is_higher_or_lower(index):
                self._overturned.add(index)
            center = self._center(index)
            largest = max(largest, float(np.linalg.norm(center - self._last[index])))
            self._last[index] = center
        return largest

    def toppled(self, bodies: Mapping[str, BodyIndex]) -> list[str]:
        """Names of those of the bodies that are tilted now, and went over an edge on the way or
        rest at another height. What rolls does neither: a ball, or a can that lies."""
        return [
            name
            for name, index in bodies.items()
            if index in self._overturned and self._is_tilted(index)
        ]

    def _is_tilted(self, index: BodyIndex) -> bool:
        """Whether the axis that was upright no longer is."""
        cosine = self._pose(index)[0][2] @ self._start[index][0][2]
        return bool(cosine < math.cos(TOPPLED))

    def _is_higher_or_lower(self, index: BodyIndex) -> bool:
        """Whether the centre of mass is at another height above the body's lowest point."""
        before = self._height[index]
        return abs(self._own_height(index) - before) > max(HIGHER, HIGHER_SHARE * before)

    def _own_height(self, index: BodyIndex) -> float:
        """Of the centre of mass above the body's lowest point [m]; what is below does not count."""
        R_WB, p_WB = self._pose(index)
        lowest = (self._world.corners(index) @ R_WB[2]).min() + p_WB[2]
        return float(self._center(index)[2] - lowest)

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
