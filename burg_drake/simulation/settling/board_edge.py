"""Keeps objects on the board while they fall or come to rest.

What gets beyond the edge is sent back as fast as it has to be to slide that far. Walls would be
simpler, but things come to lean at walls, and fall over once these are gone.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core import inverse, transform_points
from burg_drake.scene.arrangement import ObjectShapes
from burg_drake.station.diagram import StationDiagram

TOLERANCE = 0.001
"""An object may be so much further out than the margin [m]."""
FRICTION = 0.3
"""Coefficient of friction that brakes what slides: a little less than the .32 of `household` on the
table of `panda_tabletop`, so that nothing is sent too far."""
GRAVITY = 9.81
"""[m/s^2]."""


class BoardEdgeGuard:
    """Sends bodies back that get beyond the edge of the board."""

    def __init__(
        self, built: StationDiagram, shapes: ObjectShapes, *, margin: float, share: float
    ) -> None:
        """
        Args:
            built: a diagram.
            shapes: of the library's objects.
            margin: that objects keep from the edge [m].
            share: of friction that is left.
        """
        scene = built.scene
        self._plant = built.plant
        self._corners = {
            index: shapes[scene.instances[name].object].corners
            for name, index in built.free.items()
        }
        self._X_WS = built.station.document.X_WS.matrix()
        self._X_SW = inverse(self._X_WS)
        self._least, self._most = np.full(2, margin), np.array(scene.board.size) - margin
        self._braking = share * FRICTION * GRAVITY

    def push_back(self, context: Context, bodies: Iterable[BodyIndex]) -> None:
        """Gives those that are too far out the speed at which they slide back.

        Args:
            context: the plant's; its velocities change.
            bodies: free ones; those that are locked stay where they are.
        """
        for index in bodies:
            body = self._plant.get_body(index)
            X_WO = self._plant.EvalBodyPoseInWorld(context, body)
            p_S = transform_points(self._X_SW @ X_WO.GetAsMatrix4(), self._corners[index])[:, :2]
            inwards = np.maximum(0.0, self._least - p_S.min(axis=0))
            outwards = np.maximum(0.0, p_S.max(axis=0) - self._most)
            shift = np.append(inwards - outwards, 0.0)
            distance = np.linalg.norm(shift)
            if distance > TOLERANCE and not body.is_locked(context):
                direction = self._X_WS[:3, :3] @ shift / distance
                V_WO = self._plant.EvalBodySpatialVelocityInWorld(context, body)
                V_WOcm = V_WO.Shift(X_WO.rotation() @ body.default_com())
                wanted = np.sqrt(2.0 * self._braking * distance)
                lacking = max(0.0, wanted - direction @ V_WOcm.translational())
                faster = SpatialVelocity(np.zeros(3), lacking * direction)
                self._plant.SetFreeBodySpatialVelocity(context, body, V_WO + faster)
