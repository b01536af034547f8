"""Intrinsics of `sensor_msgs/CameraInfo`, of ROS 1 and ROS 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from burg_drake.cameras.optics import (
    HALF_PIXEL,
    ROS_FISHEYE,
    ROS_MODELS,
    Intrinsics,
    is_ros_fisheye,
)
from burg_drake.core import InvalidInputError


def intrinsics_of(message: Any, *, rectified: bool = False) -> Intrinsics:
    """Intrinsics of the images that come with a `camera_info`.

    K and P are those of the full sensor; the images may be a part of it (`roi`), with pixels
    merged (`binning_x`, `binning_y`). A merged pixel's centre is the centre of what it was merged
    from, which `image_geometry` leaves out: (b - 1) / 2b pixels for b pixels a side.

    Args:
        message: `sensor_msgs/CameraInfo`; its matrices are K, D, P in ROS 1, k, d, p in ROS 2.
        rectified: the images are those of `image_rect`: P instead of K, no distortion. The baseline
            of a stereo camera in P is left out, so that poses are those of the camera itself.

    Raises:
        InvalidInputError: the camera is not calibrated, or has another model of its lens.
    """
    matrix = _field(message, "P" if rectified else "K")
    columns = 4 if rectified else 3
    fx, skew, cx = (float(v) for v in matrix[:3])
    fy, cy = float(matrix[columns + 1]), float(matrix[columns + 2])
    distortion = () if rectified else _distortion(message)
    if not np.isfinite([fx, fy, cx, cy, skew, *distortion]).all():
        raise InvalidInputError("camera_info has numbers that are not finite; calibrate the camera")
    if min(fx, fy) <= 0.0:
        raise InvalidInputError(
            f"camera_info has {'P' if rectified else 'K'} = 0, so the camera is not calibrated;"
            " calibrate it, or give its intrinsics as a file"
        ).about("intrinsics")
    if skew:
        raise InvalidInputError(
            f"camera_info has skew {skew:g}, which is not supported; calibrate the camera without"
            " skew"
        )
    fisheye = not rectified and is_ros_fisheye(message.distortion_model, distortion)
    region = message.roi
    merged_x, merged_y = max(message.binning_x, 1), max(message.binning_y, 1)
    return Intrinsics(
        camera=message.header.frame_id,
        width=(region.width or message.width) // merged_x,
        height=(region.height or message.height) // merged_y,
        focal=(fx / merged_x, fy / merged_y),
        center=(
            (cx - region.x_offset + HALF_PIXEL) / merged_x - HALF_PIXEL,
            (cy - region.y_offset + HALF_PIXEL) / merged_y - HALF_PIXEL,
        ),
        model="fisheye" if fisheye else "perspective",
        distortion=distortion,
    )


def _distortion(message: Any) -> tuple[float, ...]:
    coefficients = tuple(float(v) for v in _field(message, "D"))
    if not any(coefficients) and not is_ros_fisheye(message.distortion_model, coefficients):
        return ()
    if message.distortion_model not in ROS_MODELS:
        raise InvalidInputError(
            f"camera_info has the distortion model {message.distortion_model!r}; supported are"
            f" plumb_bob, rational_polynomial and {ROS_FISHEYE}: rectify the images (image_proc)"
            " and start the node for rectified ones"
        ).about("rectified")
    return coefficients


def _field(message: Any, name: str) -> Sequence[float]:
    values: Sequence[float] = getattr(message, name if hasattr(message, name) else name.lower())
    return values
