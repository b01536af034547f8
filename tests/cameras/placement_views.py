"""Cameras and displacements for tests of the placement check."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras import Intrinsics, PinholeView
from burg_drake.core import Array, make_pose

INTRINSICS = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))


def looking(p_SC: Array, p_ST: Array) -> Array:
    """(4, 4) X_SC of a camera that looks from one point at another, upright."""
    z = (p_ST - p_SC) / np.linalg.norm(p_ST - p_SC)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return make_pose(np.stack([x, np.cross(z, x), z], axis=1), p_SC)


X_SC = looking(np.array([0.85, 0.62, 0.58]), np.array([0.297, 0.21, 0.03]))
VIEW = PinholeView(INTRINSICS.K, (640, 480), X_SC)
NOTHING = np.full((480, 640), np.inf)
"""Depth of other objects where there are none."""
