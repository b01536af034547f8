"""Visual meshes of an object split by material, and its collision meshes.

For formats whose meshes have one material each, and whose simulators collide convex shapes. Grasp
trials collide the object's own surface, as far as convex shapes can follow it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from burg_drake.core import Array, Rgba, cached
from burg_drake.geometry import convex_hull
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


def surface_hulls(library: ObjectLibrary, name: str) -> list[Array]:
    """An object's convex pieces, extended to its surface where they are inside it.

    A piece has few vertices, so that a curved surface stands out of it. Vertices of the surface
    that stand out are added to the nearest piece, and near seams to all that are as near.

    Args:
        library: the library.
        name: name of an object with convex pieces.

    Returns:
        Vertices (Ni, 3) of each piece in the object frame [m], from the cache.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: a mesh is damaged.
    """
    found = cached("surface-hulls", library.content[name], lambda: _extend_pieces(library, name))
    return [found[piece] for piece in sorted(found)]


def _extend_pieces(library: ObjectLibrary, name: str) -> dict[str, Array]:
    seam_overlap = 1e-4  # Metres; a vertex belongs to all pieces that are nearer than this.
    # Over the diagonal of a piece. A ball stands out of 64 vertices by 0.023. What is farther
    # away, such as a sheet that was too thin for a piece, is not of the piece.
    max_height = 0.04
    points = np.asarray(library.surface(name).vertices, dtype=float)
    pieces = [np.asarray(library.mesh(p).vertices, float) for p in library.entry(name).pieces]
    heights = np.array([_heights_above(points, piece) for piece in pieces])
    nearest = heights.min(axis=0).clip(min=0.0)
    found = {}
    for i, (piece, height) in enumerate(zip(pieces, heights, strict=True)):
        bound = max_height * float(np.linalg.norm(np.ptp(piece, axis=0)))
        added = points[(height > 0.0) & (height <= (nearest + seam_overlap).clip(max=bound))]
        corners = np.vstack([piece, added])
        found[f"piece_{i:05d}"] = corners[np.sort(convex_hull(corners).vertices)]
    return found


def _heights_above(points: Array, piece: Array) -> Array:
    """Distances (N,) of points from a convex piece's farthest plane below them; negative inside."""
    planes = np.unique(np.round(convex_hull(piece).equations, 9), axis=0)
    chunks = np.array_split(points, len(points) // 10_000 + 1)
    return np.concatenate([(p @ planes[:, :3].T + planes[:, 3]).max(axis=1) for p in chunks])


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
