"""Convex shapes seen through their support function, in batches of poses.

Of a pair of shapes that are to be told apart one is a `Polytope`, the other of a class here. Each
class answers how far the pair overlaps along the directions that can separate it from a polytope:
the smallest of these overlaps is the penetration depth (separating axis theorem; Gottschalk, Lin
and Manocha, SIGGRAPH 1996). By the Gauss map (Gregorius, "The separating axis test between convex
polyhedra", GDC 2013) the cross product of two edges matters only where it is normal to the
polytope's silhouette, and there the polytope's support is the edge itself.

Everything is elementwise arithmetic, minimum and maximum, without a matrix product: so a number
does not depend, not in its last bit, on what else is in the batch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.geometry.polytope import Polytope

Components = tuple[Array, Array, Array]
"""x, y and z of vectors, each of the same shape."""

AXES = np.eye(3)
ARC_SAMPLES = 9
ARC_STEPS = 20
"""Search of the least overlap along the normals of an edge that meets a rim: samples of an arc of
at most a few radians, then golden sections of the interval about the best one. The direction is
good to 1e-4, and the overlap, which has its minimum there, to 1e-8 of the size."""
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


class Convex(Protocol):
    """A shape given in its own frame B, as one of M pairs with a polytope.

    Directions point from the polytope into the shape. `normals` are the polytope's, (M, F), and
    `vertices` its vertices, (M, V), all in B.
    """

    def some(self, pairs: NDArray[np.intp]) -> Convex:
        """The shape of some of the pairs."""
        ...

    def reach(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        """How far the shape reaches against directions `a`: largest `-a . p` [m]. They are (M, K),
        or (L,) with the pairs (L,) that they belong to."""
        ...

    def along_own_faces(self, vertices: Components) -> Array:
        """(M,) smallest overlap along normals of the shape's own faces [m]."""
        ...

    def along_edges(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        """(M,) smallest overlap along directions that come of edges of both shapes, or of its
        curved surface [m]."""
        ...


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes about the origin, one a pair.

    Attributes:
        half: (M, 3) half extents [m].
    """

    half: Array

    def some(self, pairs: NDArray[np.intp]) -> Boxes:
        return Boxes(self.half[pairs])

    def reach(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        x, y, z = self.half[:, :, None].swapaxes(0, 1) if pair is None else self.half[pair].T
        return np.abs(a[0]) * x + np.abs(a[1]) * y + np.abs(a[2]) * z

    def along_own_faces(self, vertices: Components) -> Array:
        slabs = [
            np.minimum(half + v.max(axis=1), half - v.min(axis=1))
            for half, v in zip(self.half.T, vertices, strict=True)
        ]
        return np.minimum(np.minimum(slabs[0], slabs[1]), slabs[2])

    def along_edges(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        found = [along_silhouette(self, one, u, normals, vertices) for u in AXES]
        return np.minimum(np.minimum(found[0], found[1]), found[2])


@dataclass(frozen=True, eq=False)
class Hull:
    """One polytope for all pairs.

    Attributes:
        polytope: the polytope.
    """

    polytope: Polytope

    def some(self, pairs: NDArray[np.intp]) -> Hull:
        return self

    def reach(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        return farthest((-a[0], -a[1], -a[2]), self.polytope.vertices)

    def along_own_faces(self, vertices: Components) -> Array:
        found = np.full(len(vertices[0]), np.inf)
        for normal, offset in zip(self.polytope.normals, self.polytope.offsets, strict=True):
            np.minimum(found, offset - along(normal, vertices).min(axis=1), out=found)
        return found

    def along_edges(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        found = np.full(len(vertices[0]), np.inf)
        for u in self._edge_directions():
            np.minimum(found, along_silhouette(self, one, u, normals, vertices), out=found)
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

    def some(self, pairs: NDArray[np.intp]) -> Ball:
        return self

    def reach(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        return np.full_like(a[0], self.radius)

    def along_own_faces(self, vertices: Components) -> Array:
        return np.full(len(vertices[0]), np.inf)

    def along_edges(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        """Along the way from the nearest point of each edge to the centre."""
        first, second = one.edge_vertices.T
        start = each(lambda v: v[:, first], vertices)
        u = each(lambda v: v[:, second] - v[:, first], vertices)
        t = np.clip(-dot(start, u) / dot(u, u), 0.0, 1.0)
        return _along_paths(self.radius, each(lambda p, v: -(p + t * v), start, u), vertices)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about z and the origin.

    Attributes:
        radius, half_length: [m].
    """

    radius: float
    half_length: float

    def some(self, pairs: NDArray[np.intp]) -> Cylinder:
        return self

    def reach(self, a: Components, pair: NDArray[np.intp] | None = None) -> Array:
        return self.radius * np.sqrt(a[0] * a[0] + a[1] * a[1]) + self.half_length * np.abs(a[2])

    def along_own_faces(self, vertices: Components) -> Array:
        z = vertices[2]
        return self.half_length + np.minimum(z.max(axis=1), -z.min(axis=1))

    def along_edges(self, one: Polytope, normals: Components, vertices: Components) -> Array:
        """Across the axis, away from edges and from vertices; and where edges meet a rim."""
        across = along_silhouette(self, one, AXES[2], normals, vertices)
        x, y, z = vertices
        radial = _along_paths(self.radius, (-x, -y, np.zeros_like(z)), vertices)
        rims = along_arcs(self, one, normals, vertices)
        return np.minimum(np.minimum(across, radial), rims)


def each(f: Callable[..., Array], *vectors: Components) -> Components:
    """A function of each component."""
    x, y, z = map(f, *vectors)
    return x, y, z


def dot(a: Components, b: Components) -> Array:
    """Inner products of vectors of the same shape."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def along(u: Array, a: Components) -> Array:
    """Components of vectors along one direction (3,)."""
    return u[0] * a[0] + u[1] * a[1] + u[2] * a[2]


def farthest(a: Components, points: Array) -> Array:
    """Largest `a . p` over points (K, 3)."""
    found = along(points[0], a)
    for p in points[1:]:
        np.maximum(found, along(p, a), out=found)
    return found


def along_silhouette(
    other: Convex, one: Polytope, u: Array, normals: Components, vertices: Components
) -> Array:
    """(M,) smallest overlap along directions perpendicular to `u` (3,) and to an edge of the
    polytope; inf where there is none. On the arc between the normals of the edge's faces that is
    one direction, if the edge is on the silhouette seen along u."""
    height = along(u, normals)
    first, second = one.edge_faces.T
    up = height > 0.0
    pair, edge = np.nonzero(up[:, first] != up[:, second])
    found = np.full(len(height), np.inf)
    if not len(pair):
        return found
    first, second = first[edge], second[edge]
    below = height[pair, first]
    t = below / (below - height[pair, second])
    a = each(lambda n: (1.0 - t) * n[pair, first] + t * n[pair, second], normals)
    end = one.edge_vertices[edge, 0]
    q = each(lambda v: v[pair, end], vertices)
    overlap = (dot(a, q) + other.reach(a, pair)) / np.sqrt(dot(a, a))
    start = np.flatnonzero(np.diff(pair, prepend=-1))
    found[pair[start]] = np.minimum.reduceat(overlap, start)
    return found


def along_arcs(other: Convex, one: Polytope, normals: Components, vertices: Components) -> Array:
    """(M,) smallest overlap along all normals of the polytope's edges, found by search."""
    first, second = one.edge_faces.T
    n1, n2 = (each(lambda n, k=k: n[:, k], normals) for k in (first, second))
    q = each(lambda v: v[:, one.edge_vertices[:, 0]], vertices)

    def overlap(t: Array | float) -> Array:
        a = each(lambda x, y: (1.0 - t) * x + t * y, n1, n2)
        return np.asarray((dot(a, q) + other.reach(a)) / np.sqrt(dot(a, a)))

    samples = np.linspace(0.0, 1.0, ARC_SAMPLES)
    best = np.argmin([overlap(t) for t in samples], axis=0)
    low, high = samples[np.maximum(best - 1, 0)], samples[np.minimum(best + 1, ARC_SAMPLES - 1)]
    for _ in range(ARC_STEPS):
        step = GOLDEN * (high - low)
        t1, t2 = high - step, low + step
        left = overlap(t1) < overlap(t2)
        low, high = np.where(left, low, t1), np.where(left, t2, high)
    return np.asarray(overlap(0.5 * (low + high)).min(axis=1))


def _along_paths(radius: float, a: Components, vertices: Components) -> Array:
    """(M,) smallest overlap along ways `a` (M, K) from a polytope to the centre of a circle or
    ball; inf where all of them have no length."""
    length = np.sqrt(dot(a, a))
    support = np.full_like(length, -np.inf)
    for k in range(vertices[0].shape[1]):
        x, y, z = (v[:, k, None] for v in vertices)
        np.maximum(support, dot(a, (x, y, z)), out=support)
    with np.errstate(divide="ignore", invalid="ignore"):
        overlap = support / length + radius
    return np.asarray(np.where(length > 1e-9, overlap, np.inf).min(axis=1))
