"""Cameras of suites."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from burg_drake.benchmark.settings import Conditions
from burg_drake.core import FieldError, Pose, require_name, setting

if TYPE_CHECKING:
    from burg_drake.benchmark.observing import SceneCamera
    from burg_drake.scene import Board


@dataclass(frozen=True, kw_only=True)
class SuiteCamera:
    """A depth camera at a fixed place.

    Attributes:
        name: name of the camera.
        X_SC: pose of the optical frame in the scene frame: z forward, x right, y down.
        sensor: name of the depth camera, whose intrinsics, depth range and noise it has.
        size: width and height of its images [pixels]; the usual ones of the sensor if left out.
        noise: whether depth has the sensor's noise.
        color: whether it takes colour images, which need a renderer.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    name: str = "front"
    X_SC: Pose
    sensor: str = "d435"
    size: tuple[int, int] | None = None
    noise: bool = True
    color: bool = True

    def __post_init__(self) -> None:
        from burg_drake.cameras import sensor

        require_name(self.name, "name")
        if not sensor(self.sensor).depth_camera(self.size).is_pinhole:
            raise FieldError(
                f"images of sensor {self.sensor!r} have lens distortion, which planners are not"
                " told of; choose another sensor",
                "sensor",
            )

    def scene_camera(self, conditions: Conditions | None = None) -> SceneCamera:
        """The camera, with the figures of its sensor.

        Args:
            conditions: how noise and pose differ from them.
        """
        from burg_drake.benchmark.observing import SceneCamera
        from burg_drake.cameras import depth_noise, sensor

        preset, conditions = sensor(self.sensor), conditions or Conditions()
        return SceneCamera(
            intrinsics=preset.depth_camera(self.size),
            X_SC=self.X_SC.matrix(),
            depth_range=preset.depth_range,
            noise=depth_noise(self.sensor).scaled(conditions.depth_noise) if self.noise else None,
            color=self.color,
            shift=conditions.camera_shift,
            turn=conditions.camera_turn,
            name=self.name,
        )


@dataclass(frozen=True, kw_only=True)
class CameraPlacement:
    """A camera that looks at the middle of the board.

    Attributes:
        sensor: see `SuiteCamera`.
        distance: distance of the camera from the point it looks at [m].
        elevation_deg: angle of the camera above the board [degrees].
        azimuth_deg: angle of the camera about the vertical, from the board's x axis,
            counter-clockwise from above [degrees]; -90 looks from the lower edge of the sheet.
        exact_depth: whether depth has no noise.
    """

    sensor: str = setting("d435", "depth camera: d435, d455, zivid_two, kinect", metavar="NAME")
    distance: float = setting(0.75, "distance from the board's middle", metavar="M", above=0)
    elevation_deg: float = setting(60.0, "angle above the board", metavar="DEG", low=0, high=90)
    azimuth_deg: float = setting(
        -90.0, "direction of the camera; -90: from the sheet's lower edge", metavar="DEG"
    )
    exact_depth: bool = setting(False, "no noise of the depth")

    def camera(self, board: Board) -> SuiteCamera:
        """The camera for scenes on a board."""
        from burg_drake.dataset import camera_looking_at

        width, height = board.size
        X_SC = camera_looking_at(
            np.array([width / 2.0, height / 2.0, 0.03]),
            self.distance,
            math.radians(self.elevation_deg),
            math.radians(self.azimuth_deg),
        )
        return SuiteCamera(X_SC=Pose.readable(X_SC), sensor=self.sensor, noise=not self.exact_depth)
