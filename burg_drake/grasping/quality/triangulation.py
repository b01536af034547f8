"""A polytope in place of the unit ball: triangles, the edges between them, and their areas."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from burg_drake.core import Array, Indices


@dataclass(frozen=True, eq=False)
class TriangulatedBall:
    """A triangulated ball, the same after half a turn about x, y or z.

    Attributes:
        vertices: (V, 3).
        faces: (M, 3) vertices of the triangles, seen counter-clockwise from outside.
        normals: (M, 3) outward unit normals.
        distances: (M,) of the triangles' planes from the centre.
        edges: (E, 2) vertices of the edges.
        sides: (E, 2) the triangles that meet at each edge.
        neighbors: (M, 3) the triangles next to each triangle.
        volume: enclosed.
    """

    vertices: Array
    faces: Indices
    normals: Array
    distances: Array
    edges: Indices
    sides: Indices
    neighbors: Indices
    volume: float


@lru_cache(maxsize=8)
def triangulated_ball(subdivisions: int = 1, of_volume: bool = False) -> TriangulatedBall:
    """An icosahedron whose triangles are divided into four, again and again.

    Args:
        subdivisions: how often; there are 20 * 4**subdivisions triangles.
        of_volume: as large as the unit ball, and not inscribed in it.
    """
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    scale = (4.0 / 3.0 * np.pi / mesh.volume) ** (1.0 / 3.0) if of_volume else 1.0
    vertices = np.asarray(mesh.vertices) * scale
    corners = vertices[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    distances = (normals * corners[:, 0]).sum(axis=1)
    return TriangulatedBall(
        vertices,
        np.asarray(mesh.faces, np.int64),
        normals,
        distances,
        np.asarray(mesh.face_adjacency_edges, np.int64),
        np.asarray(mesh.face_adjacency, np.int64),
        _neighbors(np.asarray(mesh.face_adjacency, np.int64)),
        float(np.linalg.det(corners).sum() / 6.0),
    )


def _neighbors(sides: Indices) -> Indices:
    """(M, 3) from pairs of triangles (E, 2)."""
    both = np.concatenate([sides, sides[:, ::-1]])
    return both[np.argsort(both[:, 0], kind="stable"), 1].reshape(-1, 3)
