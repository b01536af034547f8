"""Writes the gripper document `models/hands/panda_hand.yaml`."""

from __future__ import annotations

from burg_drake.core import SCHEMA_URL
from tools.panda_model.figures import (
    FINGER_EFFORT,
    FINGER_SPEED,
    FINGER_TRAVEL,
    GRASP_FORCE,
    TCP_HEIGHT,
)
from tools.robot_model.shapes import PAD


def hand_yaml() -> str:
    """YAML text of the hand document."""
    fingers = "".join(
        f"  - {{body: panda_{side}finger, joint: panda_finger_joint{index}, pad: {PAD}, "
        f"closed: 0.0, open: {FINGER_TRAVEL}}}\n"
        for index, side in ((1, "left"), (2, "right"))
    )
    return f"""# yaml-language-server: $schema={SCHEMA_URL}/hand.json
# Written by tools/panda_model (python -m tools.panda_model).
version: 1
name: panda_hand
description: Franka Hand, the parallel gripper of the Panda arm
source: >-
  Geometry: franka_ros, franka_description/robots/common/franka_hand.xacro. Force and speed: Franka
  Hand data sheet ({FINGER_EFFORT:g} N continuous and {FINGER_SPEED * 1000:g} mm/s a finger).
model: package://burg_drake/models/panda/panda_hand.sdf
body: panda_hand
# Grasp frame G in the hand frame H: midway between the pads, +z approach, +x closing direction.
X_HG: {{translation: [0.0, 0.0, {TCP_HEIGHT}], rpy_deg: [0.0, 0.0, 90.0]}}
opening: [0.0, {2 * FINGER_TRAVEL}]  # distance between the pads [m]
force: {GRASP_FORCE}  # of each finger while gripping [N]
closing_speed: {FINGER_SPEED}  # of each finger [m/s]
coupled: true  # one drive moves both fingers
# The first finger is on the side of +x of G. `pad`: collision geometry that touches the object.
fingers:
{fingers}"""
