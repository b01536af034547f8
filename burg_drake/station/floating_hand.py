"""Places the floating hand of a station diagram in a Context."""

from __future__ import annotations

import itertools

import numpy as np
from pydrake.geometry import CalcObb
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.station.diagram import StationDiagram


class FloatingHand:
    """Handle on the hand of a diagram built with `robot="hand"`.

    Args:
        station_diagram: the diagram.

    Raises:
        InvalidInputError: the diagram has no floating hand.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        if station_diagram.robot != "hand":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'hand'"
            )
        plant, hand = station_diagram.plant, station_diagram.station.hand
        self.document = hand
        self._plant = plant
        model = plant.GetModelInstanceByName("hand")
        self.body = plant.GetBodyByName(hand.body, model)
        self.joints = tuple(plant.GetJointByName(f.joint, model) for f in hand.fingers)
        self.fingers = tuple(plant.GetBodyByName(f.body, model).index() for f in hand.fingers)
        self.lift = plant.GetJointByName("lift")
        self._base = plant.GetFrameByName("lift_base")
        self._mount = plant.GetFrameByName("lift_mount")
        self.bounds = self._bounds(station_diagram)

    def _bounds(self, station_diagram: StationDiagram) -> tuple[Array, Array]:
        """Corners of the open hand's bounding box in the grasp frame [m]."""
        context = station_diagram.diagram.CreateDefaultContext()
        plant_context = self._plant.GetMyMutableContextFromRoot(context)
        self.place(plant_context, np.eye(4))
        inspector = station_diagram.scene_graph.model_inspector()
        corners = []
        for index in station_diagram.robot_bodies:
            body = self._plant.get_body(index)
            X_GB = self._plant.EvalBodyPoseInWorld(plant_context, body)
            for geometry in self._plant.GetCollisionGeometriesForBody(body):
                obb = CalcObb(inspector.GetShape(geometry))
                half = obb.half_width()
                X_GK = X_GB @ inspector.GetPoseInFrame(geometry) @ obb.pose()
                signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
                corners.append(X_GK.multiply((signs * half).T).T)
        points = np.concatenate(corners)
        return points.min(axis=0), points.max(axis=0)

    def place(self, plant_context: Context, X_WG: Array) -> None:
        """Puts the grasp frame at `X_WG` (4, 4), fingers open, lift at 0, all at rest.

        The lift joint keeps to world z: its base frame has the world's axes and the hand's
        position, its mount frame takes up the hand's orientation.
        """
        X_WH = self.document.X_AH(X_WG)
        R_WH = RotationMatrix(X_WH[:3, :3])
        self._base.SetPoseInParentFrame(plant_context, RigidTransform(X_WH[:3, 3]))
        self._mount.SetPoseInParentFrame(plant_context, RigidTransform(R_WH.inverse()))
        self.lift.set_translation(plant_context, 0.0)
        self.lift.set_translation_rate(plant_context, 0.0)
        for joint, finger in zip(self.joints, self.document.fingers, strict=True):
            joint.set_translation(plant_context, finger.open)
            joint.set_translation_rate(plant_context, 0.0)

    def closing_command(self) -> Array:
        """(4,) desired state that closes the hand: positions, velocities of the two fingers."""
        speed = self.document.closing_speed
        direction = [np.sign(f.closed - f.open) for f in self.document.fingers]
        return np.array([f.closed for f in self.document.fingers] + [speed * d for d in direction])

    def finger_speed(self, plant_context: Context) -> float:
        """Speed of the faster finger [m/s]."""
        return max(abs(joint.get_translation_rate(plant_context)) for joint in self.joints)

    def X_WG(self, plant_context: Context) -> Array:
        """(4, 4) current grasp frame."""
        X_WH = self._plant.EvalBodyPoseInWorld(plant_context, self.body).GetAsMatrix4()
        return X_WH @ self.document.X_HG.matrix()
