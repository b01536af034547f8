"""Files that a library holds for each object: OBJ meshes and the SDF model for Drake."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, Rgba, atomic_write, quaternion_from_rotation
from burg_drake.objects.library import ContactGeometry, MassProperties, Primitive

DEFAULT_RGBA: Rgba = (0.8, 0.8, 0.78, 1.0)
"""Colour of a mesh without one; Drake's renderer would choose orange."""


def face_palette(mesh: trimesh.Trimesh) -> tuple[NDArray[np.uint8], NDArray[np.int64]] | None:
    """The palette of a mesh with a few face colours.

    Returns:
        (C, 4) colours as bytes and (F,) colour index of each face; None if the faces have no
        colours, a single one, or more than 16.
    """
    max_colours = 16  # A mesh with more face colours is a scan, not a few materials.
    if mesh.visual is None or mesh.visual.kind != "face":
        return None
    colours, index = np.unique(mesh.visual.face_colors, axis=0, return_inverse=True)
    return (colours, index.reshape(-1)) if 1 < len(colours) <= max_colours else None


def write_visual(
    mesh: trimesh.Trimesh, path: Path, *, rgba: Rgba | None = None, image: object | None = None
) -> None:
    """Writes `path` (.obj) with normals, and an .mtl and .png beside it where needed.

    Args:
        mesh: surface in metres; with texture coordinates if `image` is given.
        path: the OBJ file.
        rgba: colour if there is no image. Without both, the mesh's `face_palette` is used, or else
            `DEFAULT_RGBA`.
        image: texture (PIL image).
    """
    palette = face_palette(mesh) if rgba is None and image is None else None
    groups = np.zeros(len(mesh.faces), dtype=np.int64)
    materials: dict[str, Rgba] = {"surface": rgba or DEFAULT_RGBA}
    if image is not None:
        materials = {"surface": (1.0, 1.0, 1.0, 1.0)}
    elif palette is not None:
        materials = {f"colour_{i}": _rgba_from_bytes(row) for i, row in enumerate(palette[0])}
        groups = palette[1]
    texture = "" if image is None else f"map_Kd {path.stem}.png\n"
    if image is not None:
        data = io.BytesIO()
        image.convert("RGB").save(data, format="PNG")  # type: ignore[attr-defined]
        atomic_write(path.with_suffix(".png"), data.getvalue())
    atomic_write(path.with_suffix(".mtl"), _material_text(materials, texture))
    normals = corner_normals(mesh)
    unique, index = np.unique(np.round(normals.reshape(-1, 3), 5), axis=0, return_inverse=True)
    columns = [mesh.faces + 1, index.reshape(-1, 3) + 1]
    text = [f"mtllib {path.stem}.mtl\n"]
    text += [_format_rows("v", mesh.vertices, "%.9g"), _format_rows("vn", unique + 0.0, "%.5g")]
    form = " ".join(["%d//%d"] * 3)
    if image is not None:
        text.append(_format_rows("vt", np.asarray(mesh.visual.uv)[:, :2], "%.7g"))
        columns.insert(1, mesh.faces + 1)
        form = " ".join(["%d/%d/%d"] * 3)
    corners = np.stack(columns, axis=2).reshape(len(mesh.faces), -1)
    for k, name in enumerate(materials):
        text.append(f"usemtl {name}\n")
        text.append(_format_rows("f", corners[groups == k], form))
    atomic_write(path, "".join(text))


def _rgba_from_bytes(row: NDArray[np.uint8]) -> Rgba:
    r, g, b, a = np.round(row / 255.0, 4).tolist()
    return r, g, b, a


def _material_text(materials: dict[str, Rgba], texture: str) -> str:
    return "\n".join(
        f"newmtl {name}\nKd {r:g} {g:g} {b:g}\nd {a:g}\n{texture}"
        for name, (r, g, b, a) in materials.items()
    )


def write_piece(mesh: trimesh.Trimesh, path: Path) -> None:
    """Writes a convex piece (.obj): vertices and faces only."""
    atomic_write(
        path, _format_rows("v", mesh.vertices, "%.9g") + _format_rows("f", mesh.faces + 1, "%d")
    )


def corner_normals(mesh: trimesh.Trimesh) -> Array:
    """Normals at the corners of each face, smooth across edges flatter than 35 degrees.

    Args:
        mesh: F faces; vertices merged.

    Returns:
        (F, 3, 3) unit vectors, by face and corner: the mean, weighted by area, of the normals of
        the faces around the corner's vertex that are within 35 degrees of the face's own.
    """
    vertices, place = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    faces = place.reshape(-1)[mesh.faces]
    t = mesh.triangles
    area = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    unit = np.divide(area, length, out=np.tile([0.0, 0.0, 1.0], (len(area), 1)), where=length > 0)
    order = np.argsort(faces.reshape(-1), kind="stable")
    degree = np.bincount(faces.reshape(-1), minlength=len(vertices))
    start = np.concatenate([[0], np.cumsum(degree)[:-1]])
    around = degree[faces.reshape(-1)]
    corner = np.repeat(np.arange(faces.size), around)
    offset = np.arange(len(corner)) - np.repeat(np.cumsum(around) - around, around)
    neighbour = order[start[faces.reshape(-1)[corner]] + offset] // 3
    smooth = (unit[corner // 3] * unit[neighbour]).sum(axis=1) >= np.cos(np.deg2rad(35.0))
    total = np.zeros((faces.size, 3))
    for k in range(3):
        total[:, k] = np.bincount(
            corner[smooth], weights=area[neighbour[smooth], k], minlength=faces.size
        )
    size = np.linalg.norm(total, axis=1, keepdims=True)
    own = np.repeat(unit, 3, axis=0)
    mean: Array = np.divide(total, size, out=own, where=size > 0).reshape(-1, 3, 3)
    return mean


def _format_rows(tag: str, values: ArrayLike | NDArray[np.int64], form: str) -> str:
    array = np.asarray(values)
    row = f"{tag} {form if ' ' in form else ' '.join([form] * array.shape[1])}\n"
    return (row * len(array)) % tuple(array.reshape(-1).tolist())


LINK_NAME = "body"
"""Name of an object's only link; its frame is O."""


@dataclass(frozen=True, kw_only=True)
class ContactParameters:
    """Contact parameters of objects of any shape.

    Attributes:
        modulus: hydroelastic modulus of compliant pieces [Pa], the same as of the pads.
        dissipation: Hunt-Crossley dissipation [s/m].
        faceting: largest distance of Drake's facets inside the surface of a cylinder or a sphere
            [m].
    """

    modulus: float = 1e7
    dissipation: float = 20.0
    faceting: float = 2.5e-4


DEFAULT_CONTACT = ContactParameters()  # Contact parameters of objects.


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
        mass_properties: mass properties of the object, in O.
        friction: coefficient, static and dynamic.
        visual: path of the visual mesh relative to the SDF.
        pieces: paths of the convex pieces relative to the SDF.
        contact: contact geometry; its mesh lies beside the SDF.
        material: contact parameters.
    """
    ixx, iyy, izz, ixy, ixz, iyz = (f"{v!r}" for v in mass_properties.inertia)
    x, y, z = (f"{v!r}" for v in mass_properties.center_of_mass)
    collisions = "".join(_collision_elements(pieces, friction, contact, material))
    return f"""<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="{escape(name, quote=False)}">
    <link name="{LINK_NAME}">
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
    """Largest edge length [m] with which Drake's facets of a round primitive lie less than
    `faceting` inside it.

    Drake replaces a cylinder by a prism, whose sides are chords. A sphere starts as an octahedron
    whose faces are divided into four, L times, until a quarter circle over 2^L is at most the hint;
    the worst facet then lies 0.92 to 1.00 radius / 4^L inside (measured for L from 2 to 6).
    """
    radius = primitive.size[0]
    if primitive.shape == "sphere":
        level = max(1, math.ceil(math.log(radius / faceting, 4.0)))
        return (1.0 + 1e-9) * math.pi / 2.0 * radius / 2.0**level
    half_angle = math.acos(max(0.0, 1.0 - faceting / radius))
    return 2.0 * math.pi * radius / max(3, math.ceil(math.pi / half_angle))


def _collision_elements(
    pieces: Sequence[str], friction: float, contact: ContactGeometry, material: ContactParameters
) -> list[str]:
    """The collision elements."""
    rigid = "<drake:rigid_hydroelastic/>"
    if contact.kind == "primitive" and contact.primitive is not None:
        lines = [rigid, *_resolution_element(contact.primitive, material)]
        geometry = _primitive_element(contact.primitive)
        pose = _pose_element(contact.primitive)
        return [_collision_element("primitive", geometry, lines, friction, material, pose)]
    if contact.kind == "mesh":
        geometry = _mesh_element(PurePosixPath(contact.mesh).name, convex=False)
        return [_collision_element("mesh", geometry, [rigid], friction, material)]
    lines = [rigid]
    if contact.kind == "compliant_pieces":
        modulus = f"<drake:hydroelastic_modulus>{material.modulus!r}</drake:hydroelastic_modulus>"
        lines = ["<drake:compliant_hydroelastic/>", modulus]
    return [
        _collision_element(
            f"piece_{i:03d}", _mesh_element(uri, convex=True), lines, friction, material
        )
        for i, uri in enumerate(pieces)
    ]


def _collision_element(
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


def _mesh_element(uri: str, convex: bool) -> str:
    declared = "            <drake:declare_convex/>\n" if convex else ""
    return f"""          <mesh>
            <uri>{escape(uri, quote=False)}</uri>
{declared}          </mesh>
"""


def _primitive_element(primitive: Primitive) -> str:
    size = [f"{v!r}" for v in primitive.size]
    if primitive.shape == "box":
        inner = f"<size>{' '.join(size)}</size>"
    elif primitive.shape == "cylinder":
        inner = f"<radius>{size[0]}</radius><length>{size[1]}</length>"
    else:
        inner = f"<radius>{size[0]}</radius>"
    return f"          <{primitive.shape}>{inner}</{primitive.shape}>\n"


def _pose_element(primitive: Primitive) -> str:
    X_OP = primitive.X_OP.matrix()
    w, x, y, z = quaternion_from_rotation(X_OP[:3, :3]).tolist()
    numbers = " ".join(repr(v) for v in (*X_OP[:3, 3].tolist(), x, y, z, w))
    return f'        <pose rotation_format="quat_xyzw">{numbers}</pose>\n'


def _resolution_element(primitive: Primitive, material: ContactParameters) -> list[str]:
    """Resolution hint of a round primitive for Drake; a box needs none."""
    if primitive.shape == "box":
        return []
    hint = resolution_hint(primitive, material.faceting)
    return [f"<drake:mesh_resolution_hint>{hint!r}</drake:mesh_resolution_hint>"]
