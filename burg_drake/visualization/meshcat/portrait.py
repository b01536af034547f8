"""How an object is turned and where the camera goes so that it looks well in a picture.

The camera stands in front, at -y, and looks down by an elevation; its frame C has x to the right
and z forward.
"""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.core import Array, rot_z
from burg_drake.objects.library import UPRIGHT_TOLERANCE, ObjectEntry

YAWS = np.deg2rad(np.arange(0.0, 360.0, 15.0))
"""Ways to turn an object about the vertical for its picture [rad]."""

YAW_COST = 0.03
"""Share of the silhouette that a half turn away from the object's own frame must gain."""


def upright(entry: ObjectEntry) -> Array:
    """(3, 3) `R_WO` of a standing object: in its own frame if it can, else in its first pose."""
    if not entry.stable_poses:
        return np.eye(3)
    R_SO = entry.X_SO(entry.proposed_pose)[:3, :3]
    return np.eye(3) if R_SO[2, 2] >= np.cos(UPRIGHT_TOLERANCE) else R_SO


def best_yaw(points: Array, R_WC: Array) -> float:
    """Angle [rad] to turn points (N, 3) about z so that they show most of themselves to a camera.

    Args:
        points: corners of the convex hull, say, in the world.
        R_WC: (3, 3) camera.
    """
    scores = []
    for yaw in YAWS:
        seen = (points @ rot_z(yaw).T) @ R_WC[:, :2]
        area = cv2.contourArea(cv2.convexHull(seen.astype(np.float32)))
        turn = abs((yaw + np.pi) % (2 * np.pi) - np.pi) / np.pi
        scores.append(area * (1.0 - YAW_COST * turn))
    return float(YAWS[int(np.argmax(scores))])


def camera_rotation(elevation: float) -> Array:
    """(3, 3) `R_WC` of a camera in front that looks down by `elevation` [rad]."""
    c, s = np.cos(elevation), np.sin(elevation)
    return np.array([[1.0, 0.0, 0.0], [0.0, -s, c], [0.0, -c, -s]])


def fit_camera(points: Array, R_WC: Array, half_view: Array) -> Array:
    """The nearest place (3,) of a camera from which points are in the picture, and in its middle.

    Args:
        points: (N, 3) in the world [m].
        R_WC: (3, 3) camera.
        half_view: (2,) tangents of half the angle of view that the points may fill, horizontal
            and vertical.

    Returns:
        `p_WC` [m].
    """
    x, y, z = (np.asarray(points) @ R_WC).T
    distance = -np.inf
    for u, t in ((x, half_view[0]), (y, half_view[1])):
        right, left = (u - t * z).max(), (-u - t * z).max()
        distance = max(distance, (right + left) / (2.0 * t))
    center = np.empty(2)
    for k, u in enumerate((x, y)):
        # where the outermost rays to either side have opposite slopes
        low, high = u.min(), u.max()
        for _ in range(40):
            center[k] = (low + high) / 2.0
            slope = (u - center[k]) / (z + distance)
            low, high = (center[k], high) if slope.max() > -slope.min() else (low, center[k])
    return R_WC @ np.array([*center, -distance])
