"""Writes a scene as an SDFormat world, for Gazebo and for Drake's Parser."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from burg_drake.core import Array, quaternion_from_rotation
from burg_drake.core.files import atomic_write
from burg_drake.export.layout import Layout
from burg_drake.export.legal_names import LegalNames, model_name
from burg_drake.export.sdf_box import box_model
from burg_drake.export.sdf_object import object_model, sdf_document
from burg_drake.objects.library import LINK

WORLD_FILE = "world.sdf"
OBJECTS = "objects"
"""Folder with one folder an object."""


def write_sdf(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `world.sdf` and the meshes that it names by relative paths.

    Args:
        layout: what to write.
        folder: empty.

    Returns:
        What became other than it is in the scene, one sentence each.

    Raises:
        InvalidInputError, UnknownNameError: see `object_model`; or a place cannot be written to.
    """
    names = LegalNames.of_sdf(layout)
    world = Element("world", {"name": model_name(layout.name)})
    models = {
        name: object_model(layout.library, name, entry, folder / OBJECTS / name, layout.packages)
        for name, entry in layout.entries.items()
    }
    for placed in layout.objects:
        model = deepcopy(models[placed.object])
        model.set("name", names[placed.name])
        for uri in model.iter("uri"):
            uri.text = f"{OBJECTS}/{placed.object}/{uri.text}"
        world.append(_placed(model, placed.X_WO, placed.fixed))
    for name, box in layout.boxes.items():
        world.append(_placed(box_model(names[name], box), box.X_WB, fixed=True))
    atomic_write(folder / WORLD_FILE, sdf_document(world))
    return names.notes


def _placed(model: Element, X_WB: Array, fixed: bool) -> Element:
    """Places the link of a model in the world."""
    for old in (*model.findall("pose"), *model.findall("static")):
        model.remove(old)
    model.set("placement_frame", LINK)
    x, y, z = X_WB[:3, 3].tolist()
    qw, qx, qy, qz = quaternion_from_rotation(X_WB[:3, :3]).tolist()
    pose = Element("pose", {"rotation_format": "quat_xyzw"})
    pose.text = " ".join(map(repr, (x, y, z, qx, qy, qz, qw)))
    model.insert(0, pose)
    if fixed:
        SubElement(model, "static").text = "true"
    return model
