"""Finds the hand in a built station diagram, and reads and moves its fingers in a Context."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context

from burg_drake.core import Array, inverse
from burg_drake.station.diagram.station_diagram import StationDiagram
from burg_drake.station.world import find_hand


class HandHandle:
    """Handle on the hand of a diagram built with `robot="hand"` or `robot="arm"`.

    Args:
        station_diagram: the diagram.

    Attributes:
        document: the hand's document.
        body: the hand's body H.
        fingers, joints, pads: bodies, joints and pads of the two fingers, in the document's order.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
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
        self._X_HG = hand.X_HG.matrix()
        self._X_GH = inverse(self._X_HG)

    def set_fingers(self, plant_context: Context, closed: float) -> None:
        """Puts the fingers somewhere, at rest.

        Args:
            plant_context: the plant's part of the Context.
            closed: how far they are closed, from 0 (open) to 1 (pads together).
        """
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

    def opening_command(self) -> Array:
        """(4,) desired state that opens the hand and presses the fingers against their stops, in
        the order of `closing_command`."""
        fingers = [self.document.fingers[i] for i in self._order]
        return np.array([f.open for f in fingers] + list(-self.closing_command()[2:]))

    def finger_speed(self, plant_context: Context) -> float:
        """Speed of the faster finger [m/s]."""
        speed: float = max(abs(joint.get_translation_rate(plant_context)) for joint in self.joints)
        return speed

    def X_WG(self, plant_context: Context) -> Array:
        """(4, 4) current grasp frame."""
        return self.X_WH(plant_context) @ self._X_HG

    def X_WH(self, plant_context: Context) -> Array:
        """(4, 4) current hand body."""
        X_WH: Array = self._plant.EvalBodyPoseInWorld(plant_context, self.body).GetAsMatrix4()
        return X_WH
