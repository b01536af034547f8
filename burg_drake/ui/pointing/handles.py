"""Handles of the gizmo as bodies in the scene: which one a pointer is on, and what it does then.

The browser lets a pointer take hold of whatever is nearest to the camera, although it draws handles
over everything. What is asked here is which handle is drawn under the pointer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, make_pose
from burg_drake.ui.pointing.centers import motion_about
from burg_drake.ui.pointing.pointer import MIN_RAY_SLOPE, PageCamera

GIZMO_SIZE = 0.11
"""Length of the arrows [m]; that of rings and squares follows, as in drei's PivotControls."""
HALF_WIDTH = 0.07 * GIZMO_SIZE
"""By which a pointer may miss an arrow or a ring [m]."""
ARROW_START = 0.2 * GIZMO_SIZE
"""From the middle of an object to where its arrows count [m]; nearer, the object itself does."""
RING_RADIUS = 0.65 * GIZMO_SIZE
SQUARE = (0.13 * GIZMO_SIZE, 0.355 * GIZMO_SIZE)
"""From where to where a square reaches along both of its axes [m]."""


@dataclass(frozen=True, eq=False)
class Handle:
    """A part of the gizmo.

    Attributes:
        kind: an arrow moves along an axis, a square across it, and a ring turns about it.
        X_SG: (4, 4) pose of the gizmo.
        axis: 0, 1 or 2.
    """

    kind: Literal["arrow", "square", "ring"]
    X_SG: Array
    axis: int

    def distance(self, camera: PageCamera, p_SQ: Array) -> float | None:
        """From the camera to where the ray through Q meets the handle [m]; None if it does not.

        Args:
            camera: of the page.
            p_SQ: (3,) a point that is seen at the pointer [m].
        """
        eye = camera.X_SC[:3, 3]
        if self.kind == "arrow":
            along = self._along(camera, p_SQ)
            if along is None:
                return None
            p_SA = self._origin + np.clip(along, ARROW_START, GIZMO_SIZE) * self._direction
            ray = (p_SQ - eye) / np.linalg.norm(p_SQ - eye)
            distance = float((p_SA - eye) @ ray)
            near = float(np.linalg.norm(eye + distance * ray - p_SA)) <= HALF_WIDTH
            return distance if near and distance > 0.0 else None
        p_SP = camera.on_plane(p_SQ, self._origin, self._direction)
        if p_SP is None:
            return None
        across = np.delete(self.X_SG[:3, :3].T @ (p_SP - self._origin), self.axis)
        if self.kind == "square":
            hit = bool(((across >= SQUARE[0]) & (across <= SQUARE[1])).all())
        else:
            far = abs(float(np.linalg.norm(across)) - RING_RADIUS)
            hit = far <= HALF_WIDTH and bool((across >= 0.0).all())
        return float(np.linalg.norm(p_SP - eye)) if hit else None

    def motion(self, camera: PageCamera, p_SQ: Array, p_SQ_now: Array) -> Array | None:
        """(4, 4) motion in S of what is held, as the pointer went from Q to where it is now.

        Args:
            camera: of the page.
            p_SQ, p_SQ_now: (3,) points that are seen at the pointer then and now [m].

        Returns:
            None where the pointer says nothing, as the view is along the handle.
        """
        if self.kind == "arrow":
            then, now = self._along(camera, p_SQ), self._along(camera, p_SQ_now)
            if then is None or now is None:
                return None
            return make_pose(p_AB=(now - then) * self._direction)
        ends = [camera.on_plane(p, self._origin, self._direction) for p in (p_SQ, p_SQ_now)]
        if ends[0] is None or ends[1] is None:
            return None
        if self.kind == "square":
            return make_pose(p_AB=ends[1] - ends[0])
        a, b = ends[0] - self._origin, ends[1] - self._origin
        angle = float(np.arctan2(np.cross(a, b) @ self._direction, a @ b))
        R = Rotation.from_rotvec(angle * self._direction).as_matrix()
        return motion_about(self._origin, R, np.zeros(3))

    @property
    def _origin(self) -> Array:
        return np.asarray(self.X_SG[:3, 3])

    @property
    def _direction(self) -> Array:
        return np.asarray(self.X_SG[:3, self.axis])

    def _along(self, camera: PageCamera, p_SQ: Array) -> float | None:
        """Where the axis comes nearest to the ray through Q [m from the origin]; None if the view
        is along the axis."""
        eye, axis = camera.X_SC[:3, 3], self._direction
        ray = (p_SQ - eye) / np.linalg.norm(p_SQ - eye)
        slope = float(ray @ axis)
        if 1.0 - slope**2 < MIN_RAY_SLOPE:
            return None
        between = self._origin - eye
        return float((slope * (between @ ray) - between @ axis) / (1.0 - slope**2))


def handle_under(handles: Iterable[Handle], camera: PageCamera, p_SQ: Array) -> Handle | None:
    """The handle nearest to the camera of those that are drawn at a pointer, if any is.

    Args:
        handles: that are shown.
        camera: of the page.
        p_SQ: (3,) a point that is seen at the pointer [m].
    """
    found = [(handle.distance(camera, p_SQ), handle) for handle in handles]
    hit = [(distance, handle) for distance, handle in found if distance is not None]
    return min(hit, key=lambda pair: pair[0])[1] if hit else None
