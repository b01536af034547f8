"""Visual meshes of an object split by material, and its collision meshes.

For formats whose meshes have one material each, and whose simulators collide convex shapes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from burg_drake.core import Array, Rgba
from burg_drake.objects import DEFAULT_RGBA, ObjectEntry, ObjectLibrary


@dataclass(frozen=True, eq=False)
class VisualPart:
    """Triangles of one material, in the object frame O.

    Attributes:
        vertices: (V, 3) vertices [m].
        normals: (V, 3) unit normals of the vertices.
        faces: (F, 3) triangles.
        uv: (V, 2) texture coordinates, v up; None without a texture.
        rgba: colour and opacity in [0, 1]; white under a texture.
        image: texture (PIL image), or None.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int64]
    uv: Array | None
    rgba: Rgba
    image: Any | None


def visual_parts(library: ObjectLibrary, entry: ObjectEntry) -> list[VisualPart]:
    """The parts of an object's visual mesh, in the order of its materials' names.

    Raises:
        UnknownNameError: the mesh is missing.
        MeshError: the mesh is damaged.
    """
    path = library.path(entry.mesh)
    try:
        scene = trimesh.load_scene(path, process=False)
        named = sorted(scene.geometry.items())
        parts = [_make_part(mesh) for _, mesh in named if len(mesh.faces)]
    except Exception as error:  # the reader raises errors of any type
        raise library.damaged(path) from error
    if not parts or not all(np.isfinite(part.vertices).all() for part in parts):
        raise library.damaged(path)
    return parts


def collision_meshes(entry: ObjectEntry) -> tuple[str, ...]:
    """Mesh files whose convex hulls are the collision geometry: the pieces, or the whole object if
    it has none."""
    return entry.pieces or (entry.contact.mesh or entry.surface or entry.mesh,)


def _make_part(mesh: trimesh.Trimesh) -> VisualPart:
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "image", None)
    uv = getattr(mesh.visual, "uv", None) if image is not None else None
    return VisualPart(
        vertices=np.asarray(mesh.vertices, dtype=float),
        normals=np.asarray(mesh.vertex_normals, dtype=float),
        faces=np.asarray(mesh.faces),
        uv=None if uv is None else np.asarray(uv, dtype=float)[:, :2],
        rgba=_material_color(material),
        image=image if uv is not None else None,
    )


def _material_color(material: Any) -> Rgba:
    """Diffuse colour and opacity of a material of an MTL file."""
    kwargs = getattr(material, "kwargs", {})
    if "kd" not in kwargs:
        return DEFAULT_RGBA
    r, g, b = (float(v) for v in kwargs["kd"])
    return r, g, b, float(kwargs.get("d", ["1"])[0])
