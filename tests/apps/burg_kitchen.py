"""A library and a scene as BURG-Toolkit writes them: a table of half a metre on the ground, an open
shelf on it, and two boxes in the shelf and before it.

Laid out as scenarios/011 of github.com/mrudorfer/jogramop-framework is: fixed things have mass 0,
the origin is a corner of the ground area of 2 x 2 m, and furniture stands at its own corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

Box = tuple[Sequence[float], Sequence[float]]
"""Lower and upper corner [m]."""

TABLE: list[Box] = [
    ((0.0, 0.0, 0.46), (1.8, 0.8, 0.5)),
    *(((x, y, 0.0), (x + 0.06, y + 0.06, 0.46)) for x in (0.0, 1.74) for y in (0.0, 0.74)),
]
SHELF: list[Box] = [
    ((0.0, 0.0, 0.0), (0.02, 0.3, 0.5)),
    ((0.58, 0.0, 0.0), (0.6, 0.3, 0.5)),
    ((0.02, 0.28, 0.0), (0.58, 0.3, 0.5)),
    ((0.02, 0.0, 0.48), (0.58, 0.28, 0.5)),
]
BOXES: list[Box] = [((-0.03, -0.02, 0.0), (0.03, 0.02, 0.12))]
MESHES = {"table": TABLE, "open_shelf": SHELF, "sugar_box": BOXES}


def write_kitchen(folder: Path) -> tuple[Path, Path]:
    """Writes both documents and the meshes.

    Returns:
        The library's document, and the scene's.
    """
    (folder / "meshes").mkdir(parents=True)
    for name, boxes in MESHES.items():
        solid = trimesh.boolean.union([trimesh.creation.box(bounds=np.array(b)) for b in boxes])
        solid.export(folder / "meshes" / f"{name}.obj")
    library = folder / "object_library.yaml"
    masses = {"table": 0, "open_shelf": 0, "sugar_box": 0.4}
    _write(library, "ObjectLibrary", objects=[_thing(name, m) for name, m in masses.items()])
    scene = folder / "scene.yaml"
    _write(
        scene,
        "Scene",
        object_library_fn="object_library.yaml",
        ground_area_x=2,
        ground_area_y=2,
        objects=[_placed("sugar_box", 1.0, 0.95, 0.5), _placed("sugar_box", 0.4, 0.85, 0.5)],
        bg_objects=[_placed("table", 0.0, 0.6, 0.0), _placed("open_shelf", 0.7, 1.05, 0.5)],
        printout=None,
    )
    return library, scene


def _thing(identifier: str, mass: float) -> dict[str, Any]:
    return {
        "friction_coeff": 0.24,
        "identifier": identifier,
        "mass": mass,
        "mesh_fn": f"meshes\\{identifier}.obj",
        "name": identifier,
        "scale": 1.0,
        "stable_poses": None,
        "thumbnail_fn": None,
        "urdf_fn": f"urdf\\{identifier}.urdf",
        "vhacd_fn": None,
    }


def _placed(object_type: str, *place: float) -> dict[str, Any]:
    pose = np.eye(4)
    pose[:3, 3] = place
    return {"object_type": object_type, "pose": pose.tolist()}


def _write(path: Path, kind: str, **content: Any) -> None:
    content |= {"yaml_file_type": kind, "yaml_file_version": "1.0"}
    path.write_text(yaml.dump(content))
