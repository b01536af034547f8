"""Writes the gripper document `models/hands/wsg_50.yaml`."""

from __future__ import annotations

from burg_drake.core import SCHEMA_URL
from tools.robot_model.shapes import PAD
from tools.wsg_model.figures import (
    CLOSING_SPEED,
    FINGER_EFFORT,
    FINGER_SPEED,
    FINGER_TRAVEL,
    GRASP_FORCE,
    TCP_HEIGHT,
)
from tools.wsg_model.sdf import BODY_LINK, FINGER_JOINTS, FINGER_LINKS


def hand_yaml() -> str:
    """YAML text of the hand document."""
    fingers = "".join(
        f"  - {{body: {body}, joint: {joint}, pad: {PAD}, closed: 0.0, open: {open_}}}\n"
        for body, joint, open_ in zip(
            FINGER_LINKS, FINGER_JOINTS, (FINGER_TRAVEL, -FINGER_TRAVEL), strict=True
        )
    )
    return f"""# yaml-language-server: $schema={SCHEMA_URL}/hand.json
# Written by tools/wsg_model (python -m tools.wsg_model).
version: 1
name: wsg_50
description: Parallel gripper like the Schunk (Weiss Robotics) WSG 50-110 with flat rubber pads
source: >-
  Body, stroke, force and speed: data sheet of the WSG 50-110. Its 80 N of gripping force are
  {FINGER_EFFORT:g} N a finger, its 420 mm/s {FINGER_SPEED * 1000:g} mm/s a finger.
  Jaws and fingers: wsg50-ros-pkg and schunk_wsg_50.sdf of Drake. Pads: this project.
model: package://burg_drake/models/wsg/wsg_50.sdf
body: {BODY_LINK}
# Grasp frame G in the hand frame H, whose x runs along the stroke, as the one of G does.
X_HG: {{translation: [0.0, 0.0, {TCP_HEIGHT}]}}
opening: [0.0, {2 * FINGER_TRAVEL}]  # distance between the pads [m]
force: {GRASP_FORCE}  # of each finger while gripping [N]
closing_speed: {CLOSING_SPEED}  # of each finger [m/s]
coupled: true  # one drive moves both fingers
# The first finger is on the side of +x of G. `pad`: collision geometry that touches the object.
fingers:
{fingers}"""
