"""From where, and with what camera, a scene is looked at."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, InvalidInputError, check_pose

DEPTH_RANGE = (0.05, 5.0)
"""Depths that a camera measures if nothing else is known [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A camera at its place.

    Attributes:
        camera: what it was made from: a camera of the station, `sphere` or `wrist`.
        intrinsics: size, focal lengths, principal point (OpenCV's: pixel centres at integers) and
            distortion.
        X_SC: (4, 4) optical frame in the scene frame: z forward, x right, y down.
        depth_range: nearest and farthest depth that is measured [m]; there is none outside of it.
        posture: (n,) joint positions of the station's arm, which is in view then [rad]; no robot
            if None.

    Raises:
        InvalidInputError: the depth range does not rise from above 0, the pose is none, or the
            camera is a fisheye, which sees what no image of Drake's cameras shows.
    """

    camera: str
    intrinsics: Intrinsics
    X_SC: Array
    depth_range: tuple[float, float] = DEPTH_RANGE
    posture: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        check_pose(self.X_SC, "X_SC")
        if self.intrinsics.is_fisheye:
            raise InvalidInputError(
                f"camera {self.camera} of a view is a fisheye, which cannot be rendered; give a"
                " perspective model"
            )
        near, far = self.depth_range
        if not 0.0 < near < far:
            raise InvalidInputError(
                f"depth range of a view is {near:g} to {far:g} m; it must start above 0 and end"
                " above its start"
            )
