"""Read images and intrinsics from `sensor_msgs` messages of ROS 1 and ROS 2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from burg_drake.cameras import (
    ROS_FISHEYE_MODEL,
    ROS_LENS_MODELS,
    Intrinsics,
    decode_image,
    is_ros_fisheye,
)
from burg_drake.core import Bytes, InvalidInputError, list_names
from burg_drake.station import HALF_PIXEL


@dataclass(frozen=True)
class PixelEncoding:
    """Memory layout of a pixel.

    Attributes:
        channels: numbers per pixel.
        to_rgb: OpenCV's name of the conversion to RGB, without `COLOR_`; empty if none is needed.
        dtype: type of the numbers.
    """

    channels: int
    to_rgb: str
    dtype: str = "u1"


IMAGE_ENCODINGS = {
    "rgb8": PixelEncoding(3, ""),
    "bgr8": PixelEncoding(3, "BGR2RGB"),
    "8UC3": PixelEncoding(3, "BGR2RGB"),
    "rgba8": PixelEncoding(4, "RGBA2RGB"),
    "bgra8": PixelEncoding(4, "BGRA2RGB"),
    "8UC4": PixelEncoding(4, "BGRA2RGB"),
    "mono8": PixelEncoding(1, "GRAY2RGB"),
    "8UC1": PixelEncoding(1, "GRAY2RGB"),
    "mono16": PixelEncoding(1, "GRAY2RGB", "u2"),
    "bayer_rggb8": PixelEncoding(1, "BayerRGGB2RGB"),
    "bayer_bggr8": PixelEncoding(1, "BayerBGGR2RGB"),
    "bayer_gbrg8": PixelEncoding(1, "BayerGBRG2RGB"),
    "bayer_grbg8": PixelEncoding(1, "BayerGRBG2RGB"),
    "yuv422": PixelEncoding(2, "YUV2RGB_UYVY"),
    "uyvy": PixelEncoding(2, "YUV2RGB_UYVY"),
    "yuv422_yuy2": PixelEncoding(2, "YUV2RGB_YUYV"),
    "yuyv": PixelEncoding(2, "YUV2RGB_YUYV"),
}
"""Encodings of `sensor_msgs/image_encodings.h`; OpenCV types such as 8UC3 hold BGR."""


def decode_image_message(message: Any) -> Bytes:
    """Decodes the image of a message.

    Args:
        message: `sensor_msgs/Image`, or `sensor_msgs/CompressedImage` (JPEG, PNG, ...).

    Returns:
        (H, W, 3) RGB, a new array. 16-bit values keep their upper 8 bits.

    Raises:
        InvalidInputError: the encoding is not in `IMAGE_ENCODINGS`, or the data are damaged.
    """
    return _decode_raw(message) if hasattr(message, "encoding") else _decode_compressed(message)


def _decode_raw(message: Any) -> Bytes:
    encoding = IMAGE_ENCODINGS.get(message.encoding)
    if encoding is None:
        raise InvalidInputError(
            f"the image encoding {message.encoding!r} is not supported; supported are"
            f" {list_names(sorted(IMAGE_ENCODINGS))}"
        )
    height, width, step = message.height, message.width, message.step
    dtype = np.dtype(encoding.dtype).newbyteorder(">" if message.is_bigendian else "<")
    row = width * encoding.channels * dtype.itemsize
    octets = np.frombuffer(message.data, np.uint8)
    if min(height, width) < 1 or step < row or len(octets) < height * step:
        raise InvalidInputError(
            f"the image is damaged: {len(octets)} bytes in rows of {step} are not {width} x"
            f" {height} pixels of {message.encoding}"
        )
    rows = np.ascontiguousarray(octets[: height * step].reshape(height, step)[:, :row])
    values = rows.view(dtype).reshape(height, width, encoding.channels)
    if dtype.itemsize > 1:
        values = (values >> 8).astype(np.uint8)
    if not encoding.to_rgb:
        return values.copy()
    try:
        return np.asarray(cv2.cvtColor(values, getattr(cv2, f"COLOR_{encoding.to_rgb}")))
    except cv2.error as error:
        raise InvalidInputError(
            f"an image of {width} x {height} pixels cannot have encoding {message.encoding}:"
            f" {error.err}"
        ) from error


def _decode_compressed(message: Any) -> Bytes:
    if "compressedDepth" in message.format:
        raise InvalidInputError("the topic publishes depth images; give a topic of colour images")
    data = bytes(message.data)
    image = decode_image(data) if data else None
    if image is None:
        raise InvalidInputError(
            f"the image is damaged: its {len(data)} bytes cannot be decoded as {message.format!r}"
        )
    return image


def intrinsics_from_camera_info(message: Any, *, rectified: bool = False) -> Intrinsics:
    """Reads the intrinsics of a `camera_info` message.

    K and P are of the full sensor; the images may be cropped (`roi`) and binned (`binning_x`,
    `binning_y`). A binned pixel's centre is the centre of its sensor pixels, which `image_geometry`
    ignores: (b - 1) / 2b pixels for b pixels per side.

    Args:
        message: `sensor_msgs/CameraInfo`; its matrices are K, D, P in ROS 1, k, d, p in ROS 2.
        rectified: whether the images are from `image_rect`: then P is used instead of K, and no
            distortion. A stereo baseline in P is ignored, so that poses are of the camera itself.

    Raises:
        InvalidInputError: the camera is not calibrated, or its lens model is not supported.
    """
    matrix = _read_field(message, "P" if rectified else "K")
    columns = 4 if rectified else 3
    fx, skew, cx = (float(v) for v in matrix[:3])
    fy, cy = float(matrix[columns + 1]), float(matrix[columns + 2])
    distortion = () if rectified else _read_distortion(message)
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


def _read_distortion(message: Any) -> tuple[float, ...]:
    coefficients = tuple(float(v) for v in _read_field(message, "D"))
    if not any(coefficients) and not is_ros_fisheye(message.distortion_model, coefficients):
        return ()
    if message.distortion_model not in ROS_LENS_MODELS:
        raise InvalidInputError(
            f"camera_info has the distortion model {message.distortion_model!r}; supported are"
            f" plumb_bob, rational_polynomial and {ROS_FISHEYE_MODEL}: rectify the images"
            " (image_proc) and start the node for rectified ones"
        ).about("rectified")
    return coefficients


def _read_field(message: Any, name: str) -> Sequence[float]:
    values: Sequence[float] = getattr(message, name if hasattr(message, name) else name.lower())
    return values
