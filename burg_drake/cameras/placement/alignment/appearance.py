"""Whether an object has the colors of its mesh, in whatever light: tells apart which way round a
slender object lies, and objects that stand on each other's places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.pinhole import PinholeView, sample_nearest
from burg_drake.cameras.placement.alignment.shape import TargetShape
from burg_drake.core import Array

RAYS = 1200
"""About how many pixels of an object are compared."""
TONE = 0.08
"""Difference of tones, red, green and blue over their sum, at which they are half alike: stray
light, lamps that are not white, and JPEG's coarse colors make up to as much."""
DARK = 0.03
"""Light below which a tone says little, as a share of paper's."""


def likeness(
    view: PinholeView, shape: TargetShape, q: Array, others: Array, light: NDArray[np.float32]
) -> float:
    """How alike the tones of a displaced object and of its mesh are, from 0 to 1.

    Args:
        view: the camera.
        shape: the object.
        q: (3,) its displacement.
        others: (H, W) depth of other objects.
        light: (H, W, 3) of the photo over that of paper.

    Returns:
        A mean over what is seen of it; 0.5 if its mesh has no colors, or nothing is seen.
    """
    if shape.colors is None:
        return 0.5
    window = view.window(shape, q, 0.0)
    pitch = max(1.0, float(np.sqrt(window.width * window.height / RAYS)))
    at = window.scaled(1.0 / pitch).pixels()
    face, depth = view.hits(shape, q, at)
    seen = np.isfinite(depth) & (depth < sample_nearest(others, at, np.inf))
    if seen.sum() < 10:
        return 0.5
    column, row = np.round(at[seen]).astype(int).T
    height, width = light.shape[:2]
    r = light[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(float)
    known = shape.colors[face[seen]]
    total, expected = r.sum(axis=1, keepdims=True), known.sum(axis=1, keepdims=True)
    off = np.linalg.norm(r / np.maximum(total, 1e-3) - known / np.maximum(expected, 1e-3), axis=1)
    weight = np.clip(np.minimum(total, expected)[:, 0] / (3 * DARK), 0.05, 1.0)
    return float((weight / (1.0 + (off / TONE) ** 2)).sum() / weight.sum())
