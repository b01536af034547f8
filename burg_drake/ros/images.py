"""Pixels of `sensor_msgs/Image` and `sensor_msgs/CompressedImage`, of ROS 1 and ROS 2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.sources import decode_image
from burg_drake.core import InvalidInputError, listing


@dataclass(frozen=True)
class Encoding:
    """How an encoding lays out a pixel.

    Attributes:
        channels: numbers a pixel.
        dtype: of the numbers.
        to_rgb: OpenCV's name of the conversion, without `COLOR_`; none is needed if empty.
    """

    channels: int
    to_rgb: str
    dtype: str = "u1"


ENCODINGS = {
    "rgb8": Encoding(3, ""),
    "bgr8": Encoding(3, "BGR2RGB"),
    "8UC3": Encoding(3, "BGR2RGB"),
    "rgba8": Encoding(4, "RGBA2RGB"),
    "bgra8": Encoding(4, "BGRA2RGB"),
    "8UC4": Encoding(4, "BGRA2RGB"),
    "mono8": Encoding(1, "GRAY2RGB"),
    "8UC1": Encoding(1, "GRAY2RGB"),
    "mono16": Encoding(1, "GRAY2RGB", "u2"),
    "bayer_rggb8": Encoding(1, "BayerRGGB2RGB"),
    "bayer_bggr8": Encoding(1, "BayerBGGR2RGB"),
    "bayer_gbrg8": Encoding(1, "BayerGBRG2RGB"),
    "bayer_grbg8": Encoding(1, "BayerGRBG2RGB"),
    "yuv422": Encoding(2, "YUV2RGB_UYVY"),
    "uyvy": Encoding(2, "YUV2RGB_UYVY"),
    "yuv422_yuy2": Encoding(2, "YUV2RGB_YUYV"),
    "yuyv": Encoding(2, "YUV2RGB_YUYV"),
}
"""By their names in `sensor_msgs/image_encodings.h` (`uyvy` and `yuyv` are those of ROS 2). What is
only a type of OpenCV's (`8UC3`) has its order of colours, blue first."""


def pixels(message: Any) -> NDArray[np.uint8]:
    """Image of a message.

    Args:
        message: `sensor_msgs/Image`, or `sensor_msgs/CompressedImage` (JPEG, PNG, ...).

    Returns:
        (H, W, 3) RGB, the caller's own. 16 bits are cut to their upper 8.

    Raises:
        InvalidInputError: the encoding is none of `ENCODINGS`, or the data are damaged.
    """
    return _raw(message) if hasattr(message, "encoding") else _compressed(message)


def _raw(message: Any) -> NDArray[np.uint8]:
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        raise InvalidInputError(
            f"the image encoding {message.encoding!r} is not supported; supported are"
            f" {listing(sorted(ENCODINGS))}"
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


def _compressed(message: Any) -> NDArray[np.uint8]:
    if "compressedDepth" in message.format:
        raise InvalidInputError("the topic publishes depth images; give a topic of colour images")
    data = bytes(message.data)
    image = decode_image(data) if data else None
    if image is None:
        raise InvalidInputError(
            f"the image is damaged: its {len(data)} bytes cannot be decoded as {message.format!r}"
        )
    return image


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """An (H, W, 3) RGB image as JPEG."""
    _, octets = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    return bytes(octets.tobytes())
