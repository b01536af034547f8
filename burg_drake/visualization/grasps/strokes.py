"""Grasps as strokes of a drawing: two fingers, a palm and a stem each, as in the 3D views."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, transform_points
from burg_drake.visualization.grasps.mesh import FINGER_LENGTH, STEM_LENGTH
from burg_drake.visualization.pictures import FlatView, path_data


def grasp_corners(X_WG: Array, width: Array) -> Array:
    """(N, 6, 3) corners of grasps in the world [m]: tip, knuckle, knuckle and tip of the fork, then
    both ends of the stem.

    Args:
        X_WG: (N, 4, 4) grasps.
        width: (N,) distance between the fingers [m].
    """
    half = np.asarray(width, dtype=float)[:, None] / 2.0
    x = half * np.array([1.0, 1.0, -1.0, -1.0, 0.0, 0.0])
    palm, stem = -FINGER_LENGTH, -FINGER_LENGTH - STEM_LENGTH
    z = np.broadcast_to([0.0, palm, palm, 0.0, palm, stem], x.shape)
    p_GQ = np.stack([x, np.zeros_like(x), z], axis=-1)
    return transform_points(np.asarray(X_WG).reshape(-1, 4, 4), p_GQ)


def grasp_strokes(corners: Array, view: FlatView) -> list[str]:
    """The `d` of one path a grasp, from `grasp_corners` (N, 6, 3)."""
    return [
        path_data(fork, closed=False) + path_data(stem, closed=False)
        for fork, stem in ((places[:4], places[4:]) for places in view.places(corners))
    ]
