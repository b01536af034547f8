"""The Drake model of an object, as SDF text.

How an object touches the world is decided here and nowhere else. Gripper pads and tables are
compliant in Drake's hydroelastic contact, so that rigid and compliant objects alike meet them by
contact surfaces. Two rigid objects meet by point contact: between their pieces or primitives, and
of a rigid mesh, which may be hollow, between its convex hull and the other's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import PurePosixPath

from burg_drake.core import quaternion_from_rotation
from burg_drake.objects.library.entry import ContactGeometry, MassProperties, Primitive

LINK = "body"
"""Name of an object's only link; its frame is O."""


@dataclass(frozen=True, kw_only=True)
class ContactParameters:
    """How objects touch, whatever their shape.

    Attributes:
        modulus: hydroelastic modulus of compliant pieces [Pa], as the pads have.
        dissipation: Hunt-Crossley dissipation [s/m].
        faceting: how far the facets that Drake makes of a cylinder or a sphere may be inside [m].
    """

    modulus: float = 1e7
    dissipation: float = 20.0
    faceting: float = 2.5e-4


DEFAULT_CONTACT = ContactParameters()


def model_sdf(
    name: str,
    mass_properties: MassProperties,
    friction: float,
    visual: str,
    pieces: Sequence[str],
    contact: ContactGeometry = ContactGeometry(),
    material: ContactParameters = DEFAULT_CONTACT,
) -> str:
    """SDF of an object.

    Args:
        name: model name.
        mass_properties: of the object, in O.
        friction: coefficient, static and dynamic.
        visual: path of the visual mesh relative to the SDF.
        pieces: paths of the convex pieces relative to the SDF.
        contact: what touches; its mesh lies beside the SDF.
        material: how it touches.
    """
    ixx, iyy, izz, ixy, ixz, iyz = (f"{v!r}" for v in mass_properties.inertia)
    x, y, z = (f"{v!r}" for v in mass_properties.center_of_mass)
    collisions = "".join(_collisions(pieces, friction, contact, material))
    return f"""<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="{escape(name, quote=False)}">
    <link name="{LINK}">
      <inertial>
        <pose>{x} {y} {z} 0 0 0</pose>
        <mass>{mass_properties.mass!r}</mass>
        <inertia>
          <ixx>{ixx}</ixx>
          <iyy>{iyy}</iyy>
          <izz>{izz}</izz>
          <ixy>{ixy}</ixy>
          <ixz>{ixz}</ixz>
          <iyz>{iyz}</iyz>
        </inertia>
      </inertial>
      <visual name="visual">
        <geometry>
          <mesh>
            <uri>{escape(visual, quote=False)}</uri>
          </mesh>
        </geometry>
      </visual>
{collisions}    </link>
  </model>
</sdf>
"""


def resolution_hint(primitive: Primitive, faceting: float) -> float:
    """Edge length [m] at which Drake's facets of a round primitive lie less than `faceting` inside.

    Of a cylinder it makes a prism, whose sides are chords. A sphere starts as an octahedron whose
    faces are cut into four, L times, until a quarter circle over 2^L is at most the hint; the worst
    facet then lies 0.92 to 1.00 radius / 4^L inside (measured for L from 2 to 6).
    """
    radius = primitive.size[0]
    if primitive.shape == "sphere":
        level = max(1, math.ceil(math.log(radius / faceting, 4.0)))
        return (1.0 + 1e-9) * math.pi / 2.0 * radius / 2.0**level
    half_angle = math.acos(max(0.0, 1.0 - faceting / radius))
    return 2.0 * math.pi * radius / max(3, math.ceil(math.pi / half_angle))


def _collisions(
    pieces: Sequence[str], friction: float, contact: ContactGeometry, material: ContactParameters
) -> list[str]:
    """The collision elements."""
    rigid = "<drake:rigid_hydroelastic/>"
    if contact.kind == "primitive" and contact.primitive is not None:
        lines = [rigid, *_resolution(contact.primitive, material)]
        geometry = _primitive(contact.primitive)
        pose = _pose(contact.primitive)
        return [_collision("primitive", geometry, lines, friction, material, pose)]
    if contact.kind == "mesh":
        geometry = _mesh(PurePosixPath(contact.mesh).name, convex=False)
        return [_collision("mesh", geometry, [rigid], friction, material)]
    lines = [rigid]
    if contact.kind == "compliant_pieces":
        modulus = f"<drake:hydroelastic_modulus>{material.modulus!r}</drake:hydroelastic_modulus>"
        lines = ["<drake:compliant_hydroelastic/>", modulus]
    return [
        _collision(f"piece_{i:03d}", _mesh(uri, convex=True), lines, friction, material)
        for i, uri in enumerate(pieces)
    ]


def _collision(
    name: str,
    geometry: str,
    hydroelastic: Sequence[str],
    friction: float,
    material: ContactParameters,
    pose: str = "",
) -> str:
    properties = "".join(f"          {line}\n" for line in hydroelastic)
    dissipation = f"{material.dissipation!r}</drake:hunt_crossley_dissipation>"
    return f"""      <collision name="{name}">
{pose}        <geometry>
{geometry}        </geometry>
        <drake:proximity_properties>
{properties}          <drake:mu_dynamic>{friction!r}</drake:mu_dynamic>
          <drake:mu_static>{friction!r}</drake:mu_static>
          <drake:hunt_crossley_dissipation>{dissipation}
        </drake:proximity_properties>
      </collision>
"""


def _mesh(uri: str, convex: bool) -> str:
    declared = "            <drake:declare_convex/>\n" if convex else ""
    return f"""          <mesh>
            <uri>{escape(uri, quote=False)}</uri>
{declared}          </mesh>
"""


def _primitive(primitive: Primitive) -> str:
    size = [f"{v!r}" for v in primitive.size]
    if primitive.shape == "box":
        inner = f"<size>{' '.join(size)}</size>"
    elif primitive.shape == "cylinder":
        inner = f"<radius>{size[0]}</radius><length>{size[1]}</length>"
    else:
        inner = f"<radius>{size[0]}</radius>"
    return f"          <{primitive.shape}>{inner}</{primitive.shape}>\n"


def _pose(primitive: Primitive) -> str:
    X_OP = primitive.X_OP.matrix()
    w, x, y, z = quaternion_from_rotation(X_OP[:3, :3]).tolist()
    numbers = " ".join(repr(v) for v in (*X_OP[:3, 3].tolist(), x, y, z, w))
    return f'        <pose rotation_format="quat_xyzw">{numbers}</pose>\n'


def _resolution(primitive: Primitive, material: ContactParameters) -> list[str]:
    """How finely Drake cuts a round primitive; a box needs no cutting."""
    if primitive.shape == "box":
        return []
    hint = resolution_hint(primitive, material.faceting)
    return [f"<drake:mesh_resolution_hint>{hint!r}</drake:mesh_resolution_hint>"]
