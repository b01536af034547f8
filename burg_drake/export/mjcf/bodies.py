"""Objects as bodies of MJCF, whatever the model is for."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from burg_drake.core import Array
from burg_drake.export.layout import PlacedObject
from burg_drake.export.mjcf.assets import MjcfAssets
from burg_drake.export.mjcf.elements import box_size, full_inertia, place, round_size
from burg_drake.station.world import FixedBox


def add_body(world: Element, name: str, X_WB: Array) -> Element:
    """A body at a pose (4, 4)."""
    return SubElement(world, "body", {"name": name, **place(X_WB)})


def add_object(world: Element, name: str, placed: PlacedObject, *, free: bool) -> Element:
    """The body of an object, at first without geoms.

    Args:
        world: to add it to.
        name: of body and joint.
        placed: the object.
        free: whether it can move.
    """
    body = add_body(world, name, placed.X_WO)
    if free:
        properties = placed.entry.mass_properties
        SubElement(body, "freejoint", {"name": name})
        inertial = full_inertia(properties.mass, properties.center_of_mass, properties.inertia)
        SubElement(body, "inertial", inertial)
    return body


def collision_shapes(placed: PlacedObject, assets: MjcfAssets) -> list[dict[str, str]]:
    """Attributes of the geoms by which an object collides: its primitive, or its pieces."""
    entry = placed.entry
    primitive = entry.contact.primitive
    if entry.contact.kind == "primitive" and primitive is not None:
        if primitive.shape == "box":
            shape = box_size(primitive.size)
        else:
            shape = round_size(primitive.shape, primitive.size)
        return [{**shape, **place(primitive.X_OP.matrix())}]
    pieces = assets.pieces(placed.object, entry)
    return [{"type": "mesh", "mesh": mesh} for mesh in pieces]


def box_shape(box: FixedBox) -> dict[str, str]:
    """Attributes of the geom of a fixed box in its body."""
    return box_size(box.size)
