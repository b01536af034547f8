"""SDF text of links, joints and collision filters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tools.robot_model.inertia import Inertia
from tools.robot_model.pad_mesh import INNER_DEPTH, PAD_FILE
from tools.robot_model.shapes import PAD, Box, Shape, axis_pose

HYDROELASTIC_MODULUS = 1.0e7
"""[Pa] Of all that touches things: of the pads, as a layer of half their thickness."""
PAD_MODULUS = HYDROELASTIC_MODULUS * 2 * INNER_DEPTH
"""[Pa] With which the fronts of the pads are as stiff, see `pad_mesh`."""
DISSIPATION = 5.0
"""Hunt-Crossley dissipation [s/m]: nothing rebounds faster than 1/5 m/s, while at the closing speed
of 0.05 m/s damping adds a quarter to the force at first touch and nothing to the settled one."""
FRICTION = 0.24
"""Default friction coefficient [-]. A grasp trial gives the pads the coefficient of its target."""
RESOLUTION_HINT = 0.03
"""Edge length of the hydroelastic meshes of capsules and cylinders [m]; boxes need none."""

_HEADER = """<?xml version="1.0"?>
<!-- Written by tools/{generator} (python -m tools.{generator}); do not edit by hand.
     {sources} -->
<sdf version="1.12" xmlns:drake="http://drake.mit.edu">
  <model name="{name}">
"""
_FOOTER = """  </model>
</sdf>
"""


@dataclass(frozen=True)
class FingerJoint:
    """A prismatic joint that moves a finger in the hand.

    Attributes:
        name: the joint's name.
        parent, child: links.
        p_PJ: origin in the frame of the parent [m].
        axis: direction of positive motion in the frame of the parent.
        limits: smallest and largest position [m].
        effort: largest force [N].
        speed: largest speed [m/s].
        mimic: the joint that this one follows, and the ratio of their positions.
    """

    name: str
    parent: str
    child: str
    p_PJ: tuple[float, float, float]
    axis: tuple[int, int, int]
    limits: tuple[float, float]
    effort: float
    speed: float
    mimic: tuple[str, int] | None = None


def model_sdf(name: str, generator: str, sources: str, parts: Iterable[str]) -> str:
    """SDF text of a model that the package `tools.GENERATOR` writes."""
    header = _HEADER.format(name=name, generator=generator, sources=sources)
    return "".join([header, *parts, _FOOTER])


def link(
    name: str,
    pose: str,
    inertia: Inertia,
    shapes: Sequence[Shape],
    mesh: str,
    visual_yaw: float = 0.0,
) -> str:
    """A link with one visual mesh.

    Args:
        name: the link's name.
        pose: element that places it, or nothing.
        inertia: mass properties.
        shapes: collision geometry; the one named `PAD` is a tetrahedral mesh.
        mesh: file of the visual mesh in the folder `meshes`.
        visual_yaw: turns the visual mesh about z [rad].
    """
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
        f"        <pose>{numbers((*inertia.p_BBcm, 0, 0, 0))}</pose>\n"
        f"        <mass>{inertia.mass:.15g}</mass>\n"
        f"        <inertia>\n{tensor}        </inertia>\n"
        "      </inertial>\n"
    )


def _visual(mesh: str, yaw: float) -> str:
    pose = f"        <pose>{numbers((0, 0, 0, 0, 0, yaw))}</pose>\n" if yaw else ""
    return (
        '      <visual name="visual">\n'
        f"{pose}"
        f"        <geometry><mesh><uri>meshes/{mesh}</uri></mesh></geometry>\n"
        "      </visual>\n"
    )


def _collision(shape: Shape) -> str:
    modulus = HYDROELASTIC_MODULUS
    if shape.name == PAD:
        assert isinstance(shape, Box)
        pose: Sequence[float] = (*shape.p_BG, *shape.rpy)
        geometry = f"<mesh><uri>meshes/{PAD_FILE}</uri></mesh>"
        hint, modulus = "", PAD_MODULUS
    elif isinstance(shape, Box):
        pose = (*shape.p_BG, *shape.rpy)
        geometry = f"<box><size>{numbers(shape.size)}</size></box>"
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
        f"        <pose>{numbers(pose)}</pose>\n"
        f"        <geometry>{geometry}</geometry>\n"
        "        <drake:proximity_properties>\n"
        "          <drake:compliant_hydroelastic/>\n"
        f"          <drake:hydroelastic_modulus>{modulus:.15g}"
        "</drake:hydroelastic_modulus>\n"
        f"{hint}"
        f"          <drake:hunt_crossley_dissipation>{DISSIPATION:.15g}"
        "</drake:hunt_crossley_dissipation>\n"
        f"          <drake:mu_static>{FRICTION}</drake:mu_static>\n"
        f"          <drake:mu_dynamic>{FRICTION}</drake:mu_dynamic>\n"
        "        </drake:proximity_properties>\n"
        "      </collision>\n"
    )


def finger_joint(joint: FingerJoint) -> str:
    """A finger's joint; Drake reads `drake:mimic` where SDF has `mimic` within `axis`."""
    mimic = ""
    if joint.mimic is not None:
        leader, ratio = joint.mimic
        mimic = f'      <drake:mimic joint="{leader}" multiplier="{ratio}" offset="0"/>\n'
    return (
        f'    <joint name="{joint.name}" type="prismatic">\n'
        f"      <parent>{joint.parent}</parent>\n"
        f"      <child>{joint.child}</child>\n"
        f'      <pose relative_to="{joint.parent}">{numbers((*joint.p_PJ, 0, 0, 0))}</pose>\n'
        "      <axis>\n"
        f"        <xyz>{numbers(joint.axis)}</xyz>\n"
        "        <limit>\n"
        f"          <lower>{joint.limits[0]:.15g}</lower>\n"
        f"          <upper>{joint.limits[1]:.15g}</upper>\n"
        f"          <effort>{joint.effort}</effort>\n"
        f"          <velocity>{joint.speed}</velocity>\n"
        "        </limit>\n"
        "      </axis>\n"
        f"{mimic}"
        "    </joint>\n"
    )


def filter_group(name: str, members: Sequence[str]) -> str:
    """Links of a model that do not collide with each other."""
    lines = "".join(f"      <drake:member>{member}</drake:member>\n" for member in members)
    return (
        f'    <drake:collision_filter_group name="{name}">\n'
        f"{lines}"
        f"      <drake:ignored_collision_filter_group>{name}"
        "</drake:ignored_collision_filter_group>\n"
        "    </drake:collision_filter_group>\n"
    )


def numbers(values: Sequence[float] | np.ndarray) -> str:
    """Fifteen significant digits; rounding noise near 0 becomes 0."""
    return " ".join(f"{0.0 if abs(v) < 1e-15 else float(v):.15g}" for v in values)
