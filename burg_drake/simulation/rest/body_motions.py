"""How far objects have been moved and turned from where they stood."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context

from burg_drake.core import Array, rotation_angle

TOPPLED = math.radians(45.0)
"""An object whose axis that was upright is tilted by more than this lies [rad]."""


class MotionTracker:
    """Watches bodies: the point of each that has moved farthest, how far it has turned, and how its
    centre of mass moves.

    Args:
        plant: the plant.
        plant_context: its Context, with the bodies where they stand.
        bodies: which to watch.
        corners: gives the corners (N, 3) of a body's convex hull in its frame [m]. No point of a
            body moves farther than the one of them that moves farthest.

    Attributes:
        farthest: largest displacement of each body's farthest point since the start [m].
        turned: largest rotation of each body since the start [rad].
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        plant_context: Context,
        bodies: Iterable[BodyIndex],
        corners: Callable[[BodyIndex], Array],
    ) -> None:
        self._plant = plant
        self._plant_context = plant_context
        self._corners = corners
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
        p_PP_W = self._corners(index) @ (R_WB - R_WB_start).T + (p_WB - p_WB_start)
        farthest = math.sqrt((p_PP_W * p_PP_W).sum(axis=1).max())
        return farthest, float(rotation_angle(R_WB @ R_WB_start.T))

    def _pose(self, index: BodyIndex) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of a body in the world [m]."""
        X_WB = self._plant.EvalBodyPoseInWorld(self._plant_context, self._plant.get_body(index))
        return np.array(X_WB.rotation().matrix()), np.array(X_WB.translation())

    def _center(self, index: BodyIndex) -> Array:
        return center_of_mass(self._plant, self._plant_context, self._plant.get_body(index))


def center_of_mass(plant: MultibodyPlant, plant_context: Context, body: RigidBody) -> Array:
    """Centre of mass (3,) of a body in the world [m]."""
    X_WB = plant.EvalBodyPoseInWorld(plant_context, body)
    p_WCm: Array = X_WB.multiply(body.default_com())
    return p_WCm
