"""Places the floating hand of a station diagram in a Context."""

from __future__ import annotations

from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.hand_handle import HandHandle


class FloatingHand(HandHandle):
    """Handle on the hand of a diagram built with `robot="hand"`.

    Args:
        station_diagram: the diagram.

    Attributes:
        document, body, fingers, joints, pads: see `HandHandle`.
        lift: the joint that carries the hand.

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

    def place(self, plant_context: Context, X_WG: Array, closed: float = 0.0) -> None:
        """Puts the grasp frame at `X_WG` (4, 4), lift at 0, all at rest.

        Args:
            plant_context: the plant's part of the Context.
            X_WG: grasp in the world.
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).
        """
        # The lift joint keeps to world z: its base frame has the world's axes and the hand's
        # position, its mount frame takes up the hand's orientation.
        X_WH = X_WG @ self._X_GH
        R_WH = RotationMatrix(X_WH[:3, :3])
        self._base.SetPoseInParentFrame(plant_context, RigidTransform(X_WH[:3, 3]))
        self._mount.SetPoseInParentFrame(plant_context, RigidTransform(R_WH.inverse()))
        self.lift.set_translation(plant_context, 0.0)
        self.lift.set_translation_rate(plant_context, 0.0)
        self.set_fingers(plant_context, closed)

    def risen(self, plant_context: Context) -> float:
        """How far the hand has risen since it was placed [m]."""
        return float(self.lift.get_translation(plant_context))
