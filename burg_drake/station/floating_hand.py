"""Places the floating hand of a station diagram in a Context."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, inverse
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.hand_model import find_hand


class FloatingHand:
    """Handle on the hand of a diagram built with `robot="hand"`.

    Args:
        station_diagram: the diagram.

    Attributes:
        document: the hand's document.
        body: the hand's body H.
        fingers, joints, pads: bodies, joints and pads of the two fingers, in the document's order.
        lift: the joint that carries the hand.

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
        inspector = station_diagram.scene_graph.model_inspector()
        found = find_hand(plant, inspector, hand, model)
        self.body, self.joints, self.pads = found.body, found.joints, found.pads
        self.fingers = (found.fingers[0].index(), found.fingers[1].index())
        driven = [plant.get_joint_actuator(i).joint() for i in plant.GetJointActuatorIndices(model)]
        self._order = [found.joints.index(joint) for joint in driven]
        self.lift = plant.GetJointByName("lift")
        self._X_HG = hand.X_HG.matrix()
        self._X_GH = inverse(self._X_HG)
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
        for joint, finger in zip(self.joints, self.document.fingers, strict=True):
            q = finger.open + closed * (finger.closed - finger.open)
            joint.set_translation(plant_context, q)
            joint.set_translation_rate(plant_context, 0.0)

    def closing_command(self) -> Array:
        """(4,) desired state that closes the hand: positions of the two fingers and velocities, in
        the order of the model's actuators."""
        fingers = [self.document.fingers[i] for i in self._order]
        speed = self.document.closing_speed
        direction = [np.sign(f.closed - f.open) for f in fingers]
        return np.array([f.closed for f in fingers] + [speed * d for d in direction])

    def finger_speed(self, plant_context: Context) -> float:
        """Speed of the faster finger [m/s]."""
        return max(abs(joint.get_translation_rate(plant_context)) for joint in self.joints)

    def risen(self, plant_context: Context) -> float:
        """How far the hand has risen since it was placed [m]."""
        return float(self.lift.get_translation(plant_context))

    def X_WG(self, plant_context: Context) -> Array:
        """(4, 4) current grasp frame."""
        X_WH = self._plant.EvalBodyPoseInWorld(plant_context, self.body).GetAsMatrix4()
        return X_WH @ self._X_HG
