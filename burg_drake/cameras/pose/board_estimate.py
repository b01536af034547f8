"""The estimated pose of a camera over the board, and the location of a fixed station camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.core import Array, InvalidInputError, Pose, make_pose, rotation_angle
from burg_drake.station import Camera, StationLike, as_station


@dataclass(frozen=True, eq=False, kw_only=True)
class BoardEstimate:
    """The pose of a camera over the board, from one image.

    Attributes:
        X_SC: (4, 4) camera's optical frame in the scene frame; NaN unless `valid`.
        valid: the pose can be used.
        reason: one line that says why the pose is missing or doubtful, else empty.
        reprojection_error: root mean square reprojection error of the markers' corners [pixels].
        covariance: (6, 6) of a small rotation [rad], then translation [m], both in S, from the true
            to the estimated pose: `R_SC = exp(rotation) R_true`, `p_SC = p_true + translation`.
        ids: ids of the markers that were used.
        corners: (N, 4, 2) measured corners of these markers [pixels].
        scale: size of the printed board relative to the document, if measured (from depth, or a
            known camera pose); NaN otherwise.
    """

    X_SC: Array = field(default_factory=lambda: np.full((4, 4), np.nan))
    valid: bool = False
    reason: str = ""
    reprojection_error: float = float("nan")
    covariance: Array = field(default_factory=lambda: np.full((6, 6), np.nan))
    ids: tuple[int, ...] = ()
    corners: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    scale: float = float("nan")


@dataclass(frozen=True, eq=False)
class LocatedCamera:
    """The measured pose of a station's camera.

    Attributes:
        camera: entry for the station document; a pinhole camera, even if the real one has lens
            distortion.
        X_WC: (4, 4) pose of the camera, unrounded.
        apart: largest distance [m] and angle [rad] from the pose of a single image.
    """

    camera: Camera
    X_WC: Array
    apart: tuple[float, float]


def locate_camera(
    station: StationLike, estimates: Sequence[BoardEstimate], intrinsics: Intrinsics
) -> LocatedCamera:
    """Locates a fixed camera from several images.

    Args:
        station: station with the pose of the board.
        estimates: one per image; invalid ones are ignored.
        intrinsics: of the camera.

    Raises:
        InvalidInputError: no estimate is valid, or the poses differ.
    """
    # Metres and radians; larger means that the camera or the board was moved.
    max_difference = 0.005, np.deg2rad(0.5)
    station = as_station(station)
    X_SC = np.array([e.X_SC for e in estimates if e.valid]).reshape(-1, 4, 4)
    if not len(X_SC):
        reasons = "; ".join(dict.fromkeys(e.reason for e in estimates)) or "there is no image"
        raise InvalidInputError(f"the camera cannot be located: {reasons}")
    R_mean = Rotation.from_matrix(X_SC[:, :3, :3]).mean().as_matrix()
    X_mean = make_pose(R_mean, X_SC[:, :3, 3].mean(axis=0))
    distance = float(np.linalg.norm(X_SC[:, :3, 3] - X_mean[:3, 3], axis=1).max())
    angle = float(np.max(rotation_angle(R_mean.T @ X_SC[:, :3, :3])))
    if distance > max_difference[0] or angle > max_difference[1]:
        raise InvalidInputError(
            f"the camera poses of the images are up to {1e3 * distance:.1f} mm and"
            f" {np.rad2deg(angle):.2f} degrees from their mean, so the camera or the board moved;"
            " give images from one place"
        )
    X_WC = station.document.X_WS.matrix() @ X_mean
    camera = Camera(
        X_WC=_round_pose(X_WC),
        width=intrinsics.width,
        height=intrinsics.height,
        focal=intrinsics.focal,
        center=intrinsics.center,
    )
    return LocatedCamera(camera, X_WC, (distance, angle))


def _round_pose(X_WC: Array) -> Pose:
    """Rounds a pose to a hundredth of a millimetre and a thousandth of a degree."""
    pose = Pose.from_matrix(X_WC)
    assert pose.rpy_deg is not None
    (x, y, z), (roll, pitch, yaw) = pose.translation, pose.rpy_deg
    return Pose(
        (round(x, 5), round(y, 5), round(z, 5)),
        rpy_deg=(round(roll, 3), round(pitch, 3), round(yaw, 3)),
    )
