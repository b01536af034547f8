"""The model of grasp trials: a scene under the hand on one joint; what stands where, how rough it
is and how the hand is moved is set for each trial.

On the table objects stand on a plane, with contacts of their own for each object, as MuJoCo takes
friction by pairs of geoms and Drake by pairs of bodies; all else meets the table as a box.
"""

from __future__ import annotations

from collections.abc import Collection
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from burg_drake.export.layout import Layout
from burg_drake.export.mjcf.assets import MjcfAssets
from burg_drake.export.mjcf.bodies import add_body, add_object, box_shape, collision_shapes
from burg_drake.export.mjcf.hand import (
    FIRM,
    HAND_BIT,
    OBJECT_BIT,
    TABLE_BIT,
    CarrierJoint,
    add_hand,
    add_trial_options,
)
from burg_drake.station.diagram import HandDescription

LIFT = CarrierJoint("hand lift", (0.0, 0.0, 1.0), "hand lift speed", 1e5, 1.0)
"""The carrier's joint, which nothing that the hand may hold holds up. Who moves it has to apply the
force that speeds it up; the servos make up for what is left."""
OBJECT, FIXED, PLANE, TABLE = "object", "fixed", "plane", "table"
"""First words of the names of what can move, and what cannot: the rest is the name in the scene,
and of geoms and pairs with the plane a number. The table's box has its name in the layout."""


def trial_mjcf(
    layout: Layout,
    hand: HandDescription,
    *,
    step: float,
    on_table: Collection[str],
    alone: str | None = None,
) -> str:
    """The model as text; meshes are read where they are.

    Args:
        layout: with table and boxes.
        hand: at first it is where its diagram has it.
        step: time step [s].
        on_table: names of objects that have the plane under them, in place of the table's box.
        alone: the one object that can move; all that could if None.
    """
    root = Element("mujoco")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    add_trial_options(root, step)
    SubElement(root[-1], "flag", autoreset="disable")
    default = SubElement(root, "default")
    bits = {"contype": f"{OBJECT_BIT}", "conaffinity": f"{OBJECT_BIT}"}
    SubElement(default, "geom", {"condim": "3", "solref": FIRM, **bits})
    SubElement(default, "pair", condim="3", solref=FIRM)
    asset, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    contact = SubElement(root, "contact")
    assets = MjcfAssets(asset, layout.library, None)
    SubElement(
        world, "geom", name=PLANE, type="plane", size="1 1 1", contype="0", conaffinity="0"
    )  # fmt: skip
    for name, box in layout.boxes.items():
        body = add_body(world, f"{FIXED} {name}", box.X_WB)
        met = {"contype": f"{TABLE_BIT}", "conaffinity": f"{HAND_BIT}"} if name == TABLE else {}
        SubElement(body, "geom", {"name": f"{FIXED} {name} 0", **box_shape(box), **met})
    for placed in layout.objects:
        free = not placed.fixed and alone in (None, placed.name)
        name = f"{FIXED if placed.fixed else OBJECT} {placed.name}"
        body = add_object(world, name, placed, free=free)
        aware = OBJECT_BIT if placed.name in on_table else OBJECT_BIT | TABLE_BIT
        for k, shape in enumerate(collision_shapes(placed, assets)):
            geom = f"{name} {k}"
            SubElement(body, "geom", {"name": geom, "conaffinity": f"{aware}", **shape})
            if free and placed.name in on_table:
                SubElement(contact, "pair", name=geom, geom1=PLANE, geom2=geom)
    add_hand(root, world, asset, hand, [LIFT])
    return ElementTree.tostring(root, encoding="unicode")
