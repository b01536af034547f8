"""Soft shadows painted below objects: Drake's renderer would take three times as long for them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

SUN = np.array([0.30, 0.25, -1.0])
"""Direction of the light that casts the painted shadow."""
SHADOW_STRENGTH, CONTACT_STRENGTH = 0.22, 0.30
SHADOW_BLUR, CONTACT_BLUR = 0.022, 0.010
"""The cast shadow, and the narrow one beneath: darkness, and blur as a share of the height."""
SHADOW_FADE = 0.10
"""Towards the picture's borders the shadow fades, over this share of the height."""


def painted_shadow(
    hulls: Sequence[Array], X_WC: Array, focal: float, size: NDArray[np.int64]
) -> Array:
    """Light left on a ground at z = 0 under convex pieces, as a factor (H, W) in [0, 1].

    Args:
        hulls: (N, 3) corners of each in the world [m].
        X_WC: (4, 4) camera.
        focal: focal length [pixel].
        size: (2,) width and height [pixel].
    """
    light = np.ones((size[1], size[0]), dtype=np.float32)
    for direction, strength, blur in (
        (SUN, SHADOW_STRENGTH, SHADOW_BLUR),
        (np.array([0.0, 0.0, -1.0]), CONTACT_STRENGTH, CONTACT_BLUR),
    ):
        dark = np.zeros_like(light)
        for hull in hulls:
            ground = hull + direction * hull[:, 2:]
            x, y, z = ((ground - X_WC[:3, 3]) @ X_WC[:3, :3]).T
            corners = np.stack([x, y], axis=1) / z[:, None] * focal + size / 2.0
            cv2.fillConvexPoly(dark, cv2.convexHull(np.round(corners).astype(np.int32)), strength)
        light *= 1.0 - cv2.GaussianBlur(dark, (0, 0), blur * float(size[1]))
    edge = SHADOW_FADE * float(size[1])
    columns, rows = (np.minimum(np.arange(n) + 0.5, n - np.arange(n) - 0.5) for n in size)
    fade = np.clip(np.minimum(columns[None, :], rows[:, None]) / edge, 0.0, 1.0)
    return 1.0 - (1.0 - light) * fade
