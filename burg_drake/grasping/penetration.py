"""Exact penetration depth of convex polytopes and spheres; cylinders are taken as prisms.

Drake's own depth is that of some separating direction, and not always of the nearest one: a finger
pad 20 mm deep in a table top may be reported as 0.3 m away from the table's side.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Cylinder, GeometryId, SceneGraphInspector, Sphere
from scipy.spatial import ConvexHull

from burg_drake.core.frames import Array, transform_points

CYLINDER_SIDES = 128
"""Sides of the prism within a cylinder: 0.01 mm inside one of 34 mm radius."""


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex polytope in its own frame, or a ball: a point with a radius.

    Attributes:
        vertices: (N, 3) [m].
        normals: (F, 3) unit normals of the faces; of parallel faces one is enough.
        edges: (E, 3) unit directions of the edges; of parallel edges one is enough.
        radius: by which it is larger than that all around [m]; of a ball, with one vertex.
    """

    vertices: Array
    normals: Array
    edges: Array
    radius: float = 0.0

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
        """A box, a ball, a cylinder, or the convex hull of a mesh, of a scene graph."""
        shape = inspector.GetShape(geometry)
        if isinstance(shape, Sphere):
            return cls.ball(shape.radius())
        if isinstance(shape, Cylinder):
            return cls.prism(shape.radius(), shape.length())
        if isinstance(shape, Box):
            signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
            return cls(signs * np.asarray(shape.size()) / 2, np.eye(3), np.eye(3))
        hull = inspector.GetConvexHull(geometry)
        return cls.from_points(np.array([hull.vertex(i) for i in range(hull.num_vertices())]))

    @classmethod
    def ball(cls, radius: float) -> Polytope:
        """A ball about the origin."""
        return cls(np.zeros((1, 3)), np.zeros((0, 3)), np.zeros((0, 3)), radius)

    @classmethod
    def prism(cls, radius: float, length: float, sides: int = CYLINDER_SIDES) -> Polytope:
        """A prism about z whose edges lie on a cylinder; the number of sides is even."""
        angle = 2.0 * np.pi * np.arange(sides) / sides
        circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        ends = [np.column_stack([circle, np.full(sides, h)]) for h in (-length / 2, length / 2)]
        half = angle[: sides // 2]
        normal = half + np.pi / sides
        flat, z = np.zeros(sides // 2), np.array([[0.0, 0.0, 1.0]])
        normals = np.column_stack([np.cos(normal), np.sin(normal), flat])
        edges = np.column_stack([-np.sin(normal), np.cos(normal), flat])
        return cls(np.concatenate(ends), np.vstack([normals, z]), np.vstack([edges, z]))


def penetration_depth(one: Polytope, other: Polytope, X_AB: Array) -> float:
    """Smallest translation that separates two polytopes [m]; 0 if they are apart.

    By the separating axis theorem the direction is a face normal of one of them or the cross
    product of two of their edges (Gottschalk, Lin and Manocha, SIGGRAPH 1996). The point of a
    polytope that is nearest to a ball's centre may also be a vertex, or lie on an edge.

    Args:
        one: given in A.
        other: given in B.
        X_AB: (4, 4) pose of B in A.
    """
    R_AB = X_AB[:3, :3]
    crosses = np.cross(one.edges[:, None], (other.edges @ R_AB.T)[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    crosses = crosses[lengths > 1e-6] / lengths[lengths > 1e-6, None]
    p_AV = transform_points(X_AB, other.vertices)
    axes = np.concatenate([one.normals, other.normals @ R_AB.T, crosses])
    if other.radius > 0.0:
        axes = np.concatenate([axes, _towards(p_AV[0], one.vertices, one.edges)])
    if one.radius > 0.0:
        axes = np.concatenate([axes, _towards(one.vertices[0], p_AV, other.edges @ R_AB.T)])
    if not len(axes):  # two balls about one point
        return one.radius + other.radius
    along_one = one.vertices @ axes.T
    along_other = p_AV @ axes.T
    overlap = np.minimum(
        along_one.max(axis=0) - along_other.min(axis=0),
        along_other.max(axis=0) - along_one.min(axis=0),
    )
    return max(0.0, float(overlap.min()) + one.radius + other.radius)


def _towards(point: Array, vertices: Array, edges: Array) -> Array:
    """Unit directions to a point (3,) from vertices, and from lines along edges through them."""
    apart = point - vertices
    along = np.einsum("vk,ek->ve", apart, edges)[..., None] * edges
    directions = np.concatenate([apart, (apart[:, None] - along).reshape(-1, 3)])
    lengths = np.linalg.norm(directions, axis=1)
    return directions[lengths > 1e-9] / lengths[lengths > 1e-9, None]


def _unsigned(directions: Array) -> Array:
    """Distinct directions up to sign."""
    largest = np.abs(directions).argmax(axis=1)
    signs = np.sign(directions[np.arange(len(directions)), largest])
    return np.unique((directions * signs[:, None]).round(9), axis=0)
