"""Pixels of image messages; tests/ros/test_ros1.py has those that cv_bridge made."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.cameras import encode_jpeg
from burg_drake.core import InvalidInputError
from burg_drake.ros import IMAGE_ENCODINGS, decode_image_message

RGB = np.random.default_rng(5).integers(0, 256, (4, 6, 3), dtype=np.uint8)
OPAQUE = np.full((4, 6, 1), 255, np.uint8)
GRAY = RGB[..., 0]
COLOR = (200, 100, 50)

LAID_OUT = {
    "rgb8": RGB,
    "bgr8": RGB[..., ::-1],
    "8UC3": RGB[..., ::-1],
    "rgba8": np.concatenate([RGB, OPAQUE], axis=2),
    "bgra8": np.concatenate([RGB[..., ::-1], OPAQUE], axis=2),
    "8UC4": np.concatenate([RGB[..., ::-1], OPAQUE], axis=2),
}
MOSAICS = {"rggb": "RGGB", "bggr": "BGGR", "gbrg": "GBRG", "grbg": "GRBG"}


def mosaic(pattern: str) -> np.ndarray:
    """What a sensor behind colour filters says of one colour: rows of R G and G B, and so on."""
    values = dict(zip("RGB", COLOR, strict=True))
    cell = np.array([values[letter] for letter in pattern], np.uint8).reshape(2, 2)
    return np.tile(cell, (4, 5))


@pytest.mark.parametrize("encoding", LAID_OUT)
def test_colours_come_in_their_order(encoding: str, image_message: Callable[..., Any]) -> None:
    message = image_message(np.ascontiguousarray(LAID_OUT[encoding]).tobytes(), (4, 6), encoding)
    assert (decode_image_message(message) == RGB).all()


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_gray(encoding: str, image_message: Callable[..., Any]) -> None:
    image = decode_image_message(image_message(GRAY.tobytes(), (4, 6), encoding))
    assert (image == GRAY[..., None]).all() and image.shape == (4, 6, 3)


@pytest.mark.parametrize(("order", "big"), [("<", 0), (">", 1)])
def test_16_bits_in_either_order_of_bytes(
    order: str, big: int, image_message: Callable[..., Any]
) -> None:
    wide = (GRAY.astype(np.uint16) << 8 | 0x21).astype(f"{order}u2")
    image = decode_image_message(image_message(wide.tobytes(), (4, 6), "mono16", is_bigendian=big))
    assert (image == GRAY[..., None]).all()


@pytest.mark.parametrize("name", MOSAICS)
def test_mosaic_of_one_colour(name: str, image_message: Callable[..., Any]) -> None:
    image = decode_image_message(
        image_message(mosaic(MOSAICS[name]).tobytes(), (8, 10), f"bayer_{name}8")
    )
    assert image.shape == (8, 10, 3) and (image == COLOR).all()


@pytest.mark.parametrize(
    ("encoding", "order"),
    [("yuv422", "UYVY"), ("uyvy", "UYVY"), ("yuv422_yuy2", "YUYV"), ("yuyv", "YUYV")],
)
def test_yuv_of_one_colour(encoding: str, order: str, image_message: Callable[..., Any]) -> None:
    r, g, b = (value / 255.0 for value in COLOR)
    luma = 0.299 * r + 0.587 * g + 0.114 * b  # ITU-R BT.601, studio range
    values = {
        "Y": 16 + 219 * luma,
        "U": 128 + 224 * (b - luma) / 1.772,
        "V": 128 + 224 * (r - luma) / 1.402,
    }
    cell = np.array([round(values[letter]) for letter in order], np.uint8)
    image = decode_image_message(image_message(np.tile(cell, (4, 3)).tobytes(), (4, 6), encoding))
    assert np.abs(image.astype(int) - COLOR).max() <= 2


@pytest.mark.parametrize("encoding", IMAGE_ENCODINGS)
def test_rows_may_be_padded(encoding: str, image_message: Callable[..., Any]) -> None:
    entry = IMAGE_ENCODINGS[encoding]
    row = 6 * entry.channels * np.dtype(entry.dtype).itemsize
    data = np.random.default_rng(2).integers(0, 256, (4, row), dtype=np.uint8)
    padded = np.pad(data, ((0, 0), (0, 7)), constant_values=9)
    plain = decode_image_message(image_message(data.tobytes(), (4, 6), encoding))
    assert (decode_image_message(image_message(padded.tobytes(), (4, 6), encoding)) == plain).all()


def test_the_image_is_the_callers_own(image_message: Callable[..., Any]) -> None:
    data = bytearray(RGB.tobytes())
    image = decode_image_message(image_message(data, (4, 6), "rgb8"))
    data[:] = bytes(len(data))
    image += 1
    assert (image == RGB + 1).all()


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"step": 17}, "damaged: 72 bytes in rows of 17 are not 6 x 4 pixels of rgb8"),
        ({"data": RGB.tobytes()[:-1]}, "damaged: 71 bytes in rows of 18"),
        ({"height": 0}, "are not 6 x 0 pixels"),
        ({"encoding": "32FC1"}, "encoding '32FC1' is not supported; .*bgr8.*rgb8"),
    ],
)
def test_what_cannot_be_read(
    fields: dict[str, Any], text: str, image_message: Callable[..., Any]
) -> None:
    message = image_message(RGB.tobytes(), (4, 6), "rgb8")
    vars(message).update(fields)
    with pytest.raises(InvalidInputError, match=text):
        decode_image_message(message)


def test_colours_in_pairs_of_pixels_need_pairs(image_message: Callable[..., Any]) -> None:
    with pytest.raises(InvalidInputError, match="1 x 1 pixels cannot have encoding yuyv"):
        decode_image_message(image_message(bytes(2), (1, 1), "yuyv"))


def test_compressed() -> None:
    _, octets = cv2.imencode(".png", RGB[..., ::-1])
    message = SimpleNamespace(format="rgb8; png compressed bgr8", data=octets.tobytes())
    assert (decode_image_message(message) == RGB).all()


@pytest.mark.parametrize(
    ("form", "data", "text"),
    [
        ("jpeg", b"", "damaged: its 0 bytes cannot be decoded as 'jpeg'"),
        ("jpeg", b"no picture", "damaged: its 10 bytes cannot be decoded as 'jpeg'"),
        ("16UC1; compressedDepth png", b"x", "depth images"),
    ],
)
def test_what_is_not_a_compressed_image(form: str, data: bytes, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        decode_image_message(SimpleNamespace(format=form, data=data))


def test_jpeg_keeps_the_order_of_colours() -> None:
    image = np.full((16, 16, 3), COLOR, np.uint8)
    decoded = decode_image_message(SimpleNamespace(format="jpeg", data=encode_jpeg(image, 95)))
    assert np.abs(decoded.astype(int) - COLOR).max() <= 4
