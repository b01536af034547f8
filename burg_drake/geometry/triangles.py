"""Distances of points from triangles."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array


def triangle_distances(points: Array, triangles: Array) -> Array:
    """Distances [m] of points (..., 1, 3) to triangles (..., K, 3, 3), as (..., K)."""
    a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
    squared = np.minimum.reduce([_to_segment(points, p, q) for p, q in ((a, b), (b, c), (c, a))])
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal * normal).sum(axis=-1))
    inside = length > 0.0
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(q - p, points - p) * normal).sum(axis=-1) >= 0.0
    height = ((points - a) * normal).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    return np.where(inside, np.abs(height), np.sqrt(squared))


def _to_segment(points: Array, start: Array, end: Array) -> Array:
    """Squared distances of points to segments."""
    along = end - start
    square = np.maximum((along * along).sum(axis=-1), 1e-300)
    at = np.clip(((points - start) * along).sum(axis=-1) / square, 0.0, 1.0)
    apart = points - start - at[..., None] * along
    return (apart * apart).sum(axis=-1)
