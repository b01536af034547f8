"""Writes a scene as MuJoCo's MJCF.

Bodies are where the scene has their objects, with the frames O. What is looked at and what collides
are geoms of two classes: MuJoCo collides the convex hull of a mesh, hence the convex pieces. Above
them there may be a hand, as in grasp trials, which actuators move.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from burg_drake.core.files import atomic_write
from burg_drake.export.layout import Layout, PlacedObject
from burg_drake.export.legal_names import LegalNames, model_name
from burg_drake.export.mjcf.assets import MjcfAssets
from burg_drake.export.mjcf.bodies import add_body, add_object, box_shape, collision_shapes
from burg_drake.export.mjcf.elements import numbers
from burg_drake.export.mjcf.hand import add_moved_hand, add_trial_options
from burg_drake.station.diagram import HandDescription
from burg_drake.station.world import FixedBox

MJCF_FILE = "scene.xml"

OPTIONS = {"timestep": "0.002", "integrator": "implicitfast", "cone": "elliptic", "impratio": "10"}
VISUAL, COLLISION = "visual", "collision"
"""Classes of geoms, in MuJoCo's usual groups: 2 is drawn, 3 is not."""


def write_mjcf(
    layout: Layout, folder: Path, hand: HandDescription | None = None
) -> tuple[str, ...]:
    """Writes `scene.xml` and the meshes and textures that it names.

    Args:
        layout: what to write.
        folder: empty.
        hand: to float above the scene.

    Returns:
        What became other than it is in the scene, and how the hand is moved, one sentence each.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: it is damaged.
        InvalidInputError: a place cannot be written to.
    """
    names = LegalNames.of_sdf(layout)
    root = Element("mujoco", {"model": model_name(layout.name)})
    SubElement(root, "compiler", {"angle": "radian", "autolimits": "true"})
    if hand is None:
        SubElement(root, "option", OPTIONS)
    else:
        add_trial_options(root)
    _add_classes(root)
    asset = SubElement(root, "asset")
    assets = MjcfAssets(asset, layout.library, folder)
    world = SubElement(root, "worldbody")
    light = {"directional": "true", "pos": "0 0 2", "dir": "0.2 0.3 -1", "diffuse": "0.5 0.5 0.5"}
    SubElement(world, "light", light)
    for name, box in layout.boxes.items():
        _add_box(add_body(world, names[name], box.X_WB), box)
    for placed in layout.objects:
        body = add_object(world, names[placed.name], placed, free=not placed.fixed)
        _add_geoms(body, placed, assets)
    notes = names.notes
    if hand is not None:
        mobilities = [1.0 / placed.entry.mass for placed in layout.objects if not placed.fixed]
        notes += (add_moved_hand(root, world, asset, hand, mobilities),)
    ElementTree.indent(root)
    atomic_write(folder / MJCF_FILE, f"{ElementTree.tostring(root, encoding='unicode')}\n")
    return notes


def _add_classes(root: Element) -> None:
    default = SubElement(root, "default")
    visual = SubElement(default, "default", {"class": VISUAL})
    drawn = {"type": "mesh", "contype": "0", "conaffinity": "0", "group": "2", "mass": "0"}
    SubElement(visual, "geom", drawn)
    collision = SubElement(default, "default", {"class": COLLISION})
    SubElement(collision, "geom", {"type": "mesh", "group": "3"})


def _add_geoms(body: Element, placed: PlacedObject, assets: MjcfAssets) -> None:
    entry = placed.entry
    for mesh, material in assets.visuals(placed.object, entry):
        SubElement(body, "geom", {"class": VISUAL, "mesh": mesh, "material": material})
    for shape in collision_shapes(placed, assets):
        touching = {"class": COLLISION, "friction": repr(entry.friction)}
        SubElement(body, "geom", {**touching, **shape})


def _add_box(body: Element, box: FixedBox) -> None:
    """One geom that is drawn and collides, in the group that is drawn."""
    SubElement(
        body,
        "geom",
        {
            "class": COLLISION,
            **box_shape(box),
            "friction": repr(box.friction),
            "rgba": numbers(box.color),
            "group": "2",
        },
    )
