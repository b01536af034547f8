"""Solids as fields: functions that are negative inside, and near the surface close to the distance.

A field maps points (N, 3) [m] to values (N,) [m]. Smooth unions and cuts give the fillets that make
a robot link look cast instead of assembled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

Field = Callable[[np.ndarray], np.ndarray]
Vector = Sequence[float] | np.ndarray

GRADIENT_STEP = 1.0e-5
"""Half step of central differences [m]."""


def capsule(start: Vector, end: Vector, radius: float) -> Field:
    """Points within `radius` of a segment."""
    a, ab = np.asarray(start, float), np.subtract(end, start)

    def field(p: np.ndarray) -> np.ndarray:
        t = np.clip((p - a) @ ab / (ab @ ab), 0.0, 1.0)
        return np.linalg.norm(p - a - t[:, None] * ab, axis=1) - radius

    return field


def sphere(centre: Vector, radius: float) -> Field:
    """Points within `radius` of a centre."""
    c = np.asarray(centre, float)
    return lambda p: np.linalg.norm(p - c, axis=1) - radius


def half_space(normal: Vector, offset: float) -> Field:
    """Points whose component along `normal` is at most `offset`."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    return lambda p: p @ n - offset


def cylinder(
    centre: Vector,
    axis: Vector,
    radius: float,
    low: float,
    high: float,
    rounding: float = 0.0,
    taper: float = 0.0,
) -> Field:
    """Cylinder from `low` to `high` along `axis` from `centre`, with rounded rims.

    Args:
        centre: a point of the axis [m].
        axis: direction of the axis.
        radius: at the centre [m].
        low, high: ends along the axis [m].
        rounding: radius of the rims [m].
        taper: gain of radius for each metre along the axis [-].
    """
    c = np.asarray(centre, float)
    n = np.asarray(axis, float) / np.linalg.norm(axis)

    def field(p: np.ndarray) -> np.ndarray:
        along = (p - c) @ n
        radial = np.linalg.norm(p - c - along[:, None] * n, axis=1) - taper * along
        outside = radial - radius + rounding
        ends = np.maximum(low - along, along - high) + rounding
        edge = np.hypot(np.maximum(outside, 0.0), np.maximum(ends, 0.0))
        return edge + np.minimum(np.maximum(outside, ends), 0.0) - rounding

    return field


def box(
    centre: Vector, half: Vector, rounding: float = 0.0, rotation: np.ndarray | None = None
) -> Field:
    """Box with half sizes `half` [m] and rounded edges; `rotation` (3, 3) turns it."""
    c, h = np.asarray(centre, float), np.asarray(half, float) - rounding
    R = np.eye(3) if rotation is None else rotation

    def field(p: np.ndarray) -> np.ndarray:
        q = np.abs((p - c) @ R) - h
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return outside + np.minimum(q.max(axis=1), 0.0) - rounding

    return field


def prism(
    polygon: Sequence[tuple[float, float]],
    plane: tuple[int, int],
    low: float,
    high: float,
    corner: float = 0.0,
    rim: float = 0.0,
) -> Field:
    """Polygon drawn in two coordinates, extruded along the third.

    Args:
        polygon: corners (u, v) [m], either way round, not necessarily convex.
        plane: the coordinates (0 to 2) that u and v are.
        low, high: ends along the third coordinate [m].
        corner: radius of the corners of the polygon [m]; the polygon shrinks by it first.
        rim: radius of the rims at both ends [m].
    """
    corners = np.asarray(polygon, float)
    third = 3 - plane[0] - plane[1]

    def field(p: np.ndarray) -> np.ndarray:
        flat = _polygon_distance(p[:, plane], corners)
        if corner:
            # Offsetting inwards and out again rounds convex corners.
            flat = _polygon_distance(p[:, plane], _shrunk(corners, corner)) - corner
        outside = flat + rim
        ends = np.maximum(low - p[:, third], p[:, third] - high) + rim
        edge = np.hypot(np.maximum(outside, 0.0), np.maximum(ends, 0.0))
        return edge + np.minimum(np.maximum(outside, ends), 0.0) - rim

    return field


def _polygon_distance(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Signed distance (N,) of points (N, 2) to a polygon (K, 2), negative inside."""
    square = np.full(len(p), np.inf)
    inside = np.zeros(len(p), dtype=bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        square = np.minimum(square, ((p - a - t[:, None] * (b - a)) ** 2).sum(axis=1))
        if a[1] != b[1]:
            crossing = a[0] + (p[:, 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
            inside ^= ((a[1] > p[:, 1]) != (b[1] > p[:, 1])) & (p[:, 0] < crossing)
    return np.where(inside, -1.0, 1.0) * np.sqrt(square)


def _shrunk(corners: np.ndarray, depth: float) -> np.ndarray:
    """The polygon with each side moved inwards by `depth` [m]."""
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    turn = np.sign(np.sum(corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]))
    along0 = (corners - before) / np.linalg.norm(corners - before, axis=1, keepdims=True)
    along1 = (after - corners) / np.linalg.norm(after - corners, axis=1, keepdims=True)
    inward = turn * np.stack([-along0[:, 1] - along1[:, 1], along0[:, 0] + along1[:, 0]], axis=1)
    return corners + depth * inward / (1.0 + (along0 * along1).sum(axis=1))[:, None]


def domed(drum: Field, tip: Vector, axis: Vector, radius: float, blend: float) -> Field:
    """A drum whose end at `tip` (outward `axis`) is a dome: part of a sphere of `radius` [m]."""
    centre = np.asarray(tip, float) - radius * np.asarray(axis, float)
    return meet(drum, capsule(centre, centre - np.asarray(axis, float), radius), blend)


def join(a: Field, b: Field, blend: float | Callable[[np.ndarray], np.ndarray]) -> Field:
    """Smooth union; `blend` is the width of the fillet [m], a constant or a function of p."""

    def field(p: np.ndarray) -> np.ndarray:
        k = blend(p) if callable(blend) else blend
        fa, fb = a(p), b(p)
        overlap = np.maximum(k - np.abs(fa - fb), 0.0) / k
        return np.minimum(fa, fb) - overlap**2 * k / 4.0

    return field


def meet(a: Field, b: Field, blend: float) -> Field:
    """Smooth intersection with edges rounded over `blend` [m]."""
    smooth = join(inverse(a), inverse(b), blend)
    return lambda p: -smooth(p)


def inverse(a: Field) -> Field:
    """The outside of a field."""
    return lambda p: -a(p)


def inset(a: Field, depth: float) -> Field:
    """The solid that lies `depth` [m] below the surface of a field."""
    return lambda p: a(p) + depth


def gradient(a: Field, points: np.ndarray) -> np.ndarray:
    """Gradient (N, 3) [-] by central differences."""
    columns = [
        (a(points + axis) - a(points - axis)) / (2 * GRADIENT_STEP)
        for axis in np.eye(3) * GRADIENT_STEP
    ]
    return np.stack(columns, axis=1)
