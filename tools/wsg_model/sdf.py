"""Writes the SDF text of the gripper."""

from __future__ import annotations

from math import pi

from tools.robot_model.inertia import box_inertia
from tools.robot_model.sdf import FingerJoint, filter_group, finger_joint, link, model_sdf
from tools.robot_model.shapes import mirrored_finger
from tools.wsg_model.collision import BODY_SHAPES, FINGER_SHAPES
from tools.wsg_model.figures import (
    BODY,
    FINGER_EFFORT,
    FINGER_MASS,
    FINGER_SPEED,
    FINGER_TRAVEL,
    body_inertia,
)

BODY_LINK = "wsg_body"
FINGER_LINKS = ("wsg_left_finger", "wsg_right_finger")
FINGER_JOINTS = ("wsg_left_joint", "wsg_right_joint")
"""Positions rise along +x of H for both, as they do in other models of this gripper: the left
finger opens from 0 to +55 mm, the right one from 0 to -55 mm."""
RANGES = ((0.0, FINGER_TRAVEL), (-FINGER_TRAVEL, 0.0))


def hand_sdf() -> str:
    """SDF text of the gripper with its two fingers."""
    right = mirrored_finger(FINGER_SHAPES)
    parts = [link(BODY_LINK, "", body_inertia(), BODY_SHAPES, "body.obj")]
    for name, joint, shapes, yaw in zip(
        FINGER_LINKS, FINGER_JOINTS, (FINGER_SHAPES, right), (0.0, pi), strict=True
    ):
        pose = f'<pose relative_to="{joint}"/>'
        inertia = box_inertia(shapes, FINGER_MASS)
        parts.append(link(name, pose, inertia, shapes, "finger.obj", visual_yaw=yaw))
    mimics = (None, (FINGER_JOINTS[0], -1))
    for name, child, limits, mimic in zip(FINGER_JOINTS, FINGER_LINKS, RANGES, mimics, strict=True):
        joint_figures = FingerJoint(
            name=name,
            parent=BODY_LINK,
            child=child,
            p_PJ=(0.0, 0.0, BODY[2]),
            axis=(1, 0, 0),
            limits=limits,
            effort=FINGER_EFFORT,
            speed=FINGER_SPEED,
            mimic=mimic,
        )
        parts.append(finger_joint(joint_figures))
    parts.append(filter_group("gripper", (BODY_LINK, *FINGER_LINKS)))
    sources = "Figures: data sheet and command set of the WSG 50-110; wsg50-ros-pkg."
    return model_sdf("wsg_50", "wsg_model", sources, parts)
