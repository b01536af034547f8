"""Convex polytopes with the faces and edges that a separating axis can come from."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, transform_points
from burg_drake.geometry.hulls import convex_hull

COPLANAR = 1e-9
"""Triangles of a hull whose planes differ by less (unit normal, offset [m]) are one face."""

PRISM_SIDES = 128
"""Sides of the prism within a cylinder, where no exact form is at hand: 0.01 mm inside of one of
34 mm radius."""

KEPT = 2048
"""Hulls that are kept, as one object is read for several purposes: the latest ones."""


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex polytope with volume.

    Attributes:
        vertices: (V, 3) [m].
        normals: (F, 3) outward unit normals of the faces.
        offsets: (F,) largest `normal . vertex` [m].
        edge_faces: (E, 2) the two faces that meet at each edge.
        edge_vertices: (E, 2) its two ends.
    """

    vertices: Array
    normals: Array
    offsets: Array
    edge_faces: NDArray[np.intp]
    edge_vertices: NDArray[np.intp]

    @classmethod
    def from_points(cls, points: Array) -> Polytope:
        """The convex hull of points (N, 3) [m].

        Raises:
            scipy.spatial.QhullError: the points lie in a plane.
        """
        return _hull(np.asarray(points, dtype=float).tobytes())

    @classmethod
    def box(cls, half: Array) -> Polytope:
        """A box about the origin with half extents (3,) [m]."""
        return cls.from_points(np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half)

    @classmethod
    def prism(cls, radius: float, half_length: float, sides: int = PRISM_SIDES) -> Polytope:
        """A prism about z whose long edges lie on a cylinder."""
        angle = 2.0 * np.pi * np.arange(sides) / sides
        circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        ends = [np.column_stack([circle, np.full(sides, z)]) for z in (-half_length, half_length)]
        return cls.from_points(np.concatenate(ends))

    def moved(self, X_AB: Array) -> Polytope:
        """The polytope given in B, expressed in A: `X_AB` is (4, 4)."""
        vertices = transform_points(X_AB, self.vertices)
        normals = self.normals @ X_AB[:3, :3].T
        offsets = (vertices @ normals.T).max(axis=0)
        return Polytope(vertices, normals, offsets, self.edge_faces, self.edge_vertices)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Centre and half extents (3,) of the box along the axes around it [m]."""
        lower, upper = self.vertices.min(axis=0), self.vertices.max(axis=0)
        return (lower + upper) / 2, (upper - lower) / 2

    def as_box(self) -> tuple[Array, Array] | None:
        """Pose (4, 4) and half extents (3,) of the box that it is; None if it is no box."""
        if len(self.vertices) != 8 or len(self.normals) != 6:
            return None
        x = self.normals[0]
        across = self.normals[np.abs(self.normals @ x) < COPLANAR]
        if len(across) != 4:
            return None
        y = across[0]
        if np.sum(np.abs(across @ y) < COPLANAR) != 2:
            return None
        X = np.eye(4)
        X[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
        low, high = (f(self.vertices @ X[:3, :3], axis=0) for f in (np.min, np.max))
        X[:3, 3] = X[:3, :3] @ (low + high) / 2
        return X, (high - low) / 2


@lru_cache(maxsize=KEPT)
def _hull(data: bytes) -> Polytope:
    """The convex hull of points, given as the bytes of (N, 3)."""
    points = np.frombuffer(data).reshape(-1, 3)
    hull = convex_hull(points)
    planes, face = np.unique(
        (hull.equations / COPLANAR).round(), axis=0, return_index=False, return_inverse=True
    )
    face = face.reshape(-1)
    first = np.unique(face, return_index=True)[1]
    assert len(first) == len(planes)
    # Across the edge opposite to each corner of a triangle lies a neighbour.
    faces = np.sort(np.stack(np.broadcast_arrays(face[:, None], face[hull.neighbors])), axis=0)
    ends = np.sort(hull.simplices[:, [[1, 2], [0, 2], [0, 1]]], axis=-1)
    is_edge = faces[0] != faces[1]
    ends, faces = ends[is_edge], faces[:, is_edge].T
    once = np.sort(np.unique(ends @ (len(points), 1), return_index=True)[1])
    place = np.full(len(points), -1)
    place[hull.vertices] = np.arange(len(hull.vertices))
    vertices, normals = points[hull.vertices], hull.equations[first, :3]
    offsets = (vertices @ normals.T).max(axis=0)
    polytope = Polytope(vertices, normals, offsets, faces[once], place[ends[once]])
    for array in vars(polytope).values():
        array.flags.writeable = False
    return polytope
