"""Outlines on the board: what an object covers as seen from above, with a margin around it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, transform_points

MARGIN = 0.004
"""Between an object and the outline around it [m]."""
CORNER = 6
"""Points of an outline's rounded corner."""


def footprint(p_OV: Array, X_SO: Array, height: float, margin: float = MARGIN) -> Array:
    """The outline of an object's convex hull from above.

    Args:
        p_OV: (N, 3) vertices of the object [m].
        X_SO: (4, 4) its pose.
        height: z of the outline in S [m].
        margin: by which it is larger than the object [m].

    Returns:
        (M, 2, 3) segments of a closed line in S [m].
    """
    p_SV = transform_points(X_SO, p_OV)[:, :2]
    around = np.linspace(0.0, 2.0 * np.pi, 4 * CORNER, endpoint=False)
    disc = margin * np.stack([np.cos(around), np.sin(around)], axis=-1)
    points = (_hull(p_SV)[:, None] + disc).reshape(-1, 2)
    line = _hull(points)
    line = np.column_stack([line, np.full(len(line), height)])
    return np.stack([line, np.roll(line, -1, axis=0)], axis=1)


def _hull(points: Array) -> Array:
    """(M, 2) corners of a planar hull, counter-clockwise; all points where it is flat."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points
