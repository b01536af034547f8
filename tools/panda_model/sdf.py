"""Writes the SDF text of arm and hand."""

from __future__ import annotations

from math import pi

from tools.panda_model.collision import ARM_SHAPES, HAND_SHAPES, LEFT_FINGER_SHAPES
from tools.panda_model.figures import (
    FINGER_EFFORT,
    FINGER_JOINT_HEIGHT,
    FINGER_MASS,
    FINGER_SPEED,
    FINGER_TRAVEL,
    FLANGE_OFFSET,
    HAND_INERTIA,
    JOINTS,
    LINK_INERTIAS,
    Joint,
    dh_pose,
)
from tools.robot_model.inertia import box_inertia
from tools.robot_model.sdf import (
    FingerJoint,
    filter_group,
    finger_joint,
    link,
    model_sdf,
    numbers,
)
from tools.robot_model.shapes import mirrored_finger


def arm_sdf() -> str:
    """SDF text of the arm: links panda_link0 to panda_link7 and the frame panda_link8."""
    parts = []
    for index, (inertia, shapes) in enumerate(zip(LINK_INERTIAS, ARM_SHAPES, strict=True)):
        pose = f'<pose relative_to="panda_joint{index}"/>' if index else ""
        parts.append(link(f"panda_link{index}", pose, inertia, shapes, f"link{index}.obj"))
    parts.append(
        '    <frame name="panda_link8" attached_to="panda_link7">\n'
        f"      <pose>{numbers((0, 0, FLANGE_OFFSET, 0, 0, 0))}</pose>\n"
        "    </frame>\n"
    )
    parts.extend(_arm_joint(i, joint) for i, joint in enumerate(JOINTS, start=1))
    parts.append(filter_group("wrist", ("panda_link5", "panda_link6", "panda_link7")))
    sources = (
        "Kinematics and limits: Franka Control Interface documentation.\n"
        "     Inertias: Gaz et al., RA-L 4(4), 2019. Rotor inertias: those of the FR3."
    )
    return model_sdf("panda_arm", "panda_model", sources, parts)


def hand_sdf() -> str:
    """SDF text of the hand: panda_hand, panda_leftfinger and panda_rightfinger."""
    right = mirrored_finger(LEFT_FINGER_SHAPES)
    parts = [
        link("panda_hand", "", HAND_INERTIA, HAND_SHAPES, "hand.obj"),
        link(
            "panda_leftfinger",
            '<pose relative_to="panda_finger_joint1"/>',
            box_inertia(LEFT_FINGER_SHAPES, FINGER_MASS),
            LEFT_FINGER_SHAPES,
            "finger.obj",
        ),
        link(
            "panda_rightfinger",
            '<pose relative_to="panda_finger_joint2"/>',
            box_inertia(right, FINGER_MASS),
            right,
            "finger.obj",
            visual_yaw=pi,
        ),
        finger_joint(_finger_joint(1, "panda_leftfinger", 1, None)),
        finger_joint(_finger_joint(2, "panda_rightfinger", -1, ("panda_finger_joint1", 1))),
        filter_group("hand", ("panda_hand", "panda_leftfinger", "panda_rightfinger")),
    ]
    sources = "Figures: franka_ros, franka_hand.xacro; Franka Hand data sheet."
    return model_sdf("panda_hand", "panda_model", sources, parts)


def _finger_joint(
    index: int, child: str, direction: int, mimic: tuple[str, int] | None
) -> FingerJoint:
    return FingerJoint(
        name=f"panda_finger_joint{index}",
        parent="panda_hand",
        child=child,
        p_PJ=(0.0, 0.0, FINGER_JOINT_HEIGHT),
        axis=(0, direction, 0),
        limits=(0.0, FINGER_TRAVEL),
        effort=FINGER_EFFORT,
        speed=FINGER_SPEED,
        mimic=mimic,
    )


def _arm_joint(index: int, joint: Joint) -> str:
    translation = dh_pose(joint)[:3, 3]
    return (
        f'    <joint name="panda_joint{index}" type="revolute">\n'
        f"      <parent>panda_link{index - 1}</parent>\n"
        f"      <child>panda_link{index}</child>\n"
        f'      <pose relative_to="panda_link{index - 1}">'
        f"{numbers((*translation, joint.alpha, 0, 0))}</pose>\n"
        "      <axis>\n"
        "        <xyz>0 0 1</xyz>\n"
        "        <limit>\n"
        f"          <lower>{joint.lower}</lower>\n"
        f"          <upper>{joint.upper}</upper>\n"
        f"          <effort>{joint.effort}</effort>\n"
        f"          <velocity>{joint.velocity}</velocity>\n"
        f"          <drake:acceleration>{joint.acceleration}</drake:acceleration>\n"
        "        </limit>\n"
        "      </axis>\n"
        f"      <drake:rotor_inertia>{joint.rotor_inertia:.15g}</drake:rotor_inertia>\n"
        "      <drake:gear_ratio>1</drake:gear_ratio>\n"
        "    </joint>\n"
    )
