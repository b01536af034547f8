"""Writes the SDF text of arm and hand."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from tools.panda_model.collision import (
    ARM_SHAPES,
    HAND_SHAPES,
    LEFT_FINGER_SHAPES,
    PAD,
    Box,
    Shape,
    axis_pose,
    mirrored_finger,
)
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
    Inertia,
    Joint,
    dh_pose,
)
from tools.panda_model.pad_mesh import PAD_FILE

HYDROELASTIC_MODULUS = 1.0e7
"""[Pa] Of the rubber pads in effect, and of all else that the robot touches things with."""
DISSIPATION = 5.0
"""Hunt-Crossley dissipation [s/m]: nothing rebounds faster than 1/5 m/s, while at the closing speed
of 0.05 m/s damping adds a quarter to the force at first touch and nothing to the settled one."""
FRICTION = 0.24
"""Default friction coefficient [-]. A grasp trial gives the pads the coefficient of its target."""
RESOLUTION_HINT = 0.03
"""Edge length of the hydroelastic meshes of capsules and cylinders [m]; boxes need none."""

_HEADER = """<?xml version="1.0"?>
<!-- Written by tools/panda_model (python -m tools.panda_model); do not edit by hand.
     {sources} -->
<sdf version="1.12" xmlns:drake="http://drake.mit.edu">
  <model name="{name}">
"""
_FOOTER = """  </model>
</sdf>
"""


def arm_sdf() -> str:
    """SDF text of the arm: links panda_link0 to panda_link7 and the frame panda_link8."""
    parts = [
        _HEADER.format(
            name="panda_arm",
            sources="Kinematics and limits: Franka Control Interface documentation.\n"
            "     Inertias: Gaz et al., RA-L 4(4), 2019. Rotor inertias: those of the FR3.",
        )
    ]
    for index, (inertia, shapes) in enumerate(zip(LINK_INERTIAS, ARM_SHAPES, strict=True)):
        pose = f'<pose relative_to="panda_joint{index}"/>' if index else ""
        parts.append(_link(f"panda_link{index}", pose, inertia, shapes, f"link{index}.obj"))
    parts.append(
        '    <frame name="panda_link8" attached_to="panda_link7">\n'
        f"      <pose>{_numbers((0, 0, FLANGE_OFFSET, 0, 0, 0))}</pose>\n"
        "    </frame>\n"
    )
    parts.extend(_arm_joint(i, joint) for i, joint in enumerate(JOINTS, start=1))
    parts.append(_filter_group("wrist", ("panda_link5", "panda_link6", "panda_link7")))
    return "".join([*parts, _FOOTER])


def hand_sdf() -> str:
    """SDF text of the hand: panda_hand, panda_leftfinger and panda_rightfinger."""
    right = mirrored_finger(LEFT_FINGER_SHAPES)
    parts = [
        _HEADER.format(
            name="panda_hand",
            sources="Figures: franka_ros, franka_hand.xacro; Franka Hand data sheet.",
        ),
        _link("panda_hand", "", HAND_INERTIA, HAND_SHAPES, "hand.obj"),
        _link(
            "panda_leftfinger",
            '<pose relative_to="panda_finger_joint1"/>',
            box_inertia(LEFT_FINGER_SHAPES, FINGER_MASS),
            LEFT_FINGER_SHAPES,
            "finger.obj",
        ),
        _link(
            "panda_rightfinger",
            '<pose relative_to="panda_finger_joint2"/>',
            box_inertia(right, FINGER_MASS),
            right,
            "finger.obj",
            visual_yaw=pi,
        ),
        _finger_joint(1, "panda_leftfinger", 1, ""),
        _finger_joint(
            2,
            "panda_rightfinger",
            -1,
            '      <drake:mimic joint="panda_finger_joint1" multiplier="1" offset="0"/>\n',
        ),
        _filter_group("hand", ("panda_hand", "panda_leftfinger", "panda_rightfinger")),
    ]
    return "".join([*parts, _FOOTER])


def box_inertia(boxes: Sequence[Box], mass: float) -> Inertia:
    """Mass properties of boxes of one density; where boxes overlap both count.

    Args:
        boxes: in the link frame; turned about x only.
        mass: total mass [kg].
    """
    volumes = np.array([np.prod(b.size) for b in boxes])
    masses = mass * volumes / volumes.sum()
    centres = np.array([b.p_BG for b in boxes])
    p_BBcm = masses @ centres / mass
    I_Bcm = np.zeros((3, 3))
    for box, m, centre in zip(boxes, masses, centres, strict=True):
        squares = np.square(box.size)
        c, s = np.cos(box.rpy[0]), np.sin(box.rpy[0])
        R_BG = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        r = centre - p_BBcm
        I_Bcm += R_BG @ np.diag(m / 12.0 * (squares.sum() - squares)) @ R_BG.T
        I_Bcm += m * (r @ r * np.eye(3) - np.outer(r, r))
    x, y, z = (float(v) for v in p_BBcm)
    xx, yy, zz = (float(v) for v in np.diag(I_Bcm))
    xy, xz, yz = (float(I_Bcm[i, j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    return Inertia(mass, (x, y, z), (xx, yy, zz), (xy, xz, yz))


def _link(
    name: str,
    pose: str,
    inertia: Inertia,
    shapes: Sequence[Shape],
    mesh: str,
    visual_yaw: float = 0.0,
) -> str:
    lines = [f'    <link name="{name}">\n']
    if pose:
        lines.append(f"      {pose}\n")
    lines.append(_inertial(inertia))
    lines.append(_visual(mesh, visual_yaw))
    lines.extend(_collision(shape) for shape in shapes)
    lines.append("    </link>\n")
    return "".join(lines)


def _inertial(inertia: Inertia) -> str:
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    tensor = "".join(
        f"          <{key}>{value:.15g}</{key}>\n"
        for key, value in zip(keys, (*inertia.moments, *inertia.products), strict=True)
    )
    return (
        "      <inertial>\n"
        f"        <pose>{_numbers((*inertia.p_BBcm, 0, 0, 0))}</pose>\n"
        f"        <mass>{inertia.mass:.15g}</mass>\n"
        f"        <inertia>\n{tensor}        </inertia>\n"
        "      </inertial>\n"
    )


def _visual(mesh: str, yaw: float) -> str:
    pose = f"        <pose>{_numbers((0, 0, 0, 0, 0, yaw))}</pose>\n" if yaw else ""
    return (
        '      <visual name="visual">\n'
        f"{pose}"
        f"        <geometry><mesh><uri>meshes/{mesh}</uri></mesh></geometry>\n"
        "      </visual>\n"
    )


def _collision(shape: Shape) -> str:
    if shape.name == PAD:
        assert isinstance(shape, Box)
        pose: Sequence[float] = (*shape.p_BG, *shape.rpy)
        geometry = f"<mesh><uri>meshes/{PAD_FILE}</uri></mesh>"
        hint = ""
    elif isinstance(shape, Box):
        pose = (*shape.p_BG, *shape.rpy)
        geometry = f"<box><size>{_numbers(shape.size)}</size></box>"
        hint = ""
    else:
        centre, rpy, length = axis_pose(shape)
        pose = (*centre, *rpy)
        tag = type(shape).__name__.lower()
        geometry = (
            f"<{tag}><radius>{shape.radius:.15g}</radius><length>{length:.15g}</length></{tag}>"
        )
        hint = (
            f"          <drake:mesh_resolution_hint>{RESOLUTION_HINT}"
            "</drake:mesh_resolution_hint>\n"
        )
    return (
        f'      <collision name="{shape.name}">\n'
        f"        <pose>{_numbers(pose)}</pose>\n"
        f"        <geometry>{geometry}</geometry>\n"
        "        <drake:proximity_properties>\n"
        "          <drake:compliant_hydroelastic/>\n"
        f"          <drake:hydroelastic_modulus>{HYDROELASTIC_MODULUS:.15g}"
        "</drake:hydroelastic_modulus>\n"
        f"{hint}"
        f"          <drake:hunt_crossley_dissipation>{DISSIPATION:.15g}"
        "</drake:hunt_crossley_dissipation>\n"
        f"          <drake:mu_static>{FRICTION}</drake:mu_static>\n"
        f"          <drake:mu_dynamic>{FRICTION}</drake:mu_dynamic>\n"
        "        </drake:proximity_properties>\n"
        "      </collision>\n"
    )


def _arm_joint(index: int, joint: Joint) -> str:
    translation = dh_pose(joint)[:3, 3]
    return (
        f'    <joint name="panda_joint{index}" type="revolute">\n'
        f"      <parent>panda_link{index - 1}</parent>\n"
        f"      <child>panda_link{index}</child>\n"
        f'      <pose relative_to="panda_link{index - 1}">'
        f"{_numbers((*translation, joint.alpha, 0, 0))}</pose>\n"
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


def _finger_joint(index: int, child: str, direction: int, mimic: str) -> str:
    return (
        f'    <joint name="panda_finger_joint{index}" type="prismatic">\n'
        "      <parent>panda_hand</parent>\n"
        f"      <child>{child}</child>\n"
        f'      <pose relative_to="panda_hand">'
        f"{_numbers((0, 0, FINGER_JOINT_HEIGHT, 0, 0, 0))}</pose>\n"
        "      <axis>\n"
        f"        <xyz>0 {direction} 0</xyz>\n"
        "        <limit>\n"
        "          <lower>0</lower>\n"
        f"          <upper>{FINGER_TRAVEL}</upper>\n"
        f"          <effort>{FINGER_EFFORT}</effort>\n"
        f"          <velocity>{FINGER_SPEED}</velocity>\n"
        "        </limit>\n"
        "      </axis>\n"
        f"{mimic}"
        "    </joint>\n"
    )


def _filter_group(name: str, members: Sequence[str]) -> str:
    lines = "".join(f"      <drake:member>{member}</drake:member>\n" for member in members)
    return (
        f'    <drake:collision_filter_group name="{name}">\n'
        f"{lines}"
        f"      <drake:ignored_collision_filter_group>{name}"
        "</drake:ignored_collision_filter_group>\n"
        "    </drake:collision_filter_group>\n"
    )


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    """Fifteen significant digits; rounding noise near 0 becomes 0."""
    return " ".join(f"{0.0 if abs(v) < 1e-15 else float(v):.15g}" for v in values)
