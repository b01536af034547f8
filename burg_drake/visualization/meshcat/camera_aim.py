"""Where Meshcat's eye goes so that all there is to see is in view.

Everything fits into views that are `VIEW_ASPECT` times as wide as high, or wider. Saved pages zoom
out in narrower ones, see `visualization.page`; the live view cannot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Meshcat

from burg_drake.core import Array
from burg_drake.visualization.meshcat.portrait import fit_camera

VIEW_ASPECT = 1.2
"""Width over height of the narrowest view into which everything fits: a window of 1280 x 800 less a
panel."""
FIELD_OF_VIEW_DEG = 45.0
"""Vertical angle of view."""
FILL = 0.94
"""Share of the view that is filled."""


def aim_at(
    meshcat: Meshcat,
    p_WQ: ArrayLike,
    forward: ArrayLike,
    *,
    field_of_view_deg: float = FIELD_OF_VIEW_DEG,
) -> Array:
    """Looks from as near as lets all points be in view; the eye turns about their middle.

    Args:
        meshcat: whose camera to set.
        p_WQ: (N, 3) points [m].
        forward: (3,) direction in the world in which to look; not vertical.
        field_of_view_deg: vertical angle of view.

    Returns:
        (3, 3) `R_WC` of the camera: x to the right, y down, z forward.
    """
    points = np.asarray(p_WQ, dtype=float).reshape(-1, 3)
    R_WC = looking(forward)
    vertical = np.tan(np.deg2rad(field_of_view_deg) / 2.0)
    p_WC = fit_camera(points, R_WC, FILL * vertical * np.array([VIEW_ASPECT, 1.0]))
    along = (points - p_WC) @ R_WC[:, 2]
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", field_of_view_deg)
    meshcat.SetCameraPose(p_WC, p_WC + R_WC[:, 2] * (along.min() + along.max()) / 2.0)
    return R_WC


def looking(forward: ArrayLike) -> Array:
    """(3, 3) `R_WC` of an upright camera that looks in a direction (3,), which is not vertical."""
    z = np.asarray(forward, dtype=float)
    z = z / np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=-1)
