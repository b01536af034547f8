"""Table and obstacles of a station as SDF models."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from burg_drake.export.sdf_object import DRAKE, add_friction
from burg_drake.objects.library import LINK
from burg_drake.station.world import DISSIPATION, TABLE_MODULUS, FixedBox


def box_model(name: str, box: FixedBox) -> Element:
    """The element `model` of a box; as `station.world.surroundings` has it in Drake.

    Args:
        name: of the model.
        box: the box; its pose is left to whoever places the model.
    """
    model = Element("model", {"name": name})
    link = SubElement(model, "link", {"name": LINK})
    collision = SubElement(link, "collision", {"name": "collision"})
    _add_size(collision, box)
    add_friction(collision, repr(box.friction), repr(box.friction))
    properties = SubElement(collision, f"{{{DRAKE}}}proximity_properties")
    SubElement(properties, f"{{{DRAKE}}}compliant_hydroelastic")
    for key, value in (
        ("mesh_resolution_hint", max(box.size)),
        ("hydroelastic_modulus", TABLE_MODULUS),
        ("hunt_crossley_dissipation", DISSIPATION),
    ):
        SubElement(properties, f"{{{DRAKE}}}{key}").text = repr(value)
    visual = SubElement(link, "visual", {"name": "visual"})
    _add_size(visual, box)
    material = SubElement(visual, "material")
    for key in ("ambient", "diffuse"):
        SubElement(material, key).text = " ".join(f"{v:g}" for v in np.array(box.color))
    return model


def _add_size(parent: Element, box: FixedBox) -> None:
    shape = SubElement(SubElement(parent, "geometry"), "box")
    SubElement(shape, "size").text = " ".join(repr(float(v)) for v in box.size)
