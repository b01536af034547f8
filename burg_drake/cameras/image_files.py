"""Read and write colour and depth images."""

from __future__ import annotations

import contextlib
import io
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import PIL.Image
from numpy.typing import NDArray

from burg_drake.cameras.frame_source import Image
from burg_drake.core import (
    READ_ERRORS,
    FileLimits,
    InvalidInputError,
    Single,
    atomic_write,
    open_npy,
    read_bytes,
)
from burg_drake.station import MAX_IMAGE_SIDE


@contextlib.contextmanager
def silence_opencv() -> Iterator[None]:
    """Stops OpenCV and FFmpeg from writing errors to the terminal; errors are raised instead."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # read when FFmpeg is first used
    log = getattr(cv2.utils, "logging", cv2)  # has the log functions in OpenCV 5; cv2 in OpenCV 4
    level = log.getLogLevel()
    log.setLogLevel(0)  # LOG_LEVEL_SILENT, which OpenCV 4 does not export to Python.
    try:
        yield
    finally:
        log.setLogLevel(level)


IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
"""Suffixes of image files."""


def read_image(path: str | Path) -> Image:
    """Reads an image file.

    EXIF orientation is ignored: pixels stay in the sensor's orientation, as intrinsics are of the
    sensor.

    Args:
        path: PNG, JPEG or another file that OpenCV reads; gray and 16-bit images become RGB of
            8 bits, transparency is dropped.

    Returns:
        (H, W, 3) RGB.

    Raises:
        InvalidInputError: there is no such file, or it is not an image.
    """
    path = Path(path)
    try:
        data = read_bytes(path, FileLimits.image_bytes)
    except InvalidInputError as error:
        raise InvalidInputError(str(error).replace("read", "read image", 1)) from error
    if not data:
        raise InvalidInputError(f"image {path} is empty (0 bytes)")
    refuse_huge_image(data, f"image {path}")
    image = decode_image(data)
    if image is None:
        raise InvalidInputError(
            f"{path} cannot be read as an image; give a complete PNG or JPEG file"
        )
    return image


def decode_image(data: bytes) -> Image | None:
    """Decodes an image file's contents to (H, W, 3) RGB; None if they are not an image or too
    large.
    """
    try:
        refuse_huge_image(data, "")
    except InvalidInputError:
        return None
    if _is_cut_off(data):
        return None
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    with silence_opencv(), contextlib.suppress(cv2.error):
        bgr = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
        return None if bgr is None or bgr.size == 0 else np.ascontiguousarray(bgr[..., ::-1])
    return None


def refuse_huge_image(data: bytes, name: str) -> None:
    """Rejects an image that would take too much memory, before it is decoded; a small file may hold
    a large image of one colour.

    Args:
        data: contents of the file; data that is not an image passes, and decoding reports it.
        name: name of the file in messages.

    Raises:
        InvalidInputError: the image has too many pixels.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with PIL.Image.open(io.BytesIO(data)) as image:  # reads the header alone
                width, height = image.size
    except PIL.Image.DecompressionBombError as error:
        raise InvalidInputError(
            f"{name} has more than {2e-6 * (PIL.Image.MAX_IMAGE_PIXELS or 0):.0f} million pixels;"
            f" a side may have at most {MAX_IMAGE_SIDE:,}"
        ) from error
    except (OSError, *READ_ERRORS):
        return
    if max(width, height) > MAX_IMAGE_SIDE:
        raise InvalidInputError(
            f"{name} has {width:,} x {height:,} pixels; a side may have at most {MAX_IMAGE_SIDE:,}"
        )


def _is_cut_off(data: bytes) -> bool:
    """Whether a JPEG or PNG is truncated. Decoders fill up such a JPEG with grey; for a PNG libpng
    writes a line to the terminal.
    """
    if data.startswith(b"\x89PNG"):
        return b"IEND" not in data
    if not data.startswith(b"\xff\xd8"):
        return False
    # Skip the header segments up to start of scan (0xDA): a thumbnail has its own end marker.
    at = 2
    while data[at : at + 1] == b"\xff" and data[at + 1 : at + 2] != b"\xda":
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return data.find(b"\xff\xd9", at) < 0


def require_image_format(path: str | Path) -> None:
    """Rejects image file names without the suffix of a supported format.

    Raises:
        InvalidInputError: no such format.
    """
    if Path(path).suffix.lower() not in IMAGE_SUFFIXES:
        raise InvalidInputError(
            f"cannot write {path}: the name of an image must end in .png or .jpg"
        )


def write_image(path: str | Path, image: Image) -> None:
    """Writes an (H, W, 3) RGB image in the format that the file's suffix names.

    Raises:
        InvalidInputError: no such format, or the place cannot be written to.
    """
    path = Path(path)
    try:
        good, data = cv2.imencode(path.suffix or ".png", np.ascontiguousarray(image[..., ::-1]))
    except cv2.error:
        good = False
    if not good:
        raise InvalidInputError(
            f"cannot write {path}: the name of an image must end in .png or .jpg"
        )
    atomic_write(path, data.tobytes())


def encode_jpeg(image: Image, quality: int) -> bytes:
    """Encodes an RGB image (H, W, 3) as JPEG, of a quality from 0 to 100."""
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return bytes(data.tobytes())


def read_depth(path: str | Path, unit: float | None = None) -> Single:
    """Reads a depth image.

    Args:
        path: 16-bit PNG or TIFF, or a .npy array.
        unit: of its numbers [m]; if None, whole numbers are millimetres, others metres.

    Returns:
        (H, W) distances along the optical axis [m]; 0 where nothing was measured.

    Raises:
        InvalidInputError: no such file, or not a depth image.
    """
    path = Path(path)
    if not path.exists():
        raise InvalidInputError(f"depth image {path} does not exist")
    if path.suffix.lower() == ".npy":
        with open_npy(path) as stored:
            depth = stored.read("fiu")
    else:
        depth = _read_depth_image(path)
    if depth.ndim != 2 or depth.dtype.kind not in "fui" or depth.dtype == np.uint8:
        raise InvalidInputError(
            f"{path} has shape {depth.shape} and type {depth.dtype}; a depth image is (H, W), in"
            " millimetres as 16-bit integers or in metres as floats"
        )
    if unit is None:
        unit = 1.0 if depth.dtype.kind == "f" else 1e-3  # Metres.
    metres: Single = np.nan_to_num(
        depth.astype(np.float32) * np.float32(unit), posinf=0.0, neginf=0.0
    )
    return metres


def _read_depth_image(path: Path) -> NDArray[Any]:
    data = read_bytes(path, FileLimits.image_bytes)
    refuse_huge_image(data, f"depth image {path}")
    depth = None
    with silence_opencv(), contextlib.suppress(cv2.error):
        if data:
            depth = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if depth is None:
        raise InvalidInputError(f"{path} cannot be read as a depth image; give .png or .npy")
    return np.asarray(depth)
