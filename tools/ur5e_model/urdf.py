"""Writes the URDF text of the arm, as Drake's parser reads it."""

from __future__ import annotations

from collections.abc import Sequence

from tools.robot_model.inertia import Inertia
from tools.robot_model.sdf import (
    DISSIPATION,
    FRICTION,
    HYDROELASTIC_MODULUS,
    RESOLUTION_HINT,
    numbers,
)
from tools.robot_model.shapes import Box, Capsule, Shape, axis_pose
from tools.ur5e_model.collision import BASE_SHAPES, LINK_SHAPES, NEVER_MEET
from tools.ur5e_model.figures import (
    ACCELERATION,
    BASE,
    BASE_INERTIA,
    FLANGE,
    JOINTS,
    LINK_INERTIAS,
    ROTOR_INERTIA,
    VELOCITY,
    Joint,
    dh_origin,
)

COLORS = {"shell": "0.75 0.76 0.78 1", "joint": "0.42 0.55 0.66 1", "dark": "0.25 0.25 0.27 1"}
"""Of bars, joints and base."""
_HEADER = """<?xml version="1.0"?>
<!-- Written by tools/ur5e_model (python -m tools.ur5e_model); do not edit by hand.
     Kinematics, masses, centres of mass: Universal Robots, "DH Parameters for calculations of
     kinematics and dynamics". Limits and inertia tensors: Universal_Robots_ROS2_Description,
     config/ur5e (BSD-3). Not published by the manufacturer, hence assumed: accelerations
     (pi rad/s^2, as there) and rotor inertias (0.1 kg m^2, as in MuJoCo Menagerie). -->
<robot name="ur5e" xmlns:drake="http://drake.mit.edu">
"""


def arm_urdf() -> str:
    """URDF text of the arm."""
    parts = [_HEADER, *(_material(name, rgba) for name, rgba in COLORS.items())]
    parts.append(_link(BASE, BASE_INERTIA, BASE_SHAPES))
    for joint, inertia, shapes in zip(JOINTS, LINK_INERTIAS, LINK_SHAPES, strict=True):
        parts.append(_link(joint.link, inertia, shapes))
    parts.append(f'  <link name="{FLANGE}"/>\n')
    parents = [BASE, *(joint.link for joint in JOINTS)]
    parts += [_joint(joint, parent) for joint, parent in zip(JOINTS, parents, strict=False)]
    parts.append(_fixed("wrist_3-flange", JOINTS[-1].link, FLANGE))
    parts += [_transmission(joint) for joint in JOINTS]
    parts += [_filter_group(*pair) for pair in NEVER_MEET]
    return "".join([*parts, "</robot>\n"])


def _material(name: str, rgba: str) -> str:
    return f'  <material name="{name}"><color rgba="{rgba}"/></material>\n'


def _link(name: str, inertia: Inertia, shapes: Sequence[Shape]) -> str:
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    values = (*inertia.moments, *inertia.products)
    tensor = " ".join(f'{k}="{numbers([v])}"' for k, v in zip(keys, values, strict=True))
    return (
        f'  <link name="{name}">\n'
        "    <inertial>\n"
        f'      <origin xyz="{numbers(inertia.p_BBcm)}"/>\n'
        f'      <mass value="{inertia.mass:.15g}"/>\n'
        f"      <inertia {tensor}/>\n"
        "    </inertial>\n"
        f"{''.join(_visual(name, shape) for shape in shapes)}"
        f"{''.join(_collision(shape) for shape in shapes)}"
        "  </link>\n"
    )


def _placed(shape: Shape) -> str:
    """Origin and geometry of a shape."""
    if isinstance(shape, Box):
        centre: Sequence[float] = shape.p_BG
        rpy: Sequence[float] = shape.rpy
        geometry = f'<box size="{numbers(shape.size)}"/>'
    else:
        p, turn, length = axis_pose(shape)
        centre, rpy = list(p), list(turn)
        tag = "drake:capsule" if isinstance(shape, Capsule) else "cylinder"
        geometry = f'<{tag} radius="{shape.radius:.15g}" length="{length:.15g}"/>'
    return (
        f'      <origin xyz="{numbers(centre)}" rpy="{numbers(rpy)}"/>\n'
        f"      <geometry>{geometry}</geometry>\n"
    )


def _visual(link: str, shape: Shape) -> str:
    color = "dark" if link == BASE else "shell" if shape.name in ("tube", "bar") else "joint"
    return (
        f'    <visual name="{shape.name}">\n{_placed(shape)}'
        f'      <material name="{color}"/>\n'
        "    </visual>\n"
    )


def _collision(shape: Shape) -> str:
    hint = "" if isinstance(shape, Box) else _property("mesh_resolution_hint", RESOLUTION_HINT)
    return (
        f'    <collision name="{shape.name}">\n{_placed(shape)}'
        "      <drake:proximity_properties>\n"
        "        <drake:compliant_hydroelastic/>\n"
        f"{_property('hydroelastic_modulus', HYDROELASTIC_MODULUS)}{hint}"
        f"{_property('hunt_crossley_dissipation', DISSIPATION)}"
        f"{_property('mu_static', FRICTION)}{_property('mu_dynamic', FRICTION)}"
        "      </drake:proximity_properties>\n"
        "    </collision>\n"
    )


def _property(name: str, value: float) -> str:
    return f'        <drake:{name} value="{value:.15g}"/>\n'


def _joint(joint: Joint, parent: str) -> str:
    xyz, rpy = dh_origin(joint)
    return (
        f'  <joint name="{joint.name}" type="revolute">\n'
        f'    <parent link="{parent}"/>\n'
        f'    <child link="{joint.link}"/>\n'
        f'    <origin xyz="{numbers(xyz)}" rpy="{numbers(rpy)}"/>\n'
        '    <axis xyz="0 0 1"/>\n'
        f'    <limit lower="{joint.lower:.15g}" upper="{joint.upper:.15g}"'
        f' effort="{joint.effort:.15g}" velocity="{VELOCITY:.15g}"'
        f' drake:acceleration="{ACCELERATION:.15g}"/>\n'
        "  </joint>\n"
    )


def _fixed(name: str, parent: str, child: str) -> str:
    return (
        f'  <joint name="{name}" type="fixed">\n'
        f'    <parent link="{parent}"/>\n'
        f'    <child link="{child}"/>\n'
        "  </joint>\n"
    )


def _transmission(joint: Joint) -> str:
    """What gives a joint an actuator; Drake takes its effort limit from the joint."""
    return (
        f'  <transmission name="{joint.name}">\n'
        "    <type>transmission_interface/SimpleTransmission</type>\n"
        f'    <joint name="{joint.name}"/>\n'
        f'    <actuator name="{joint.name}">\n'
        f'      <drake:rotor_inertia value="{ROTOR_INERTIA:.15g}"/>\n'
        '      <drake:gear_ratio value="1"/>\n'
        "    </actuator>\n"
        "  </transmission>\n"
    )


def _filter_group(one: str, other: str) -> str:
    """Links that do not collide with each other."""
    name = f"{one}-{other}"
    members = "".join(f'    <drake:member link="{link}"/>\n' for link in (one, other))
    return (
        f'  <drake:collision_filter_group name="{name}">\n{members}'
        f'    <drake:ignored_collision_filter_group name="{name}"/>\n'
        "  </drake:collision_filter_group>\n"
    )
