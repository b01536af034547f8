"""Where a pointer is in the scene, by the camera of the page that it belongs to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import (
    Array,
    inverse,
    make_pose,
    rotation_from_quaternion,
    transform_points,
)

MIN_RAY_SLOPE = 0.02
"""Sine of the least angle between a ray and a plane; a flatter one would hit it anywhere."""
MAX_DRAG_DISTANCE = 20.0
"""From the camera to a point that a pointer may drag to [m]."""


@dataclass(frozen=True, eq=False)
class PageCamera:
    """The camera of a page.

    Attributes:
        X_SC: (4, 4) camera in the scene: z forward, x right, y down.
        fov: vertical angle of view [rad].
        aspect: width over height.
    """

    X_SC: Array
    fov: float
    aspect: float

    @classmethod
    def of(cls, camera: Any) -> PageCamera:
        """That of a viser client's `camera`."""
        X_SC = make_pose(rotation_from_quaternion(camera.wxyz), camera.position)
        return cls(X_SC, float(camera.fov), float(camera.aspect))

    def on_plane(self, p_SQ: ArrayLike, p_SP: ArrayLike, normal_S: ArrayLike) -> Array | None:
        """Where the ray from the camera through Q meets a plane.

        Args:
            p_SQ: (3,) a point that is seen at the pointer [m].
            p_SP: (3,) a point of the plane [m].
            normal_S: (3,) unit normal of the plane.

        Returns:
            (3,) the point [m]; None where the ray grazes the plane or goes away from it.
        """
        eye = self.X_SC[:3, 3]
        ray = np.asarray(p_SQ, dtype=float) - eye
        length = float(np.linalg.norm(ray))
        if length == 0.0:
            return None
        ray /= length
        slope = float(ray @ np.asarray(normal_S, dtype=float))
        if abs(slope) < MIN_RAY_SLOPE:
            return None
        distance = float((np.asarray(p_SP) - eye) @ np.asarray(normal_S)) / slope
        return eye + distance * ray if 0.0 < distance <= MAX_DRAG_DISTANCE else None

    def on_screen(self, p_SQ: ArrayLike) -> Array:
        """(N, 2) where points (N, 3) are seen: 0 to 1 from left to right and from top to bottom.

        NaN for those behind the camera.
        """
        p_CQ = transform_points(inverse(self.X_SC), np.atleast_2d(np.asarray(p_SQ, dtype=float)))
        depth = np.where(p_CQ[:, 2] > 0.0, p_CQ[:, 2], np.nan)
        half = np.tan(self.fov / 2.0)
        x = p_CQ[:, 0] / depth / (half * self.aspect)
        y = p_CQ[:, 1] / depth / half
        return 0.5 + 0.5 * np.stack([x, y], axis=-1)
