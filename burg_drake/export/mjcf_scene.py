"""Scenes as MJCF: for other programs, and as the model of grasp trials.

Bodies have the poses of the scene's objects, with the frames O. For other programs, visual and
collision geoms are of two classes: MuJoCo collides the convex hull of a mesh, so collision geoms
are the convex pieces. The hand of grasp trials may be above them, moved by actuators.

In the model of grasp trials, poses, friction and the motion of the hand are set for each trial.
Objects on the table stand on a plane, with contact pairs of their own, because MuJoCo combines
friction by pairs of geoms and Drake by pairs of bodies; other bodies touch the table as a box.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from burg_drake.core import atomic_write
from burg_drake.export.layout import (
    Layout,
    PlacedObject,
    legal_model_name,
    model_names,
    renaming_notes,
)
from burg_drake.export.mjcf_hand import (
    HAND_BIT,
    OBJECT_BIT,
    RIGID_CONTACT_SOLREF,
    TABLE_BIT,
    CarrierJoint,
    add_hand,
    add_moved_hand,
    add_trial_options,
)
from burg_drake.export.mjcf_objects import (
    MjcfAssets,
    add_body,
    add_object,
    box_attributes,
    collision_shapes,
    format_numbers,
)
from burg_drake.station import FixedBox, HandDescription


def write_mjcf(
    layout: Layout, folder: Path, hand: HandDescription | None = None
) -> tuple[str, ...]:
    """Writes `scene.xml` and the meshes and textures that it names.

    Args:
        layout: scene and station to write.
        folder: empty folder.
        hand: hand to add above the scene.

    Returns:
        Notes on differences from the scene and on how to move the hand, one sentence each.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: the mesh is damaged.
        InvalidInputError: a file cannot be written.
    """
    names = model_names(layout)
    root = Element("mujoco", {"model": legal_model_name(layout.name)})
    SubElement(root, "compiler", {"angle": "radian", "autolimits": "true"})
    if hand is None:
        options = {"timestep": "0.002", "integrator": "implicitfast", "cone": "elliptic"}
        SubElement(root, "option", {**options, "impratio": "10"})
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
    notes = renaming_notes(names)
    if hand is not None:
        mobilities = [1.0 / placed.entry.mass for placed in layout.objects if not placed.fixed]
        notes += (add_moved_hand(root, world, asset, hand, mobilities),)
    ElementTree.indent(root)
    atomic_write(folder / "scene.xml", f"{ElementTree.tostring(root, encoding='unicode')}\n")
    return notes


def _add_classes(root: Element) -> None:
    default = SubElement(root, "default")
    visual = SubElement(default, "default", {"class": "visual"})
    drawn = {"type": "mesh", "contype": "0", "conaffinity": "0", "group": "2", "mass": "0"}
    SubElement(visual, "geom", drawn)
    collision = SubElement(default, "default", {"class": "collision"})
    SubElement(collision, "geom", {"type": "mesh", "group": "3"})


def _add_geoms(body: Element, placed: PlacedObject, assets: MjcfAssets) -> None:
    entry = placed.entry
    for mesh in assets.visuals(placed.object, entry):
        SubElement(body, "geom", {"class": "visual", "mesh": mesh, "material": mesh})
    for shape in collision_shapes(placed, assets):
        touching = {"class": "collision", "friction": repr(entry.friction)}
        SubElement(body, "geom", {**touching, **shape})


def _add_box(body: Element, box: FixedBox) -> None:
    """Adds one geom for display and collision, in the displayed group."""
    shape = {"class": "collision", **box_attributes(box.size), "friction": repr(box.friction)}
    SubElement(body, "geom", {**shape, "rgba": format_numbers(box.color), "group": "2"})


LIFT_JOINT = CarrierJoint("hand lift", (0.0, 0.0, 1.0), "hand lift speed", 1e5, 1.0)
"""Joint of the carrier. Its servos only correct the force that a trial applies."""


class MjcfBodyNames:
    """Names, or starts of names, of bodies in the model of grasp trials."""

    object = "object"  # Start of the names of movable bodies; the name in the scene follows.
    fixed = "fixed"  # Start of the names of fixed bodies.
    plane = "plane"  # Name of the ground plane.
    table = "table"  # Name of the table's box in the layout.


def trial_mjcf(
    layout: Layout,
    hand: HandDescription,
    *,
    step: float,
    on_table: Collection[str],
    alone: str | None = None,
) -> str:
    """The model of grasp trials as text; its pieces follow the surface of the objects.

    Args:
        layout: objects, table and obstacles.
        hand: the hand; it starts at its pose in its diagram.
        step: time step [s].
        on_table: names of objects that stand on the ground plane in place of the table's box.
        alone: name of the only movable object; if None, all objects that are not fixed can move.
    """
    root = Element("mujoco")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    add_trial_options(root, step)
    SubElement(root[-1], "flag", autoreset="disable")
    default = SubElement(root, "default")
    bits = {"contype": f"{OBJECT_BIT}", "conaffinity": f"{OBJECT_BIT}"}
    SubElement(default, "geom", {"condim": "3", "solref": RIGID_CONTACT_SOLREF, **bits})
    SubElement(default, "pair", condim="3", solref=RIGID_CONTACT_SOLREF)
    asset, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    contact = SubElement(root, "contact")
    assets = MjcfAssets(asset, layout.library, None)
    plane = {"name": MjcfBodyNames.plane, "type": "plane", "size": "1 1 1"}
    SubElement(world, "geom", {**plane, "contype": "0", "conaffinity": "0"})
    for name, box in layout.boxes.items():
        body = add_body(world, f"{MjcfBodyNames.fixed} {name}", box.X_WB)
        geom = {"name": f"{MjcfBodyNames.fixed} {name} 0", **box_attributes(box.size)}
        if name == MjcfBodyNames.table:
            geom |= {"contype": f"{TABLE_BIT}", "conaffinity": f"{HAND_BIT}"}
        SubElement(body, "geom", geom)
    for placed in layout.objects:
        free = not placed.fixed and alone in (None, placed.name)
        name = f"{MjcfBodyNames.fixed if placed.fixed else MjcfBodyNames.object} {placed.name}"
        body = add_object(world, name, placed, free=free)
        met = OBJECT_BIT if placed.name in on_table else OBJECT_BIT | TABLE_BIT
        for k, shape in enumerate(collision_shapes(placed, assets)):
            SubElement(body, "geom", {"name": f"{name} {k}", "conaffinity": f"{met}", **shape})
            if free and placed.name in on_table:
                pair = {"geom1": MjcfBodyNames.plane, "geom2": f"{name} {k}"}
                SubElement(contact, "pair", {"name": f"{name} {k}", **pair})
    add_hand(root, world, asset, hand, [LIFT_JOINT])
    return ElementTree.tostring(root, encoding="unicode")
