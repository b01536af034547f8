"""Exact penetration depth of convex polytopes.

Drake's own depth is that of some separating direction, and not always of the nearest one: a finger
pad 20 mm deep in a table top may be reported as 0.3 m away from the table's side.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, GeometryId, SceneGraphInspector
from scipy.spatial import ConvexHull

from burg_drake.core.frames import Array, transform_points


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex polytope in its own frame.

    Attributes:
        vertices: (N, 3) [m].
        normals: (F, 3) unit normals of the faces; of parallel faces one is enough.
        edges: (E, 3) unit directions of the edges; of parallel edges one is enough.
    """

    vertices: Array
    normals: Array
    edges: Array

    @classmethod
    def from_points(cls, points: Array) -> Polytope:
        """The convex hull of points (N, 3) [m]."""
        hull = ConvexHull(points)
        edges = set()
        for face, (corners, neighbors) in enumerate(
            zip(hull.simplices, hull.neighbors, strict=True)
        ):
            for i, neighbor in enumerate(neighbors):  # the neighbour across the i-th corner's edge
                if not np.allclose(hull.equations[face], hull.equations[neighbor], atol=1e-9):
                    edges.add(frozenset(np.delete(corners, i).tolist()))
        pairs = np.array([sorted(edge) for edge in edges])
        directions = points[pairs[:, 1]] - points[pairs[:, 0]]
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return cls(points[hull.vertices], _unsigned(hull.equations[:, :3]), _unsigned(directions))

    @classmethod
    def from_geometry(cls, inspector: SceneGraphInspector, geometry: GeometryId) -> Polytope:
        """A box, or the convex hull of a mesh, of a scene graph."""
        shape = inspector.GetShape(geometry)
        if isinstance(shape, Box):
            signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
            return cls(signs * np.asarray(shape.size()) / 2, np.eye(3), np.eye(3))
        hull = inspector.GetConvexHull(geometry)
        return cls.from_points(np.array([hull.vertex(i) for i in range(hull.num_vertices())]))


def penetration_depth(one: Polytope, other: Polytope, X_AB: Array) -> float:
    """Smallest translation that separates two polytopes [m]; 0 if they are apart.

    By the separating axis theorem the direction is a face normal of one of them or the cross
    product of two of their edges (Gottschalk, Lin and Manocha, SIGGRAPH 1996).

    Args:
        one: given in A.
        other: given in B.
        X_AB: (4, 4) pose of B in A.
    """
    R_AB = X_AB[:3, :3]
    crosses = np.cross(one.edges[:, None], (other.edges @ R_AB.T)[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    crosses = crosses[lengths > 1e-6] / lengths[lengths > 1e-6, None]
    axes = np.concatenate([one.normals, other.normals @ R_AB.T, crosses])
    along_one = one.vertices @ axes.T
    along_other = transform_points(X_AB, other.vertices) @ axes.T
    overlap = np.minimum(
        along_one.max(axis=0) - along_other.min(axis=0),
        along_other.max(axis=0) - along_one.min(axis=0),
    )
    return max(0.0, float(overlap.min()))


def _unsigned(directions: Array) -> Array:
    """Distinct directions up to sign."""
    largest = np.abs(directions).argmax(axis=1)
    signs = np.sign(directions[np.arange(len(directions)), largest])
    return np.unique((directions * signs[:, None]).round(9), axis=0)
