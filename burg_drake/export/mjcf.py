"""Writes a scene as MuJoCo's MJCF.

Bodies are where the scene has their objects, with the frames O. What is looked at and what collides
are geoms of two classes: MuJoCo collides the convex hull of a mesh, hence the convex pieces.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from burg_drake.core import Array, quaternion_from_rotation
from burg_drake.core.files import atomic_write
from burg_drake.export.layout import Layout, PlacedObject
from burg_drake.export.legal_names import LegalNames, model_name
from burg_drake.export.mjcf_assets import MjcfAssets
from burg_drake.objects.library import Primitive
from burg_drake.station.world import FixedBox

MJCF_FILE = "scene.xml"

VISUAL, COLLISION = "visual", "collision"
"""Classes of geoms, in MuJoCo's usual groups: 2 is drawn, 3 is not."""


def write_mjcf(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `scene.xml` and the meshes and textures that it names.

    Args:
        layout: what to write.
        folder: empty.

    Returns:
        What became other than it is in the scene, one sentence each.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: it is damaged.
        InvalidInputError: a place cannot be written to.
    """
    names = LegalNames.of_sdf(layout)
    root = Element("mujoco", {"model": model_name(layout.name)})
    SubElement(root, "compiler", {"angle": "radian", "autolimits": "true"})
    SubElement(
        root,
        "option",
        {"timestep": "0.002", "integrator": "implicitfast", "cone": "elliptic", "impratio": "10"},
    )
    _add_classes(root)
    assets = MjcfAssets(SubElement(root, "asset"), layout.library, folder)
    world = SubElement(root, "worldbody")
    light = {"directional": "true", "pos": "0 0 2", "dir": "0.2 0.3 -1", "diffuse": "0.5 0.5 0.5"}
    SubElement(world, "light", light)
    for name, box in layout.boxes.items():
        _add_box(_add_body(world, names[name], box.X_WB), box)
    for placed in layout.objects:
        body = _add_body(world, names[placed.name], placed.X_WO)
        if not placed.fixed:
            SubElement(body, "freejoint", {"name": names[placed.name]})
            _add_inertia(body, placed)
        _add_geoms(body, placed, assets)
    ElementTree.indent(root)
    atomic_write(folder / MJCF_FILE, f"{ElementTree.tostring(root, encoding='unicode')}\n")
    return names.notes


def _add_classes(root: Element) -> None:
    default = SubElement(root, "default")
    visual = SubElement(default, "default", {"class": VISUAL})
    drawn = {"type": "mesh", "contype": "0", "conaffinity": "0", "group": "2", "mass": "0"}
    SubElement(visual, "geom", drawn)
    collision = SubElement(default, "default", {"class": COLLISION})
    SubElement(collision, "geom", {"type": "mesh", "group": "3"})


def _add_body(world: Element, name: str, X_WB: Array) -> Element:
    return SubElement(world, "body", {"name": name, **_place(X_WB)})


def _add_inertia(body: Element, placed: PlacedObject) -> None:
    properties = placed.entry.mass_properties
    SubElement(
        body,
        "inertial",
        {
            "pos": _numbers(properties.center_of_mass),
            "mass": repr(properties.mass),
            "fullinertia": _numbers(properties.inertia),
        },
    )


def _add_geoms(body: Element, placed: PlacedObject, assets: MjcfAssets) -> None:
    entry = placed.entry
    for mesh, material in assets.visuals(placed.object, entry):
        SubElement(body, "geom", {"class": VISUAL, "mesh": mesh, "material": material})
    touching = {"class": COLLISION, "friction": repr(entry.friction)}
    primitive = entry.contact.primitive
    if entry.contact.kind == "primitive" and primitive is not None:
        shape = {"type": primitive.shape, "size": _size(primitive)}
        SubElement(body, "geom", {**touching, **shape, **_place(primitive.X_OP.matrix())})
        return
    for mesh in assets.pieces(placed.object, entry):
        SubElement(body, "geom", {**touching, "mesh": mesh})


def _add_box(body: Element, box: FixedBox) -> None:
    """One geom that is drawn and collides, in the group that is drawn."""
    SubElement(
        body,
        "geom",
        {
            "class": COLLISION,
            "type": "box",
            "size": _numbers(np.array(box.size) / 2),
            "friction": repr(box.friction),
            "rgba": _numbers(box.color),
            "group": "2",
        },
    )


def _size(primitive: Primitive) -> str:
    """Half sizes, as MuJoCo has them."""
    size = primitive.size
    if primitive.shape == "box":
        return _numbers(np.array(size) / 2)
    return _numbers((size[0], size[1] / 2) if primitive.shape == "cylinder" else size)


def _place(X_AB: Array) -> dict[str, str]:
    quaternion = quaternion_from_rotation(X_AB[:3, :3])
    return {"pos": _numbers(X_AB[:3, 3]), "quat": _numbers(quaternion)}


def _numbers(values: object) -> str:
    return " ".join(repr(v) for v in np.asarray(values, dtype=float).tolist())
