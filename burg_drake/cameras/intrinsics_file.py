"""Files of intrinsics: ours, and those of ROS and OpenCV, told apart by their content."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from burg_drake.cameras.intrinsics import Intrinsics, of_camera
from burg_drake.cameras.station_camera import SIMULATED, simulated_camera
from burg_drake.core.errors import DocumentError, InvalidInputError
from burg_drake.core.files import atomic_write
from burg_drake.core.schema import parse_document, save_document
from burg_drake.core.yaml_nodes import parse_nodes, read_text

OPENCV_MARKS = ("%YAML:1.0", "!!opencv-matrix", "<opencv_storage>")
"""Of files that OpenCV writes."""
ROS_MATRIX = ("camera_matrix", "K", "k")
ROS_DISTORTION = ("distortion_coefficients", "D", "d")
"""Keys of a calibration file, and of a printed message of ROS 1 and ROS 2."""
ROS_MODELS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "none": (0,), "": (0,)}
"""Distortion models of ROS that OpenCV's projection covers, and how many coefficients they have."""


def load_intrinsics(path: str | Path) -> Intrinsics:
    """Reads intrinsics.

    Args:
        path: our document; a `camera_info` file of ROS, or a message printed from a `camera_info`
            topic; a file of OpenCV's calibration sample (YAML or XML); or `sim:STATION[/CAMERA]`,
            the camera of a station.

    Raises:
        DocumentError: the file cannot be read, or does not fit.
        InvalidInputError: a camera or distortion model that is not supported.
        UnknownNameError: no such station or camera.
    """
    if str(path).startswith(SIMULATED):
        station, camera = simulated_camera(str(path))
        return of_camera(station.camera(camera))
    text = read_text(path)
    if any(mark in text for mark in OPENCV_MARKS):
        return _of_opencv(text, str(path))
    text = text.removesuffix("\n").removesuffix("\n---")  # behind a printed message
    node = parse_nodes(text, str(path), "the document is empty; expected a camera's intrinsics")
    keys = [key.value for key, _ in node.value] if isinstance(node, yaml.MappingNode) else ()
    if "focal" not in keys and any(key in keys for key in ROS_MATRIX):
        return _of_ros(yaml.safe_load(text), str(path))
    return parse_document(text, Intrinsics, str(path))


def save_intrinsics(intrinsics: Intrinsics, path: str | Path, header: str = "") -> None:
    """Writes our document."""
    save_document(intrinsics, path, header)


def save_camera_info(intrinsics: Intrinsics, path: str | Path) -> None:
    """Writes a `camera_info` file, as ROS's `camera_info_manager` reads it.

    Raises:
        InvalidInputError: ROS has no name for this number of distortion coefficients.
    """
    data = camera_info_data(intrinsics)
    atomic_write(path, yaml.dump(data, sort_keys=False, default_flow_style=None, width=100))


def camera_info_data(intrinsics: Intrinsics) -> dict[str, Any]:
    """Contents of a `camera_info` file; a rectified image has the same K without distortion.

    Raises:
        InvalidInputError: ROS has no name for this number of distortion coefficients.
    """
    model, coefficients = ros_distortion(intrinsics)
    K = intrinsics.K
    return {
        "image_width": intrinsics.width,
        "image_height": intrinsics.height,
        "camera_name": intrinsics.camera or "camera",
        "camera_matrix": _matrix(3, 3, K.ravel().tolist()),
        "distortion_model": model,
        "distortion_coefficients": _matrix(1, len(coefficients), coefficients),
        "rectification_matrix": _matrix(3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "projection_matrix": _matrix(3, 4, [value for row in K.tolist() for value in (*row, 0.0)]),
    }


def ros_distortion(intrinsics: Intrinsics) -> tuple[str, list[float]]:
    """ROS's name of the distortion model, and its coefficients.

    Raises:
        InvalidInputError: ROS has no name for this number of coefficients.
    """
    k = list(intrinsics.distortion)
    if len(k) > 8:
        raise InvalidInputError(
            f"ROS has no distortion model of {len(k)} coefficients; calibrate with 8 (rational) or"
            " fewer"
        )
    return ("rational_polynomial", k) if len(k) == 8 else ("plumb_bob", k + [0.0] * (5 - len(k)))


def _matrix(rows: int, columns: int, data: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": data}


def _of_ros(data: dict[str, Any], name: str) -> Intrinsics:
    model = str(data.get("distortion_model", "") or "")
    K = _numbers(data, ROS_MATRIX, name)
    if len(K) != 9:
        raise DocumentError(f"{name}: the camera matrix has {len(K)} numbers; 9 are needed")
    if K[0] == 0.0:
        raise DocumentError(f"{name}: the camera is not calibrated (its fx is 0)")
    if abs(K[1]) > 1e-6 * K[0]:
        raise InvalidInputError(f"{name}: the camera's axes are skewed; that is not supported")
    _refuse_part_of_image(data, name)
    coefficients = _numbers(data, ROS_DISTORTION, name)
    if model not in ROS_MODELS:
        fisheye = " (a fisheye lens)" if model in ("equidistant", "fisheye") else ""
        raise InvalidInputError(
            f"{name}: distortion_model {model!r}{fisheye} is not supported, plumb_bob and"
            " rational_polynomial are; `burg-drake camera calibrate --model rational` makes one"
        )
    if any(coefficients) and len(coefficients) not in ROS_MODELS[model]:
        raise DocumentError(
            f"{name}: distortion_model {model!r} has {len(coefficients)} coefficients;"
            f" {' or '.join(map(str, ROS_MODELS[model]))} are expected"
        )
    return _intrinsics(
        name,
        camera=str(data.get("camera_name", "")),
        size=(_pixels(data, "width", name), _pixels(data, "height", name)),
        K=K,
        coefficients=coefficients if any(coefficients) else [],
    )


def _refuse_part_of_image(data: dict[str, Any], name: str) -> None:
    """A message tells K of the sensor's image, and which part of it the images are."""
    binning = [int(data.get(key) or 1) for key in ("binning_x", "binning_y")]
    roi = data.get("roi") or {}
    part = [int(roi.get(key) or 0) for key in ("x_offset", "y_offset", "width", "height")]
    if max(binning) > 1 or any(part):
        raise InvalidInputError(
            f"{name}: images are a part of what the camera matrix is of (binning or roi); that is"
            " not supported: calibrate at the resolution that you use"
        )


def _pixels(data: dict[str, Any], side: str, name: str) -> int:
    value = data.get(f"image_{side}", data.get(side))
    if isinstance(value, bool) or not isinstance(value, int):
        raise DocumentError(f"{name}: image_{side} must be a whole number of pixels, not {value!r}")
    return value


def _numbers(data: dict[str, Any], keys: tuple[str, ...], name: str) -> list[float]:
    """A matrix of a file, or a list of a message, whose key may be any of some."""
    key = next((key for key in keys if key in data), None)
    value = None if key is None else data[key]
    if isinstance(value, dict):
        value = value.get("data")
    try:
        if isinstance(value, list):
            return [float(item) for item in value]
    except (TypeError, ValueError):
        pass
    raise DocumentError(f"{name}: {key or keys[0]} is not a list of numbers")


def _of_opencv(text: str, name: str) -> Intrinsics:
    import cv2

    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        K = storage.getNode("camera_matrix").mat()
        k = storage.getNode("distortion_coefficients").mat()
        size = [int(storage.getNode(f"image_{side}").real()) for side in ("width", "height")]
        is_fisheye = storage.getNode("fisheye_model").real() == 1.0
        residual = storage.getNode("avg_reprojection_error")
        rms = None if residual.empty() else float(residual.real())
    except (cv2.error, SystemError) as error:
        raise DocumentError(f"{name} is not a file of OpenCV that can be read") from error
    if K is None or K.shape != (3, 3):
        raise DocumentError(f"{name}: camera_matrix with 3 x 3 numbers is missing")
    if is_fisheye:
        raise InvalidInputError(f"{name}: the fisheye model is not supported; use --model rational")
    coefficients = [] if k is None else k.ravel().tolist()
    if not any(coefficients[5:]):
        coefficients = coefficients[:5]  # OpenCV pads to the longest model
    return _intrinsics(
        name,
        camera="",
        size=(size[0], size[1]),
        K=K.ravel().tolist(),
        coefficients=coefficients if any(coefficients) else [],
        residual=rms,
    )


def _intrinsics(
    name: str,
    *,
    camera: str,
    size: tuple[int, int],
    K: list[float],
    coefficients: list[float],
    residual: float | None = None,
) -> Intrinsics:
    """Intrinsics from numbers of a file; what is wrong names the file."""
    try:
        return Intrinsics(
            camera=camera,
            width=size[0],
            height=size[1],
            focal=(K[0], K[4]),
            center=(K[2], K[5]),
            distortion=tuple(coefficients),
            residual=residual,
        )
    except InvalidInputError as error:
        raise DocumentError(f"{name}: {error}") from error
