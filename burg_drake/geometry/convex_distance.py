"""Distances of convex shapes that do not overlap, and of points from triangles, in batches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, transform_points
from burg_drake.geometry.convex_shapes import Ball, Cylinder, Shape, dot
from burg_drake.geometry.poses import Poses

DISTANCE_TOLERANCE = 1e-9
"""Metres. Only pairs with the rim of a cylinder can be off by this much; others are exact to
rounding."""


VERTEX_BLOCK = 2**16
"""Vertices in a batch; fits a processor's caches."""


@dataclass(frozen=True, eq=False)
class ShapeBatch:
    """S convex shapes in one frame, each the Minkowski sum of a polytope, a disc and a ball.

    Attributes:
        x, y, z: (S, V) vertices [m]; rows are filled up with their first vertex.
        count: (S,) numbers of vertices.
        center: (S, 3) middles of the shapes [m].
        disc_axes: two orthogonal unit vectors (3, S) in the plane of each disc.
        disc, ball: (S,) radii [m]; 0 where there is none.
    """

    x: Array
    y: Array
    z: Array
    count: Indices
    center: Array
    disc_axes: tuple[Array, Array]
    disc: Array
    ball: Array

    @classmethod
    def of(cls, shapes: Sequence[Shape]) -> ShapeBatch:
        """A batch of at least one shape."""
        vertices = [transform_points(shape.X_BP, _core_vertices(shape)) for shape in shapes]
        convex = [shape.convex for shape in shapes]
        X_BP = np.array([shape.X_BP for shape in shapes])
        return cls.from_vertices(
            vertices,
            X_BP,
            center=X_BP[:, :3, 3],
            disc=np.array([c.radius if isinstance(c, Cylinder) else 0.0 for c in convex]),
            ball=np.array([c.radius if isinstance(c, Ball) else 0.0 for c in convex]),
        )

    @classmethod
    def from_vertices(
        cls, vertices: Sequence[Array], X: Array, *, center: Array, disc: Array, ball: Array
    ) -> ShapeBatch:
        """A batch of S shapes.

        Args:
            vertices: (V, 3) vertices of each shape [m].
            X: (S, 4, 4) poses of the shapes, whose discs lie across z.
            center, disc, ball: see the attributes.
        """
        count = np.array([len(v) for v in vertices])
        corners = np.arange(count.max())
        filled = np.array([v[np.where(corners < len(v), corners, 0)] for v in vertices])
        x, y, z = np.ascontiguousarray(np.moveaxis(filled, -1, 0))
        axes = X[:, :3, 0].T.copy(), X[:, :3, 1].T.copy()
        return cls(x, y, z, count, center, axes, disc, ball)

    def support(self, shape: Indices, d: Array) -> Array:
        """Support points (3, L) of the shapes (L,) without their balls, along directions `d`
        (3, L)."""
        width = self.count[shape].max()
        x, y, z = (v[shape, :width] for v in (self.x, self.y, self.z))
        best = (x * d[0, :, None] + y * d[1, :, None] + z * d[2, :, None]).argmax(axis=1)
        found = np.stack([v[shape, best] for v in (self.x, self.y, self.z)])
        discs = np.flatnonzero(self.disc[shape])
        if len(discs):
            u1, u2 = (u[:, shape[discs]] for u in self.disc_axes)
            h1, h2 = dot(d[:, discs], u1), dot(d[:, discs], u2)
            length = np.sqrt(h1 * h1 + h2 * h2)
            length[length == 0.0] = np.inf
            found[:, discs] += self.disc[shape[discs]] * (h1 / length * u1 + h2 / length * u2)
        return found


def _core_vertices(shape: Shape) -> Array:
    """Vertices (V, 3) of a shape's polytope, without its disc and ball, in P."""
    match shape.convex:
        case Ball():
            return np.zeros((1, 3))
        case Cylinder(half_length=half_length):
            return np.array([(0.0, 0.0, -half_length), (0.0, 0.0, half_length)])
    assert shape.polytope is not None
    return shape.polytope.vertices


def shape_distances(
    one: ShapeBatch,
    one_index: Indices,
    other: ShapeBatch,
    other_index: Indices,
    X_BA: Poses,
    ceiling: Array | float = np.inf,
) -> Array:
    """Distances of pairs of shapes that do not overlap.

    Args:
        one: shapes given in A.
        one_index: (L,) index of the first shape of each pair, in `one`.
        other: shapes given in B.
        other_index: (L,) index of the second shape of each pair, in `other`.
        X_BA: (L,) poses of A in B.
        ceiling: (L,) distances above it may be returned as inf [m].

    Returns:
        (L,) distances [m], to within `DISTANCE_TOLERANCE`; may be inf if above the ceiling.
        Shapes that touch or overlap get a distance from 0 to `DISTANCE_TOLERANCE`.
    """
    found = np.empty(len(one_index))
    limit = np.broadcast_to(ceiling, found.shape)
    for block in _vertex_blocks(np.maximum(one.count[one_index], other.count[other_index])):
        search = _DistanceSearch(one, one_index[block], other, other_index[block], X_BA[block])
        found[block] = search.distances(limit[block])
    return found


def _vertex_blocks(count: Indices) -> list[Indices]:
    """Blocks of indices of pairs with similar numbers of vertices (L,)."""
    if not len(count):
        return []
    order = np.argsort(count, kind="stable")
    block = np.cumsum(count[order]) // VERTEX_BLOCK
    return np.split(order, np.flatnonzero(np.diff(block)) + 1)


class _DistanceSearch:
    """GJK on the Minkowski differences of L pairs at once. Arrays of vectors are (3, L)."""

    def __init__(
        self,
        one: ShapeBatch,
        one_index: Indices,
        other: ShapeBatch,
        other_index: Indices,
        X_BA: Poses,
    ) -> None:
        self._one, self._one_index, self._other, self._other_index = (
            one,
            one_index,
            other,
            other_index,
        )
        self._R = np.ascontiguousarray(np.moveaxis(X_BA.R, 0, -1))
        self._p = np.ascontiguousarray(X_BA.p.T)
        self._direction = X_BA.apply(one.center[one_index]).T - other.center[other_index].T

    def distances(self, ceiling: Array) -> Array:
        """(L,) distances [m]; inf above the ceiling (L,)."""
        max_steps = 200  # Random boxes and hulls need 2 (at most 8), cylinders 9 (at most 36).
        balls = self._one.ball[self._one_index] + self._other.ball[self._other_index]
        found = np.full(len(balls), np.inf)
        live = np.arange(len(balls))
        v = self._support(live, self._direction)
        corners = np.stack([v, v, v], axis=1)
        for _ in range(max_steps):
            length = np.sqrt(dot(v, v))
            found[live] = length
            w = self._support(live, v)
            support = dot(v, w)  # support / length is a lower bound of the distance
            with np.errstate(invalid="ignore"):  # inf * 0 is NaN, which compares as not far
                far = support > (ceiling[live] + balls[live]) * length
            found[live[far]] = np.inf
            left = ~far & (support < (length - DISTANCE_TOLERANCE) * length)
            live, v, w, corners = live[left], v[:, left], w[:, left], corners[..., left]
            nearer, corners = _nearest_point(w, corners, support[left] < 0.0)
            better = dot(nearer, nearer) < dot(v, v)  # else only rounding errors are left
            live, v, corners = live[better], nearer[:, better], corners[..., better]
            if not len(live):
                break
        found[live] = np.sqrt(dot(v, v))
        return np.asarray(np.maximum(found - balls, 0.0))

    def _support(self, pair: Indices, v: Array) -> Array:
        """Support points (3, L) of the Minkowski differences in the directions -v (3, L), in B."""
        R = self._R[..., pair]
        a = self._one.support(self._one_index[pair], -(R[0] * v[0] + R[1] * v[1] + R[2] * v[2]))
        a = R[:, 0] * a[0] + R[:, 1] * a[1] + R[:, 2] * a[2] + self._p[:, pair]
        return np.asarray(a - self._other.support(self._other_index[pair], v))


def _nearest_point(w: Array, corners: Array, may_contain: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Points of simplices nearest to the origin; only faces with the newest corner can hold them.

    Args:
        w: (3, L) newest corners.
        corners: (3 components, 3 corners, L) older corners; if there are fewer, some repeat.
        may_contain: (L,) whether the origin may be inside.

    Returns:
        Points (3, L), 0 where the origin is inside, and up to three corners (3, 3, L) of the faces
        that contain them.
    """
    # Edges e from w to a corner, f to the next one; t: parameter on an edge; r, s: on a face.
    e = corners - w[:, None]
    f = e[:, [1, 2, 0]]
    ee, ef, we = dot(e, e), dot(e, f), dot(w[:, None], e)
    ff, wf = ee[[1, 2, 0]], we[[1, 2, 0]]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(ee > 0.0, np.clip(-we / ee, 0.0, 1.0), 0.0)
        area = ee * ff - ef * ef
        r, s = (ef * wf - ff * we) / area, (ef * we - ee * wf) / area
        on_face = (r > 0.0) & (s > 0.0) & (r + s < 1.0)
        points = w[:, None] + np.concatenate([t * e, np.where(on_face, r * e + s * f, 0.0)], axis=1)
    best = dot(points, points).argmin(axis=0)  # 0 to 2: an edge, 3 to 5: a face
    pair = np.arange(w.shape[1])
    first = best % 3
    second = np.where(best >= 3, (first + 1) % 3, first)
    kept = np.stack([w, corners[:, first, pair], corners[:, second, pair]], axis=1)
    nearest = points[:, best, pair]
    tested = np.flatnonzero(may_contain)
    nearest[:, tested[_contains_origin(w[:, tested], e[..., tested])]] = 0.0
    return nearest, kept


def _contains_origin(w: Array, e: Array) -> NDArray[np.bool_]:
    """(L,) whether the origin is inside tetrahedra with a corner w (3, L) and edges e (3, 3, L)
    from that corner."""
    n = [_cross(e[:, k - 2], e[:, k - 1]) for k in range(3)]
    volume = dot(e[:, 0], n[0])
    shares = [-dot(w, normal) * np.sign(volume) for normal in n]
    inside = (shares[0] > 0.0) & (shares[1] > 0.0) & (shares[2] > 0.0)
    return np.asarray(inside & (shares[0] + shares[1] + shares[2] < np.abs(volume)))


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (3, ...)."""
    x, y, z = (a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3))
    return np.stack([x, y, z])


def triangle_distances(points: Array, triangles: Array) -> Array:
    """Distances [m] of points (..., 1, 3) to triangles (..., K, 3, 3), as (..., K)."""
    a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
    squared = np.minimum.reduce(
        [_squared_segment_distances(points, p, q) for p, q in ((a, b), (b, c), (c, a))]
    )
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal * normal).sum(axis=-1))
    inside = length > 0.0
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(q - p, points - p) * normal).sum(axis=-1) >= 0.0
    height = ((points - a) * normal).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    return np.where(inside, np.abs(height), np.sqrt(squared))


def _squared_segment_distances(points: Array, start: Array, end: Array) -> Array:
    """Squared distances of points to segments."""
    along = end - start
    square = np.maximum((along * along).sum(axis=-1), 1e-300)
    at = np.clip(((points - start) * along).sum(axis=-1) / square, 0.0, 1.0)
    apart = points - start - at[..., None] * along
    return (apart * apart).sum(axis=-1)
