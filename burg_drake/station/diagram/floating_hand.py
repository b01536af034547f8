"""Places the floating hand of a station diagram in a Context."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError
from burg_drake.station.diagram.hand_handle import HandHandle
from burg_drake.station.diagram.station_diagram import StationDiagram

UP = np.array((0.0, 0.0, 1.0))


class FloatingHand(HandHandle):
    """Handle on the hand of a diagram built with `robot="hand"`.

    Args:
        station_diagram: the diagram.

    Attributes:
        document, body, fingers, joints, pads: see `HandHandle`.
        lift: the joint that carries the hand along a straight segment.

    Raises:
        InvalidInputError: the diagram has no floating hand.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        if station_diagram.robot != "hand":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'hand'"
            )
        super().__init__(station_diagram)
        plant = station_diagram.plant
        self.lift = plant.GetJointByName("lift")
        self._base = plant.GetFrameByName("lift_base")
        self._mount = plant.GetFrameByName("lift_mount")

    def place(
        self,
        plant_context: Context,
        X_WG: Array,
        closed: float = 0.0,
        direction_W: Array = UP,
    ) -> None:
        """Puts the grasp frame at `X_WG` (4, 4), lift at 0, all at rest.

        Args:
            plant_context: the plant's part of the Context.
            X_WG: grasp in the world.
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).
            direction_W: (3,) unit vector, in which the lift goes from there.
        """
        self._set_mount(plant_context, X_WG @ self._X_GH, direction_W)
        self.set_fingers(plant_context, closed)

    def set_lift_direction(self, plant_context: Context, direction_W: Array) -> None:
        """Has the lift go in another direction (3,) from where the hand is, at rest there; the
        fingers stay as they are, and move on as they do."""
        self._set_mount(plant_context, self.X_WH(plant_context), direction_W)

    def travelled(self, plant_context: Context) -> float:
        """How far the hand has gone along the lift [m]."""
        return float(self.lift.get_translation(plant_context))

    def _set_mount(self, plant_context: Context, X_WH: Array, direction_W: Array) -> None:
        # The lift joint goes along z of its frames L: the base has the hand's position, and the
        # mount takes up the hand's orientation.
        R_WL = RotationMatrix(_rotation_from_z(direction_W))
        R_WH = RotationMatrix(X_WH[:3, :3])
        self._base.SetPoseInParentFrame(plant_context, RigidTransform(R_WL, X_WH[:3, 3]))
        R_HL = R_WH.inverse().multiply(R_WL)
        self._mount.SetPoseInParentFrame(plant_context, RigidTransform(R_HL, np.zeros(3)))
        self.lift.set_translation(plant_context, 0.0)
        self.lift.set_translation_rate(plant_context, 0.0)


def _rotation_from_z(u: Array) -> Array:
    """A rotation (3, 3) that takes z to a unit vector (3,); none for z itself."""
    if u[2] < 0.0:
        return _rotation_from_z(-u) @ np.diag([1.0, -1.0, -1.0])
    v = np.array((-u[1], u[0], 0.0))
    cross = np.array(((0.0, -v[2], v[1]), (v[2], 0.0, -v[0]), (-v[1], v[0], 0.0)))
    turned: Array = np.eye(3) + cross + cross @ cross / (1.0 + u[2])
    return turned
