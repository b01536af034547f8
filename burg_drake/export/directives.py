"""Writes a scene as Drake's model directives, in a folder that is a package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from burg_drake.core import Array
from burg_drake.core.files import atomic_write
from burg_drake.export.layout import Layout
from burg_drake.export.legal_names import LegalNames
from burg_drake.export.sdf_box import box_model
from burg_drake.export.sdf_object import object_model, sdf_document
from burg_drake.objects.library import LINK, package_manifest, package_name

DIRECTIVES_FILE = "scene.dmd.yaml"
OBJECTS, STATION = "objects", "station"
"""Folders of the objects' models, and of those of table and obstacles."""


def write_directives(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `scene.dmd.yaml`, a `package.xml`, and the models that the directives add.

    Args:
        layout: what to write.
        folder: empty.

    Returns:
        What became other than it is in the scene, one sentence each.

    Raises:
        InvalidInputError, UnknownNameError: see `object_model`; or a place cannot be written to.
    """
    package = f"{package_name(layout.name)}_scene"  # a library may have the same name
    for name, entry in layout.entries.items():
        home = folder / OBJECTS / name
        model = object_model(layout.library, name, entry, home, layout.packages)
        atomic_write(home / f"{name}.sdf", sdf_document(model))
    names = LegalNames.of_sdf(layout)
    directives: list[dict[str, Any]] = []
    for placed in layout.objects:
        file = f"{OBJECTS}/{placed.object}/{placed.object}.sdf"
        add = _add(names[placed.name], f"package://{package}/{file}")
        if placed.fixed:
            directives += [add, _weld(names[placed.name], placed.X_WO)]
        else:
            free = {"base_frame": "world", **_transform(placed.X_WO)}
            add["add_model"]["default_free_body_pose"] = {LINK: free}
            directives.append(add)
    for name, box in layout.boxes.items():
        atomic_write(folder / STATION / f"{name}.sdf", sdf_document(box_model(names[name], box)))
        file = f"package://{package}/{STATION}/{name}.sdf"
        directives += [_add(names[name], file), _weld(names[name], box.X_WB)]
    atomic_write(folder / "package.xml", package_manifest(package, "Scene"))
    text = yaml.dump(
        {"directives": directives},
        Dumper=_DirectivesDumper,
        sort_keys=False,
        default_flow_style=None,
    )
    atomic_write(folder / DIRECTIVES_FILE, text)
    return names.notes


class _AngleAxis(dict[str, Any]):
    """A rotation as Drake's schema has it, exact for any."""


class _DirectivesDumper(yaml.SafeDumper):
    """Writes rotations with their tag, and repeats values rather than giving them anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _angle_axis(dumper: _DirectivesDumper, value: _AngleAxis) -> yaml.Node:
    return dumper.represent_mapping("!AngleAxis", value.items(), flow_style=True)


_DirectivesDumper.add_representer(_AngleAxis, _angle_axis)


def _add(name: str, file: str) -> dict[str, Any]:
    return {"add_model": {"name": name, "file": file}}


def _weld(name: str, X_WB: Array) -> dict[str, Any]:
    weld = {"parent": "world", "child": f"{name}::{LINK}", "X_PC": _transform(X_WB)}
    return {"add_weld": weld}


def _transform(X_WB: Array) -> dict[str, Any]:
    """A pose in Drake's schema, which knows no quaternions."""
    turn = Rotation.from_matrix(X_WB[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(turn))
    axis = (turn / angle if angle else np.array([0.0, 0.0, 1.0])).tolist()
    rotation = _AngleAxis(angle_deg=float(np.rad2deg(angle)), axis=axis)
    return {"translation": X_WB[:3, 3].tolist(), "rotation": rotation}
