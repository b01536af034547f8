"""Convex shapes (boxes, hulls, balls, cylinders) and their exact penetration depth, in batches.

Shapes are described by their support function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, inverse
from burg_drake.geometry.polytopes import Polytope
from burg_drake.geometry.poses import Poses

Components = tuple[Array, Array, Array]
"""x, y and z of vectors, each of the same shape."""


class Convex(Protocol):
    """A shape given in its own frame B, as one of M pairs with a polytope.

    Directions point from the polytope into the shape. `normals` are the polytope's, (M, F), and
    `vertices` its vertices, (M, V), all in B.
    """

    def select(self, pairs: NDArray[np.intp]) -> Convex:
        """Selects pairs by index."""
        ...

    def support_distance(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        """Support distance along -`a`: largest `-a . p` [m]. Directions are (M, K), or (L,) with
        the indices `pair` (L,) of their pairs."""
        ...

    def own_face_overlap(self, vertices: Components) -> Array:
        """(M,) smallest overlap along normals of the shape's own faces [m]."""
        ...

    def edge_overlap(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        """(M,) smallest overlap along directions given by edges of both shapes, or by the shape's
        curved surface [m]."""
        ...


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes about the origin, one per pair.

    Attributes:
        half: (M, 3) half extents [m].
    """

    half: Array

    def select(self, pairs: NDArray[np.intp]) -> Boxes:
        return Boxes(self.half[pairs])

    def support_distance(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        x, y, z = self.half[:, :, None].swapaxes(0, 1) if pair is None else self.half[pair].T
        return np.abs(a[0]) * x + np.abs(a[1]) * y + np.abs(a[2]) * z

    def own_face_overlap(self, vertices: Components) -> Array:
        slabs = [
            np.minimum(half + v.max(axis=1), half - v.min(axis=1))
            for half, v in zip(self.half.T, vertices, strict=True)
        ]
        return np.minimum(np.minimum(slabs[0], slabs[1]), slabs[2])

    def edge_overlap(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        found = [silhouette_overlap(self, one, u, normals, vertices) for u in np.eye(3)]
        return np.minimum(np.minimum(found[0], found[1]), found[2])


@dataclass(frozen=True, eq=False)
class Hull:
    """One polytope for all pairs.

    Attributes:
        polytope: the polytope.
    """

    polytope: Polytope

    def select(self, pairs: NDArray[np.intp]) -> Hull:
        return self

    def support_distance(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        return max_projection((-a[0], -a[1], -a[2]), self.polytope.vertices)

    def own_face_overlap(self, vertices: Components) -> Array:
        found = np.full(len(vertices[0]), np.inf)
        for normal, offset in zip(self.polytope.normals, self.polytope.offsets, strict=True):
            np.minimum(
                found, offset - project_on_direction(normal, vertices).min(axis=1), out=found
            )
        return found

    def edge_overlap(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        found = np.full(len(vertices[0]), np.inf)
        for u in self._edge_directions():
            np.minimum(found, silhouette_overlap(self, one, u, normals, vertices), out=found)
        return found

    def _edge_directions(self) -> Array:
        """Distinct directions of edges up to sign (D, 3)."""
        ends = self.polytope.vertices[self.polytope.edge_vertices]
        u = ends[:, 1] - ends[:, 0]
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        largest = np.take_along_axis(u, np.abs(u).argmax(axis=1)[:, None], axis=1)
        _, first = np.unique((u * np.sign(largest)).round(9), axis=0, return_index=True)
        return np.asarray(u[first])


@dataclass(frozen=True)
class Ball:
    """A ball about the origin.

    Attributes:
        radius: [m].
    """

    radius: float

    def select(self, pairs: NDArray[np.intp]) -> Ball:
        return self

    def support_distance(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        return np.full_like(a[0], self.radius)

    def own_face_overlap(self, vertices: Components) -> Array:
        return np.full(len(vertices[0]), np.inf)

    def edge_overlap(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        """Smallest overlap along lines from the nearest point of each edge to the centre."""
        first, second = one.edge_vertices.T
        start = map_components(lambda v: v[:, first], vertices)
        u = map_components(lambda v: v[:, second] - v[:, first], vertices)
        t = np.clip(-dot(start, u) / dot(u, u), 0.0, 1.0)
        return _radial_overlap(
            self.radius, map_components(lambda p, v: -(p + t * v), start, u), vertices
        )


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about z and the origin.

    Attributes:
        radius, half_length: [m].
    """

    radius: float
    half_length: float

    def select(self, pairs: NDArray[np.intp]) -> Cylinder:
        return self

    def support_distance(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        return self.radius * np.sqrt(a[0] * a[0] + a[1] * a[1]) + self.half_length * np.abs(a[2])

    def own_face_overlap(self, vertices: Components) -> Array:
        z = vertices[2]
        return self.half_length + np.minimum(z.max(axis=1), -z.min(axis=1))

    def edge_overlap(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        """Smallest overlap across the axis, away from edges and vertices, and of edges with the
        rims."""
        across = silhouette_overlap(self, one, np.eye(3)[2], normals, vertices)
        x, y, z = vertices
        radial = _radial_overlap(self.radius, (-x, -y, np.zeros_like(z)), vertices)
        rims = edge_arc_overlap(self, one, normals, vertices)
        return np.minimum(np.minimum(across, radial), rims)


def map_components(f: Callable[..., Array], *vectors: Components) -> Components:
    """Applies a function to each component."""
    x, y, z = map(f, *vectors)
    return x, y, z


def dot(a: Components | Array, b: Components | Array) -> Array:
    """Inner products of vectors of the same shape, whose components come first."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def project_on_direction(u: Array, a: Components) -> Array:
    """Components of vectors along one direction (3,)."""
    return u[0] * a[0] + u[1] * a[1] + u[2] * a[2]


def max_projection(a: Components, points: Array) -> Array:
    """Largest `a . p` over points (K, 3)."""
    found = project_on_direction(points[0], a)
    for p in points[1:]:
        np.maximum(found, project_on_direction(p, a), out=found)
    return found


def silhouette_overlap(
    other: Convex, one: Polytope, u: Array, normals: Components, vertices: Components
) -> Array:
    """(M,) smallest overlap along directions perpendicular to `u` (3,) and to an edge of the
    polytope; inf without such a direction. An edge has one, on the arc between the normals of its
    faces, if it is on the silhouette seen along u."""
    height = project_on_direction(u, normals)
    first, second = one.edge_faces.T
    up = height > 0.0
    pair, edge = np.nonzero(up[:, first] != up[:, second])
    found = np.full(len(height), np.inf)
    if not len(pair):
        return found
    first, second = first[edge], second[edge]
    below = height[pair, first]
    t = below / (below - height[pair, second])
    a = map_components(lambda n: (1.0 - t) * n[pair, first] + t * n[pair, second], normals)
    end = one.edge_vertices[edge, 0]
    q = map_components(lambda v: v[pair, end], vertices)
    overlap = (dot(a, q) + other.support_distance(a, pair)) / np.sqrt(dot(a, a))
    start = np.flatnonzero(np.diff(pair, prepend=-1))
    found[pair[start]] = np.minimum.reduceat(overlap, start)
    return found


def edge_arc_overlap(
    other: Convex, one: Polytope, normals: Components, vertices: Components
) -> Array:
    """(M,) smallest overlap along all normals of the polytope's edges, found by search."""
    n_samples = 9  # On an arc of at most a few radians.
    n_steps = 20  # Golden sections: direction to within 1e-4, overlap to 1e-8 of the size.
    golden_ratio = (np.sqrt(5.0) - 1.0) / 2.0
    first, second = one.edge_faces.T
    n1, n2 = (map_components(lambda n, k=k: n[:, k], normals) for k in (first, second))
    q = map_components(lambda v: v[:, one.edge_vertices[:, 0]], vertices)

    def overlap(t: Array | float) -> Array:
        a = map_components(lambda x, y: (1.0 - t) * x + t * y, n1, n2)
        return np.asarray((dot(a, q) + other.support_distance(a)) / np.sqrt(dot(a, a)))

    samples = np.linspace(0.0, 1.0, n_samples)
    best = np.argmin([overlap(t) for t in samples], axis=0)
    low, high = samples[np.maximum(best - 1, 0)], samples[np.minimum(best + 1, n_samples - 1)]
    for _ in range(n_steps):
        step = golden_ratio * (high - low)
        t1, t2 = high - step, low + step
        left = overlap(t1) < overlap(t2)
        low, high = np.where(left, low, t1), np.where(left, t2, high)
    return np.asarray(overlap(0.5 * (low + high)).min(axis=1))


def _radial_overlap(radius: float, a: Components, vertices: Components) -> Array:
    """(M,) smallest overlap along vectors `a` (M, K) from a polytope to the centre of a circle or
    ball; inf where all have length 0."""
    length = np.sqrt(dot(a, a))
    support = np.full_like(length, -np.inf)
    for k in range(vertices[0].shape[1]):
        x, y, z = (v[:, k, None] for v in vertices)
        np.maximum(support, dot(a, (x, y, z)), out=support)
    with np.errstate(divide="ignore", invalid="ignore"):
        overlap = support / length + radius
    return np.asarray(np.where(length > 1e-9, overlap, np.inf).min(axis=1))


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex shape at a pose.

    Attributes:
        X_BP: (4, 4) pose of the shape's frame P in a body's frame; its origin is the middle of the
            shape's bounding box.
        half: (3,) half extents of that box along the axes of P [m].
        convex: the shape as a partner of a polytope, in P.
        polytope: the shape as a polytope, in P; None for a ball.
        curved: whether it is a cylinder or ball; the `polytope` of a cylinder is a prism inside it.
    """

    X_BP: Array
    half: Array
    convex: Convex
    polytope: Polytope | None
    curved: bool = False

    @classmethod
    def box(cls, X_BP: Array, half: Array) -> Shape:
        """A box."""
        return cls(X_BP, half, Boxes(half[None]), Polytope.box(half))

    @classmethod
    def hull(cls, X_BO: Array, points: Array) -> Shape:
        """The convex hull of points (N, 3) given in O."""
        polytope = Polytope.from_points(points)
        if (box := polytope.as_box()) is not None:
            return cls.box(X_BO @ box[0], box[1])
        X_OP = np.eye(4)
        X_OP[:3, 3], half = polytope.bounds
        centred = polytope.moved(inverse(X_OP))
        return cls(X_BO @ X_OP, half, Hull(centred), centred)

    @classmethod
    def ball(cls, X_BP: Array, radius: float) -> Shape:
        """A ball."""
        return cls(X_BP, np.full(3, radius), Ball(radius), None, curved=True)

    @classmethod
    def cylinder(cls, X_BP: Array, radius: float, half_length: float) -> Shape:
        """A cylinder about z."""
        half = np.array([radius, radius, half_length])
        prism = Polytope.prism(radius, half_length)
        return cls(X_BP, half, Cylinder(radius, half_length), prism, curved=True)


def penetration_depths(
    one: Polytope,
    other: Convex,
    X_BA: Poses,
    floor: Array | float = 0.0,
    *,
    faces_only: bool = False,
) -> Array:
    """Length of the smallest translation that separates a polytope from another shape.

    Args:
        one: the polytope, given in A.
        other: the shape, given in B; M shapes or one for all.
        X_BA: (M,) poses of A in B.
        floor: (M,) depths below it need not be exact [m].
        faces_only: only try directions normal to a face of either shape. The result is then an
            upper bound of the depth, exact if the smallest translation has such a direction.

    Returns:
        (M,) depths [m]. Where the shapes are apart, or the depth is below the floor, the number is
        an upper bound of the depth that is not above the floor.
    """
    normals = _rotate_components(X_BA.R, one.normals)
    p = X_BA.p[:, :, None].swapaxes(0, 1)
    vertices = map_components(np.add, _rotate_components(X_BA.R, one.vertices), (p[0], p[1], p[2]))
    overlap = dot(normals, (p[0], p[1], p[2])) + one.offsets + other.support_distance(normals)
    depth = np.minimum(overlap.min(axis=1), other.own_face_overlap(vertices))
    left = np.flatnonzero(depth > floor)
    if len(left) and not faces_only:
        normals, vertices = (
            map_components(lambda v: v[left], part) for part in (normals, vertices)
        )
        edges = other.select(left).edge_overlap(one, normals, vertices)
        depth[left] = np.minimum(depth[left], edges)
    return depth


def _rotate_components(R_BA: Array, v_A: Array) -> Components:
    """Vectors (K, 3) given in A, by component in B: (M, K)."""
    x, y, z = (
        R_BA[:, i, 0, None] * v_A[:, 0]
        + R_BA[:, i, 1, None] * v_A[:, 1]
        + R_BA[:, i, 2, None] * v_A[:, 2]
        for i in range(3)
    )
    return x, y, z
