"""Depth images from files: 16-bit PNG in millimetres, as RealSense tools and ROS (REP 118) write
them, or a numpy array."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.sources.image_file import require_image_size
from burg_drake.cameras.sources.opencv_log import quiet
from burg_drake.core import InvalidInputError
from burg_drake.core.files import IMAGE_SIZE, open_npy, read_bytes

MILLIMETRE = 1e-3


def read_depth(path: str | Path, unit: float | None = None) -> NDArray[np.float32]:
    """Reads a depth image.

    Args:
        path: 16-bit PNG or TIFF, or a .npy array.
        unit: of its numbers [m]; if None, whole numbers are millimetres, others metres.

    Returns:
        (H, W) distances along the optical axis [m]; 0 where there is none.

    Raises:
        InvalidInputError: no such file, or not a depth image.
    """
    path = Path(path)
    if not path.exists():
        raise InvalidInputError(f"depth image {path} does not exist")
    depth = _array(path) if path.suffix.lower() == ".npy" else _image(path)
    if depth.ndim != 2 or depth.dtype.kind not in "fui" or depth.dtype == np.uint8:
        raise InvalidInputError(
            f"{path} has shape {depth.shape} and type {depth.dtype}; a depth image is (H, W), in"
            " millimetres as 16-bit integers or in metres as floats"
        )
    if unit is None:
        unit = 1.0 if depth.dtype.kind == "f" else MILLIMETRE
    metres: NDArray[np.float32] = np.nan_to_num(
        depth.astype(np.float32) * np.float32(unit), posinf=0.0, neginf=0.0
    )
    return metres


def _array(path: Path) -> NDArray[Any]:
    with open_npy(path) as stored:
        return stored.read("fiu")


def _image(path: Path) -> NDArray[Any]:
    data = read_bytes(path, IMAGE_SIZE)
    require_image_size(data, f"depth image {path}")
    depth = None
    with quiet(), contextlib.suppress(cv2.error):
        if data:
            depth = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if depth is None:
        raise InvalidInputError(f"{path} cannot be read as a depth image; give .png or .npy")
    return np.asarray(depth)
