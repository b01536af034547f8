"""Views of a scene: camera poses with their intrinsics, and settings for drawing them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.core import (
    Array,
    FieldError,
    InvalidInputError,
    Pose,
    Ranges,
    check_pose,
    make_pose,
    require_ascending,
    require_ranges,
    rot_z,
    rotation_from_quaternion,
)

DEFAULT_DEPTH_RANGE = (0.05, 5.0)
"""Nearest and farthest depth in metres of a camera that does not state them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A camera at a pose.

    Attributes:
        camera: origin of the view: a camera of the station, `sphere` or `wrist`.
        intrinsics: size, focal lengths, principal point (OpenCV's: pixel centres at integers) and
            distortion.
        X_SC: (4, 4) pose of the optical frame in the scene frame: z forward, x right, y down.
        depth_range: nearest and farthest depth that the camera measures [m].
        posture: (n,) joint positions of the station's arm [rad]; no robot in the scene if None.

    Raises:
        InvalidInputError: the depth range is not positive and rising, the pose is invalid, or the
            camera is a fisheye, whose field of view Drake's cameras cannot cover.
    """

    camera: str
    intrinsics: Intrinsics
    X_SC: Array
    depth_range: tuple[float, float] = DEFAULT_DEPTH_RANGE
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


def set_posture(joints: Sequence[Any], context: Any, posture: Sequence[float]) -> None:
    """Moves an arm to the posture of a view.

    Args:
        joints: Drake's revolute joints of the arm.
        context: context of the plant.
        posture: (n,) joint positions [rad].

    Raises:
        InvalidInputError: the numbers of joints and positions differ.
    """
    if len(posture) != len(joints):
        raise InvalidInputError(
            f"the view has joint positions of {len(posture)} joints; the arm has {len(joints)}"
        )
    for joint, position in zip(joints, posture, strict=True):
        joint.set_angle(context, position)


SPHERE_CAMERA = "sphere"  # Reserved name of the camera on a sphere around the scene.
WRIST_CAMERA = "wrist"  # Reserved name of the camera on the hand.


Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class ViewpointSettings:
    """How views of a scene are drawn.

    A view looks at a point near the mean of the objects' centres.

    Attributes:
        cameras: cameras, each with the same probability: `sphere` (around the scene), `wrist` (on
            the hand), or names of cameras of the station.
        distance: smallest and largest distance of the camera from the point it looks at [m].
        elevation_deg: smallest and largest angle of the camera above the board [degrees].
        azimuth_deg: smallest and largest angle of the camera about the vertical, from the board's x
            axis, counter-clockwise from above [degrees].
        aim: largest distance of the point looked at from the scene's middle [m].
        roll_deg: smallest and largest angle about the optical axis [degrees]; at 0 rows of the
            image are level.
        position_jitter: largest distance of the station's cameras from their places [m].
        angle_jitter_deg: largest turn of the station's cameras about a random axis [degrees].
        X_HC: pose of the wrist camera in the hand's frame; beside the hand, looking along the
            fingers, if null.
        in_view: smallest share of the objects whose centres a view has to show, 0 to 1. One is
            always shown.
        draws: number of drafts of a view until it is given up.

    Raises:
        FieldError: a value is out of its range, a range falls, or there is no camera.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "aim": (0.0, 100.0),
        "position_jitter": (0.0, 100.0),
        "angle_jitter_deg": (0.0, 180.0),
        "in_view": (0.0, 1.0),
        "draws": (1, 100_000),
        "distance": (1e-3, 100.0),
        "elevation_deg": (-90.0, 90.0),
        "azimuth_deg": (-360.0, 360.0),
        "roll_deg": (-360.0, 360.0),
    }

    cameras: tuple[str, ...] = (SPHERE_CAMERA,)
    distance: Range = (0.5, 1.0)
    elevation_deg: Range = (25.0, 75.0)
    azimuth_deg: Range = (-180.0, 180.0)
    aim: float = 0.08
    roll_deg: Range = (-10.0, 10.0)
    position_jitter: float = 0.0
    angle_jitter_deg: float = 0.0
    X_HC: Pose | None = None
    in_view: float = 0.0
    draws: int = 200

    def __post_init__(self) -> None:
        if not self.cameras:
            raise FieldError(
                f"cameras is empty; give {SPHERE_CAMERA!r}, {WRIST_CAMERA!r} or cameras of the"
                " station",
                "cameras",
            )
        require_ranges(self)
        require_ascending(self)


def camera_looking_at(
    p_ST: Array, distance: float, elevation: float, azimuth: float, roll: float = 0.0
) -> Array:
    """`X_SC` (4, 4) of a camera that looks at a point.

    Args:
        p_ST: (3,) the point [m].
        distance: distance of the camera from the point [m].
        elevation: angle of the camera above the horizontal plane through the point [rad].
        azimuth: azimuth of the camera, from x, counter-clockwise about z [rad].
        roll: rotation about the optical axis [rad]; at 0 the camera's x axis is level.
    """
    (se, ce), (sa, ca) = ((np.sin(a), np.cos(a)) for a in (elevation, azimuth))
    outward = np.array([ce * ca, ce * sa, se])
    right = np.array([-sa, ca, 0.0])
    R_SC = np.stack([right, np.cross(-outward, right), -outward], axis=1) @ rot_z(roll)
    return make_pose(R_SC, p_ST + distance * outward)


def draw_camera_on_sphere(
    settings: ViewpointSettings, p_SM: Array, rng: np.random.Generator
) -> Array:
    """Draws `X_SC` (4, 4) of a camera on a sphere around a point near the scene's middle `p_SM`
    (3,), uniformly over the part of the sphere that the settings allow."""
    low, high = np.sin(np.deg2rad(settings.elevation_deg))
    elevation = np.arcsin(np.clip(rng.uniform(low, high), -1.0, 1.0))
    azimuth, roll = np.deg2rad(
        [rng.uniform(*settings.azimuth_deg), rng.uniform(*settings.roll_deg)]
    )
    distance = rng.uniform(*settings.distance)
    p_ST = p_SM + draw_in_ball(settings.aim, rng)
    return camera_looking_at(p_ST, distance, float(elevation), float(azimuth), float(roll))


def jitter_camera(X_SC: Array, settings: ViewpointSettings, rng: np.random.Generator) -> Array:
    """Adds random translation and rotation to a camera pose (4, 4), by the settings' jitter."""
    offset = draw_in_ball(settings.position_jitter, rng)
    half = 0.5 * np.deg2rad(rng.uniform(0.0, settings.angle_jitter_deg))
    axis = _draw_direction(rng)
    if not settings.position_jitter and not settings.angle_jitter_deg:
        return X_SC
    turn = rotation_from_quaternion([np.cos(half), *(np.sin(half) * axis)])
    return make_pose(X_SC[:3, :3] @ turn, X_SC[:3, 3] + offset)


def draw_in_ball(radius: float, rng: np.random.Generator) -> Array:
    """Draws a point (3,) in a ball around the origin [m]."""
    return radius * float(np.cbrt(rng.random())) * _draw_direction(rng)


def _draw_direction(rng: np.random.Generator) -> Array:
    """Draws a unit vector (3,)."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))
