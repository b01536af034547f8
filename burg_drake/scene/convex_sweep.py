"""Distances that convex shapes can move along a line before they touch other shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from burg_drake.core import Array, Indices, transform_points

LINE_OFFSET = np.array([3e-9, 7e-9, 0.0])
"""Metres by which the line is moved, so that the simplex method does not stall."""


@dataclass(frozen=True, eq=False)
class ConvexShapes:
    """Convex shapes: each is the Minkowski sum of a point hull and an ellipsoid.

    Attributes:
        points: (S, V, 3) points [m]; shapes with fewer points repeat one.
        spread: (S, 3, 3) matrices A [m]: the ellipsoid is A u for all vectors u up to length 1. 0
            for a polytope, r times identity for a ball or capsule, of rank two, a disc, for a
            cylinder.
    """

    points: Array
    spread: Array

    @classmethod
    def of(cls, points: Sequence[Array], spread: Sequence[Array]) -> ConvexShapes:
        """Makes shapes from points (N, 3) and spread (3, 3) of each; at least one."""
        most = max(len(p) for p in points)
        padded = [np.concatenate([p, np.repeat(p[:1], most - len(p), axis=0)]) for p in points]
        return cls(np.array(padded), np.array(spread))

    @classmethod
    def joined(cls, shapes: Sequence[ConvexShapes]) -> ConvexShapes:
        """Concatenates shapes, in their order."""
        return cls.of([p for s in shapes for p in s.points], [A for s in shapes for A in s.spread])

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, X_AB: Array) -> ConvexShapes:
        """Shapes given in B, expressed in A: `X_AB` is (4, 4)."""
        return ConvexShapes(transform_points(X_AB, self.points), X_AB[:3, :3] @ self.spread)

    @cached_property
    def _round(self) -> bool:
        return bool(self.spread.any())

    def support(self, shape: Indices, n: Array) -> Array:
        """Support points (K, 3) of K shapes, the farthest ones along vectors n (K, 3)."""
        points, spread = self.points[shape], self.spread[shape]
        corner = np.einsum("kvi,ki->kv", points, n).argmax(axis=1)
        if not self._round:
            return np.asarray(points[np.arange(len(n)), corner])
        along = np.einsum("kij,ki->kj", spread, n)
        length = np.sqrt((along * along).sum(axis=1, keepdims=True))
        unit = np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
        return np.asarray(points[np.arange(len(n)), corner] + np.einsum("kij,kj->ki", spread, unit))

    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners (S, 3) of the bounding boxes of the shapes."""
        reach = np.sqrt((self.spread**2).sum(axis=2))
        return self.points.min(axis=1) - reach, self.points.max(axis=1) + reach


def contact_distances(
    moving: ConvexShapes,
    still: ConvexShapes,
    pairs: tuple[Indices, Indices],
    direction: Array,
    limit: float,
    offsets: Array | None = None,
    stop_below: float = -np.inf,
) -> Array:
    """Distances that the first shapes of pairs can move until they touch the second ones.

    Args:
        moving, still: the shapes.
        pairs: (K,) indices of moving and of still shapes; the two of a pair must be apart.
        direction: (3,) unit vector along which the moving shapes go.
        limit: longer distances are returned as infinite [m].
        offsets: (K, 3) offsets of the first shape of each pair at the start; zero if None.
        stop_below: the search ends once a distance is known to be below this [m]. The returned
            value is then also below this, but may exceed the distance.

    Returns:
        Distances (K,) [m], after which the gap or overlap of the two surfaces is at most some 1e-7
        m. Infinite for pairs that do not meet within the limit, or only after others have met.
    """
    block_size = 16  # Pairs that are solved at once.
    R = _sweep_basis(direction)
    a, b = (ConvexShapes(s.points @ R.T, R @ s.spread) for s in (moving, still))
    shift = np.zeros((len(pairs[0]), 3)) if offsets is None else offsets @ R.T
    (low_a, high_a), (low_b, high_b) = a.boxes(), b.boxes()
    low = low_b[pairs[1]] - high_a[pairs[0]] - shift
    high = high_b[pairs[1]] - low_a[pairs[0]] - shift
    meets = (low[:, :2] <= 0.0).all(axis=1) & (high >= 0.0).all(axis=1) & (low[:, 2] <= limit)
    order = np.flatnonzero(meets)
    order = order[np.argsort(low[order, 2])]
    distances = np.full(len(shift), np.inf)
    for block in (order[i : i + block_size] for i in range(0, len(order), block_size)):
        if low[block[0], 2] > limit or limit < stop_below:
            break
        across = low[block, :2], high[block, :2]
        i, j = pairs[0][block], pairs[1][block]
        distances[block] = _smallest_distances(a, b, i, j, shift[block], across, limit, stop_below)
        limit = min(limit, float(distances[block].min()))
    return distances


def _sweep_basis(direction: Array) -> Array:
    """(3, 3) rows: two directions perpendicular to the direction, and the direction."""
    across = np.eye(3)[np.abs(direction).argmin()]
    u = _cross(direction, across)
    u /= np.linalg.norm(u)
    return np.stack([u, _cross(direction, u), direction])


def _cross(u: Array, v: Array) -> Array:
    """Cross product of two vectors (3,), ten times as fast as numpy's for a single product."""
    (a, b, c), (d, e, f) = u, v
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])


def _smallest_distances(
    a: ConvexShapes,
    b: ConvexShapes,
    i: Indices,
    j: Indices,
    shift: Array,
    across: tuple[Array, Array],
    limit: float,
    stop_below: float,
) -> Array:
    """Distances (K,) of a few pairs along z; infinite above the limit. Each Minkowski difference M
    reaches from the first to the second value of `across` (K, 2)."""
    accuracy = 1e-7  # Metres between the final bounds of a distance.
    max_steps = 200  # Simplex steps; boxes need about 5, round shapes 15.
    start_radius = 10.0  # Metres of the first three points from the line, beyond any shape.
    start_height = 1e6  # Metres ahead; the points remain only if the line misses M.
    max_start_share = 1e-10  # Weight of a start point above which the line misses M.
    max_graze = 1e-7  # Metres of overlap at which shapes still slide along each other.
    distances = np.full(len(i), np.inf)
    middle = np.column_stack([(across[0] + across[1]) / 2.0, np.zeros(len(i))])
    half = np.maximum((across[1] - across[0]) / 2.0, max_graze)
    scale = np.column_stack([1.0 - max_graze / half, np.ones(len(i))])
    turn = 2.0 * np.pi * np.arange(3) / 3.0
    first = np.stack(
        [start_radius * np.cos(turn), start_radius * np.sin(turn), np.full(3, start_height)], axis=1
    )
    basis = np.repeat(first[None], len(i), axis=0)  # (K, 3 points, 3)
    left = np.arange(len(i))
    for _ in range(max_steps):
        triangles = _Triangles(basis)
        m = scale[left] * triangles.normal
        w = b.support(j[left], -m) - a.support(i[left], m) - shift[left] - middle[left]
        w = middle[left] + scale[left] * w + LINE_OFFSET
        lower = (triangles.normal * w).sum(axis=1)
        share = triangles.barycentric_coordinates(0.0, 0.0)
        height = (share * basis[..., 2]).sum(axis=1)
        foreign = (np.where(basis[..., 2] == start_height, share, 0.0) > max_start_share).any(
            axis=1
        )
        ends = height - lower <= accuracy
        done = ends & ~foreign & (lower >= -accuracy)
        distances[left[done]] = lower[done]
        limit = min(limit, float(distances[left].min(initial=np.inf)))
        short = ~foreign & (height < stop_below) & (height >= 0.0)  # heights behind are below 0
        if short.any():
            distances[left[short]] = height[short]
            break
        goes_on = ~ends & (lower <= limit)
        if not goes_on.any():
            break
        fall = triangles.barycentric_coordinates(w[:, 0], w[:, 1])[goes_on]
        left, basis = left[goes_on], basis[goes_on]
        basis[np.arange(len(left)), _leaving_point(fall, share[goes_on])] = w[goes_on]
    else:
        distances[left] = np.maximum(lower[goes_on], 0.0)
    return np.where(distances <= limit, np.maximum(distances, 0.0), np.inf)


class _Triangles:
    """Triangles above the plane perpendicular to the line.

    Args:
        corners: (K, 3 corners, 3) corners.
    """

    def __init__(self, corners: Array) -> None:
        self._x, self._y = corners[:, 0, 0], corners[:, 0, 1]
        (self._ax, self._ay, az), (self._bx, self._by, bz) = (
            (corners[:, k] - corners[:, 0]).T for k in (1, 2)
        )
        self._twice_area = self._ax * self._by - self._ay * self._bx
        rise = np.array([az * self._by - bz * self._ay, self._ax * bz - self._bx * az])
        self.normal = np.ones((len(corners), 3))
        """(K, 3) normals of the triangles' planes, 1 along z."""
        self.normal[:, :2] = -(rise / self._twice_area).T

    def barycentric_coordinates(self, x: Array | float, y: Array | float) -> Array:
        """(K, 3) barycentric coordinates of points x (K,), y (K,) in the perpendicular plane."""
        x, y = x - self._x, y - self._y
        share = np.empty((len(self._x), 3))
        share[:, 1] = (x * self._by - y * self._bx) / self._twice_area
        share[:, 2] = (self._ax * y - self._ay * x) / self._twice_area
        share[:, 0] = 1.0 - share[:, 1] - share[:, 2]
        return share


def _leaving_point(fall: Array, share: Array) -> Indices:
    """Indices (K,) of the simplex points to replace by a new point with coordinates `fall` (K, 3):
    the first point whose share falls to 0 while the share of the new point rises."""
    falls = fall > 1e-9
    ratio = np.where(falls, share / np.where(falls, fall, 1.0), np.inf)
    return np.asarray(ratio.argmin(axis=1))
