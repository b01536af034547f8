"""Convex polygons in the plane: the footprints of objects on the board."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull

from burg_drake.core import Array

_DIRECTION_ANGLES = 2.0 * np.pi * np.arange(64) / 64  # Radians, all around.
SUPPORT_DIRECTIONS = np.column_stack([np.cos(_DIRECTION_ANGLES), np.sin(_DIRECTION_ANGLES)])
"""(64, 2) unit vectors all around."""


PolygonSides = tuple[Array, Array, Array]
"""The lowest corner (2,) of a polygon, the left one of two [m]; its sides (N, 2) from there on [m];
and the direction (N,) of each, from 0 to 2 pi [rad]."""


def next_vertices(corners: Array) -> Array:
    """The corner (N, ...) after each, around a polygon."""
    return np.concatenate((corners[1:], corners[:1]))


def previous_vertices(corners: Array) -> Array:
    """The corner (N, ...) before each, around a polygon."""
    return np.concatenate((corners[-1:], corners[:-1]))


def convex_polygon(points: Array) -> Array:
    """Corners (M, 2) of the convex hull of points (N, 2), which must span an area [m]."""
    return np.asarray(points[ConvexHull(points).vertices])


def rotate_polygon(polygon: Array, angle: float) -> Array:
    """A polygon turned counter-clockwise about the origin by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = polygon[:, 0], polygon[:, 1]
    around = np.empty_like(polygon)
    around[:, 0], around[:, 1] = c * x - s * y, s * x + c * y
    return around


def polygon_area(polygon: Array) -> float:
    """Area [m^2], by the shoelace formula."""
    x, y = polygon[:, 0], polygon[:, 1]
    return float(np.sum(x * next_vertices(y) - y * next_vertices(x)) / 2.0)


def no_fit_polygon(still: Array, moving: Array) -> Array:
    """No-fit polygon: the origins at which a moving polygon overlaps a fixed one.

    Args:
        still: (N, 2) corners of the fixed polygon.
        moving: (M, 2) corners relative to the moving polygon's origin.

    Returns:
        The Minkowski difference (K, 2). The polygons touch if the origin is on its edge, and are as
        far apart as the origin is from it.
    """
    return _merge_sides(_polygon_sides(still), _polygon_sides(-moving))


def _polygon_sides(polygon: Array) -> PolygonSides:
    first = int(np.lexsort((polygon[:, 0], polygon[:, 1]))[0])
    corners = np.concatenate((polygon[first:], polygon[:first]))
    along = next_vertices(corners) - corners
    return corners[0], along, np.arctan2(along[:, 1], along[:, 0]) % (2.0 * np.pi)


def _merge_sides(still: PolygonSides, opposite: PolygonSides) -> Array:
    """The Minkowski sum (K, 2) of two polygons."""
    start, along, heading = still
    other_start, other_along, other_heading = opposite
    order = np.argsort(np.concatenate((heading, other_heading)), kind="stable")
    sides = np.concatenate((along, other_along))[order]
    return np.asarray(start + other_start + np.cumsum(sides, axis=0) - sides)


def support_area(reach: Array) -> Array:
    """Areas (...) of the polygons between lines that are evenly spread around the origin.

    Args:
        reach: (..., K) largest `direction . point` of a shape along K directions, such as those of
            `SUPPORT_DIRECTIONS`. The result is slightly above the area of its convex hull [m^2].
    """
    step = 2.0 * np.pi / reach.shape[-1]
    before, after = np.roll(reach, 1, axis=-1), np.roll(reach, -1, axis=-1)
    side = (before + after - 2.0 * np.cos(step) * reach) / np.sin(step)
    return np.asarray((reach * side).sum(axis=-1) / 2.0)


def simplify_polygon(polygon: Array, max_excess: float) -> Array:
    """Simplifies a polygon to an enclosing one with fewer corners: short sides are removed, and
    their neighbours extended until they meet.

    Args:
        polygon: (N, 2) corners.
        max_excess: largest distance by which it may reach beyond a removed side [m].
    """
    while len(polygon) > 3:
        ends = next_vertices(polygon)
        into, along = polygon - previous_vertices(polygon), ends - polygon
        out = next_vertices(ends) - ends
        turn = _cross(into, out)
        with np.errstate(divide="ignore", invalid="ignore"):
            tip = polygon + (_cross(along, out) / turn)[:, None] * into
            beyond = -_cross(along, tip - polygon) / np.hypot(along[:, 0], along[:, 1])
        beyond = np.where((turn > 0.0) & (beyond >= 0.0), beyond, np.inf)
        k = int(beyond.argmin())
        if beyond[k] > max_excess:
            break
        polygon = polygon.copy()
        polygon[k] = tip[k]
        polygon = np.delete(polygon, (k + 1) % len(polygon), axis=0)
    return polygon


def distances_from_polygon(polygon: Array, points: Array) -> Array:
    """Distances (M,) of points (M, 2) from a polygon [m], negative inside."""
    side, beside = _distances_and_feet(polygon, points)
    inside = (side <= 0.0).all(axis=1)
    return np.asarray(np.where(inside, side.max(axis=1), np.hypot(side, beside).min(axis=1)))


def exit_distance(polygon: Array, origin: Array, direction: Array) -> float:
    """Distance from a point (2,) inside a polygon to its edge along a unit direction (2,)."""
    along, to_corner = next_vertices(polygon) - polygon, polygon - origin
    speed = along[:, 1] * direction[0] - along[:, 0] * direction[1]
    room = along[:, 1] * to_corner[:, 0] - along[:, 0] * to_corner[:, 1]
    outward = speed > 0.0
    return float((room[outward] / speed[outward]).min())


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _distances_and_feet(polygon: Array, points: Array) -> tuple[Array, Array]:
    """Distances of points (M, 2) outside the edges' lines of a polygon (N, 2), and beyond the
    edges' ends along the lines; both (M, N) [m]."""
    along = next_vertices(polygon) - polygon
    length = np.hypot(along[:, 0], along[:, 1])
    along = along / length[:, None]
    away = points[:, None] - polygon
    t = away[..., 0] * along[:, 0] + away[..., 1] * along[:, 1]
    side = away[..., 0] * along[:, 1] - away[..., 1] * along[:, 0]
    return side, t - np.clip(t, 0.0, length)


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex polygon. Derived properties are computed on first use.

    Attributes:
        corners: (N, 2) corners, counter-clockwise [m].
    """

    corners: Array

    @cached_property
    def low(self) -> Array:
        """Lower corner (2,) of the bounding box."""
        return np.asarray(self.corners.min(axis=0))

    @cached_property
    def high(self) -> Array:
        """Upper corner (2,) of the bounding box."""
        return np.asarray(self.corners.max(axis=0))

    @cached_property
    def middle(self) -> Array:
        """Mean (2,) of the corners."""
        return np.asarray(self.corners.mean(axis=0))

    @cached_property
    def support_values(self) -> Array:
        """(K,) largest `direction . corner` along `SUPPORT_DIRECTIONS` [m]."""
        return np.asarray((self.corners @ SUPPORT_DIRECTIONS.T).max(axis=0))

    @cached_property
    def _sides(self) -> PolygonSides:
        return _polygon_sides(self.corners)

    @cached_property
    def _opposite_sides(self) -> PolygonSides:
        """Sides of the polygon after half a turn about the origin."""
        return _polygon_sides(-self.corners)

    def no_fit_polygon(self, moving: Footprint) -> Array:
        """No-fit polygon of a moving footprint around this one; see the function of this name."""
        return _merge_sides(self._sides, moving._opposite_sides)
