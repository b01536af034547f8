"""Exact solids with crisp edges: rods, plates, rounded hulls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold

from tools.robot_model.fields import Vector

SEGMENTS = 64
"""Segments of a full circle."""


def rod(start: Vector, axis: Vector, radius: float, length: float, bevel: float = 0.0) -> Manifold:
    """Cylinder from `start` along `axis`; `bevel` [m] cuts the rim at the far end."""
    n = np.asarray(axis, float) / np.linalg.norm(axis)
    u = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
    u /= np.linalg.norm(u)
    body = Manifold.cylinder(length - bevel, radius, circular_segments=SEGMENTS)
    if bevel:
        rim = Manifold.cylinder(bevel, radius, radius - bevel, circular_segments=SEGMENTS)
        body = body + rim.translate((0.0, 0.0, length - bevel))
    return body.transform(np.column_stack([u, np.cross(n, u), n, np.asarray(start, float)]))


def plate(
    polygon: Sequence[tuple[float, float]],
    plane: tuple[int, int],
    low: float,
    high: float,
    corner: float = 0.0,
    bevel: float = 0.0,
) -> Manifold:
    """Polygon drawn in two coordinates, extruded along the third.

    Args:
        polygon: corners (u, v) [m].
        plane: the coordinates (0 to 2) that u and v are.
        low, high: ends along the third coordinate [m].
        corner: radius of the corners [m].
        bevel: cut of the rims at both ends [m]; for convex polygons only.
    """
    outline = CrossSection([polygon], FillRule.NonZero)
    if corner:
        outline = _offset(_offset(outline, -corner), corner)
    body = outline.extrude(high - low - 2 * bevel).translate((0.0, 0.0, low + bevel))
    if bevel:
        body = Manifold.batch_hull(
            [body, _offset(outline, -bevel).extrude(high - low).translate((0.0, 0.0, low))]
        )
    third = 3 - plane[0] - plane[1]
    frame = np.zeros((3, 4))
    frame[plane[0], 0] = frame[plane[1], 1] = frame[third, 2] = 1.0
    return body.transform(frame)


def rounded_hull(points: Sequence[Sequence[float]], radius: float) -> Manifold:
    """Convex hull of spheres of `radius` [m] about the points (N, 3)."""
    ball = Manifold.sphere(radius, circular_segments=16)
    return Manifold.batch_hull([ball.translate(tuple(p)) for p in points])


def _offset(outline: CrossSection, distance: float) -> CrossSection:
    """Outline moved outwards by `distance` [m], outer corners round."""
    return outline.offset(distance, JoinType.Round, circular_segments=SEGMENTS // 2)
