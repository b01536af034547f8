"""Where a fixed camera stands: from what it sees of the board, for the station document.

The station says where the board lies and images say where the camera is over it:
`X_WC = X_WS @ X_SC`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.pose.estimate import BoardEstimate
from burg_drake.core import Array, InvalidInputError, make_pose, rotation_angle
from burg_drake.core.documents import Pose
from burg_drake.station.document import Camera, StationLike, as_station

APART = 0.005, np.deg2rad(0.5)
"""Images of one fixed camera whose poses differ by more [m, rad] are of a camera or board that was
moved: ten times what an estimate is off with half of the markers hidden."""


@dataclass(frozen=True, eq=False)
class LocatedCamera:
    """A camera of a station, located.

    Attributes:
        camera: to be written into the station document; a pinhole camera, even if the real one
            has lens distortion.
        X_WC: (4, 4) its pose, unrounded.
        apart: largest distance [m] and angle [rad] between it and the pose of a single image.
    """

    camera: Camera
    X_WC: Array
    apart: tuple[float, float]


def locate_camera(
    station: StationLike, estimates: Sequence[BoardEstimate], intrinsics: Intrinsics
) -> LocatedCamera:
    """Places a camera that did not move between its images.

    Args:
        station: says where the board lies.
        estimates: of each image; those that are not valid are left out.
        intrinsics: of the camera.

    Raises:
        InvalidInputError: no estimate is valid, or they are of different places.
    """
    station = as_station(station)
    X_SC = np.array([e.X_SC for e in estimates if e.valid]).reshape(-1, 4, 4)
    if not len(X_SC):
        reasons = "; ".join(dict.fromkeys(e.reason for e in estimates)) or "there is no image"
        raise InvalidInputError(f"the camera cannot be located: {reasons}")
    R_mean = Rotation.from_matrix(X_SC[:, :3, :3]).mean().as_matrix()
    X_mean = make_pose(R_mean, X_SC[:, :3, 3].mean(axis=0))
    distance = float(np.linalg.norm(X_SC[:, :3, 3] - X_mean[:3, 3], axis=1).max())
    angle = float(np.max(rotation_angle(R_mean.T @ X_SC[:, :3, :3])))
    if distance > APART[0] or angle > APART[1]:
        raise InvalidInputError(
            f"the camera poses of the images are up to {1e3 * distance:.1f} mm and"
            f" {np.rad2deg(angle):.2f} degrees from their mean, so the camera or the board moved;"
            " give images from one place"
        )
    X_WC = station.document.X_WS.matrix() @ X_mean
    camera = Camera(
        X_WC=_rounded(X_WC),
        width=intrinsics.width,
        height=intrinsics.height,
        focal=intrinsics.focal,
        center=intrinsics.center,
    )
    return LocatedCamera(camera, X_WC, (distance, angle))


def _rounded(X_WC: Array) -> Pose:
    """To a hundredth of a millimetre and a thousandth of a degree."""
    pose = Pose.from_matrix(X_WC)
    assert pose.rpy_deg is not None
    (x, y, z), (roll, pitch, yaw) = pose.translation, pose.rpy_deg
    return Pose(
        (round(x, 5), round(y, 5), round(z, 5)),
        rpy_deg=(round(roll, 3), round(pitch, 3), round(yaw, 3)),
    )
