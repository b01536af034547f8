"""Rolling resistance of balls and lying cylinders, which Drake's contacts do not have.

In Drake they roll on whatever slope: a marble in a mug that stands 0.03 degrees askew, as the table
yields under it, and on along the wall. Real ones stay, as both surfaces yield and push back ahead
of the middle of the contact. The moment of that is at most c R N for a radius R that is pressed on
with N, so that they stay on slopes up to c.

Below that limit the moment is that of a damped spring from where the body stopped, which slips at
the limit: the elastic-plastic model (C) of J. Ai, J.-F. Chen, J. M. Rotter and J. Y. Ooi,
Assessment of rolling resistance models in discrete element simulations, Powder Technology 206,
2011.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from burg_drake.core import Array
from burg_drake.objects.library import Primitive
from burg_drake.station.diagram import StationDiagram

ROLLING_RESISTANCE = 0.002
"""Coefficient c, that of hard wheels and balls on hard floors: steel on steel has 0.001 to
0.0024."""
GRAVITY = 9.81
"""[m/s^2]. A body is taken to be pressed on with its weight."""
SPRING, DAMPER = 0.2, 0.5
"""Of the spring, in shares of what would stop a rolling body within a time step."""


def resist_rolling(built: StationDiagram, simulator: Simulator, share: float = 1.0) -> None:
    """Lets rolling resistance act on the free balls and cylinders of a scene.

    Args:
        built: the diagram; nothing else applies forces to it.
        simulator: of the diagram; its monitor is taken.
        share: of the resistance that acts.
    """
    rolling = []
    for name in built.free:
        primitive = built.scene.entry(name).contact.primitive
        if primitive is not None and primitive.shape != "box":
            rolling.append(_RollingBody(built, name, primitive, share))
    if not rolling:
        return
    port = built.diagram.GetInputPort("applied_forces")

    def update(root: Context) -> EventStatus:
        context = built.plant.GetMyContextFromRoot(root)
        port.FixValue(root, [body.force(context) for body in rolling])
        return EventStatus.Succeeded()

    simulator.set_monitor(update)


class _RollingBody:
    """A ball, or a cylinder, which rolls about its axis alone."""

    def __init__(
        self, built: StationDiagram, name: str, primitive: Primitive, share: float
    ) -> None:
        self._body = built.plant.get_body(built.free[name])
        axis = primitive.X_OP.matrix()[:3, 2]
        self._along = np.eye(3) if primitive.shape == "sphere" else np.outer(axis, axis)
        radius, properties = primitive.size[0], built.scene.entry(name).mass_properties
        inertia = max(properties.inertia[:3]) if primitive.shape == "sphere" else 0.0
        inertia += properties.mass * radius**2
        self._time_step = built.engine.time_step
        self._stiffness = SPRING * inertia / self._time_step**2
        self._damping = DAMPER * inertia / self._time_step
        self._limit = share * ROLLING_RESISTANCE * radius * properties.mass * GRAVITY
        self._turned = np.zeros(3)

    def force(self, context: Context) -> ExternallyAppliedSpatialForce:
        """The moment against its rolling; asked for once a time step."""
        R_WO = self._body.EvalPoseInWorld(context).rotation().matrix()
        w_WO = self._body.EvalSpatialVelocityInWorld(context).rotational()
        rolling = R_WO @ self._along @ R_WO.T @ w_WO
        turned = self._turned + self._time_step * rolling
        self._turned = _shortened(turned, self._limit / self._stiffness)
        moment = -self._stiffness * self._turned - self._damping * rolling
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self._body.index()
        applied.F_Bq_W = SpatialForce(_shortened(moment, self._limit), np.zeros(3))
        return applied


def _shortened(vector: Array, limit: float) -> Array:
    """A vector (3,), of a length of at most `limit`."""
    length = float(np.linalg.norm(vector))
    return vector if length <= limit else vector * (limit / length)
