"""Convex hulls, robust against nearly flat facets, and convex polytopes with faces and edges.

Separating axes of two polytopes come from their faces and pairs of edges.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, transform_points

if TYPE_CHECKING:
    import trimesh


def convex_hull(points: Array) -> ConvexHull:
    """Convex hull of points (N, 3).

    Raises:
        scipy.spatial.QhullError: the points lie in a plane.
    """
    # Plain; allowing wide facets; joggling the input by some 1e-13.
    attempts = ("Qt", "Qt Q12", "QJ Pp")
    for options in attempts[:-1]:
        try:
            return ConvexHull(points, qhull_options=options)
        except QhullError as error:
            if "QH6154" in str(error) or "QH6214" in str(error):  # flat, or fewer than 4 points
                raise
    return ConvexHull(points, qhull_options=attempts[-1])


def hull_mesh(points: Array) -> trimesh.Trimesh:
    """Hull with outward winding, vertices in the order of `points`; QhullError if flat."""
    import trimesh

    hull = convex_hull(points)
    faces = hull.simplices.copy()
    triangle = points[faces]
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    inward = (normal * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    used = np.unique(faces)
    number = np.zeros(len(points), dtype=int)
    number[used] = np.arange(len(used))
    return trimesh.Trimesh(points[used], number[faces], process=False)


def reduced_hull(points: Array, max_vertices: int = 64, tolerance: float = 2e-4) -> trimesh.Trimesh:
    """Convex hull with few vertices, inside the full hull.

    The points farthest outside are added until all are within the tolerance, or `max_vertices` are
    reached.

    Args:
        points: (N, 3) [m].
        max_vertices: largest number of vertices of the result.
        tolerance: accepted distance of points outside the result [m].

    Raises:
        scipy.spatial.QhullError: the points lie in a plane.
    """
    candidates = points[np.sort(convex_hull(points).vertices)]
    if len(candidates) <= min(16, max_vertices):
        return hull_mesh(candidates)
    directions = np.array(
        [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
    )
    chosen = np.unique((candidates @ directions.T).argmax(axis=0)).tolist()
    while len(chosen) < max_vertices:
        equations = convex_hull(candidates[chosen]).equations
        above = candidates @ equations[:, :3].T + equations[:, 3]
        facet = above.argmax(axis=1)
        outside = above[np.arange(len(candidates)), facet]
        farthest = [i for i in np.argsort(-outside, kind="stable") if outside[i] > tolerance]
        if not farthest:
            break
        # One vertex per facet, as each lowers the distances of its neighbours, and at most four
        # per computation of the hull.
        _, first = np.unique(facet[farthest], return_index=True)
        new = [int(farthest[i]) for i in np.sort(first)[:4]]
        chosen += new[: max_vertices - len(chosen)]
    return hull_mesh(candidates[sorted(chosen)])


def thickness(points: Array) -> float:
    """Smallest width of points (N, 3) across a face of their hull [m]; 0 if they lie in a plane."""
    try:
        equations = convex_hull(points).equations
    except QhullError:
        return 0.0
    return float(-(points @ equations[:, :3].T + equations[:, 3]).min(axis=0).max())


COPLANAR_TOLERANCE = 1e-9
"""Triangles whose planes differ by less (unit normal, offset in metres) are one face."""

PRISM_SIDES = 128
"""Sides of the prism inside a cylinder: 0.01 mm error at 34 mm radius."""


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
        return _cached_hull(np.asarray(points, dtype=float).tobytes())

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
        """The polytope, given in B, expressed in A; `X_AB` is (4, 4)."""
        vertices = transform_points(X_AB, self.vertices)
        normals = self.normals @ X_AB[:3, :3].T
        offsets = (vertices @ normals.T).max(axis=0)
        return Polytope(vertices, normals, offsets, self.edge_faces, self.edge_vertices)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Centre and half extents (3,) of the axis-aligned bounding box [m]."""
        lower, upper = self.vertices.min(axis=0), self.vertices.max(axis=0)
        return (lower + upper) / 2, (upper - lower) / 2

    def as_box(self) -> tuple[Array, Array] | None:
        """Pose (4, 4) and half extents (3,) if the polytope is a box; None otherwise."""
        if len(self.vertices) != 8 or len(self.normals) != 6:
            return None
        x = self.normals[0]
        across = self.normals[np.abs(self.normals @ x) < COPLANAR_TOLERANCE]
        if len(across) != 4:
            return None
        y = across[0]
        if np.sum(np.abs(across @ y) < COPLANAR_TOLERANCE) != 2:
            return None
        X = np.eye(4)
        X[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
        low, high = (f(self.vertices @ X[:3, :3], axis=0) for f in (np.min, np.max))
        X[:3, 3] = X[:3, :3] @ (low + high) / 2
        return X, (high - low) / 2


@lru_cache(maxsize=2048)
def _cached_hull(data: bytes) -> Polytope:
    """The convex hull of points, given as the bytes of (N, 3)."""
    points = np.frombuffer(data).reshape(-1, 3)
    hull = convex_hull(points)
    planes, face = np.unique(
        (hull.equations / COPLANAR_TOLERANCE).round(),
        axis=0,
        return_index=False,
        return_inverse=True,
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
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    vertices, normals = points[hull.vertices], hull.equations[first, :3]
    offsets = (vertices @ normals.T).max(axis=0)
    polytope = Polytope(vertices, normals, offsets, faces[once], number[ends[once]])
    for array in vars(polytope).values():
        array.flags.writeable = False
    return polytope
