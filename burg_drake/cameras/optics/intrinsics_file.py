"""Files of intrinsics: ours, and those of ROS and OpenCV, told apart by their content."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from burg_drake.cameras.optics.fisheye import COEFFICIENTS
from burg_drake.cameras.optics.intrinsics import Intrinsics, LensModel, of_camera
from burg_drake.cameras.optics.opencv_file import is_opencv, read_opencv
from burg_drake.cameras.optics.station_camera import SIMULATED, simulated_camera
from burg_drake.core import DocumentError, InvalidInputError, quoted
from burg_drake.core.documents import DIGITS, Tree, parse_document, parse_plain_yaml, save_document
from burg_drake.core.files import atomic_write, read_text

ROS_MATRIX = ("camera_matrix", "K", "k")
ROS_DISTORTION = ("distortion_coefficients", "D", "d")
"""Keys of a calibration file, and of a printed message of ROS 1 and ROS 2."""
ROS_FISHEYE = "equidistant"
ROS_MODELS = {
    "plumb_bob": (4, 5),
    "rational_polynomial": (8,),
    ROS_FISHEYE: (4,),
    "none": (0,),
    "": (0,),
}
"""Distortion models of ROS that our lens models cover, and how many coefficients they have."""


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
    name = str(path)
    if is_opencv(text):
        return _of_opencv(read_opencv(text, name), name)
    data = parse_plain_yaml(
        text, name, empty="the document is empty; expected a camera's intrinsics"
    )
    if isinstance(data, dict) and "focal" not in data and any(key in data for key in ROS_MATRIX):
        return _of_ros(data, name)
    return parse_document(text, Intrinsics, name)


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
    if intrinsics.is_fisheye:
        return ROS_FISHEYE, k
    if len(k) > 8:
        raise InvalidInputError(
            f"ROS has no distortion model of {len(k)} coefficients; calibrate with 8 (rational) or"
            " fewer"
        )
    return ("rational_polynomial", k) if len(k) == 8 else ("plumb_bob", k + [0.0] * (5 - len(k)))


def _matrix(rows: int, columns: int, data: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": data}


def _of_ros(data: Tree, name: str) -> Intrinsics:
    model = _text(data, "distortion_model", name)
    K = _camera_matrix(data, name)
    _refuse_part_of_image(data, name)
    coefficients = _numbers(data, ROS_DISTORTION, name)
    if model not in ROS_MODELS:
        raise InvalidInputError(
            f"{name}: distortion_model {quoted(model)} is not supported; supported are plumb_bob,"
            f" rational_polynomial and {ROS_FISHEYE} (fisheye): calibrate with `burg-drake camera"
            " calibrate`"
        )
    if any(coefficients) and len(coefficients) not in ROS_MODELS[model]:
        raise DocumentError(
            f"{name}: distortion_model {model!r} has {len(coefficients)} coefficients;"
            f" {' or '.join(map(str, ROS_MODELS[model]))} are expected"
        )
    fisheye = is_ros_fisheye(model, coefficients)
    return _intrinsics(
        name,
        camera=_text(data, "camera_name", name),
        size=_size(data, name),
        K=K,
        model="fisheye" if fisheye else "perspective",
        coefficients=coefficients if any(coefficients) or fisheye else [],
    )


def is_ros_fisheye(model: str, coefficients: Sequence[float]) -> bool:
    """Whether a distortion model of ROS is a fisheye's. With four zeros it is one, whose angles are
    even; messages without coefficients, or with five zeros, are of cameras without distortion."""
    return model == ROS_FISHEYE and (len(coefficients) == COEFFICIENTS or any(coefficients))


def _refuse_part_of_image(data: Tree, name: str) -> None:
    """A message tells K of the sensor's image, and which part of it the images are."""
    binning = [_whole(data, key, name) for key in ("binning_x", "binning_y") if key in data]
    roi = data.get("roi")
    if isinstance(roi, dict):
        keys = ("x_offset", "y_offset", "width", "height")
        part = [_whole(roi, key, name) for key in keys if key in roi]
    else:
        part = []
    if any(n > 1 for n in binning) or any(part):
        raise InvalidInputError(
            f"{name}: binning or roi is set, so images show only a part of what the camera matrix"
            " describes; that is not supported: calibrate at the resolution that you use"
        )


def _size(data: Tree, name: str) -> tuple[int, int]:
    """Width and height, which messages call by other keys than files."""
    keys = [
        side if side in data and f"image_{side}" not in data else f"image_{side}"
        for side in ("width", "height")
    ]
    return _whole(data, keys[0], name), _whole(data, keys[1], name)


def _whole(data: Tree, key: str, name: str) -> int:
    value = data.get(key)
    if isinstance(value, str) and len(value) <= DIGITS and value.isdecimal():
        return int(value)
    raise DocumentError(f"{name}: {key} must be a whole number of pixels, not {quoted(value)}")


def _text(data: Tree, key: str, name: str) -> str:
    value = data.get(key, "")
    if not isinstance(value, str):
        raise DocumentError(f"{name}: {key} is a list or mapping; expected text")
    return value


def _camera_matrix(data: Tree, name: str) -> list[float]:
    K = _numbers(data, ROS_MATRIX, name)
    if len(K) != 9:
        raise DocumentError(f"{name}: the camera matrix has {len(K)} numbers; 9 are needed")
    if K[0] == 0.0:
        raise DocumentError(f"{name}: the camera is not calibrated (its fx is 0)")
    if not abs(K[1]) <= 1e-6 * abs(K[0]):
        raise InvalidInputError(
            f"{name}: the camera matrix has skew {K[1]:g}, which is not supported; calibrate"
            " without skew"
        )
    if [K[3], *K[6:]] != [0.0, 0.0, 0.0, 1.0]:
        raise DocumentError(
            f"{name}: the camera matrix must have 0 below fx and 0, 0, 1 in its last row; it has"
            f" {K[3]:g} and {K[6]:g}, {K[7]:g}, {K[8]:g}"
        )
    return K


def _numbers(data: Tree, keys: tuple[str, ...], name: str) -> list[float]:
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
    raise DocumentError(f"{name}: {key or keys[0]} is not a list of finite numbers")


def _of_opencv(data: Tree, name: str) -> Intrinsics:
    if not isinstance(data, dict) or "camera_matrix" not in data:
        raise DocumentError(f"{name}: camera_matrix with 3 x 3 numbers is missing")
    K = _camera_matrix(data, name)
    try:
        is_fisheye = float(data.get("fisheye_model", 0)) == 1.0
        rms = float(data["avg_reprojection_error"]) if "avg_reprojection_error" in data else None
    except (TypeError, ValueError) as error:
        raise DocumentError(
            f"{name}: fisheye_model and avg_reprojection_error must be numbers"
        ) from error
    key = ROS_DISTORTION[0]
    coefficients = _numbers(data, (key,), name) if key in data else []
    if not any(coefficients[5:]):
        coefficients = coefficients[:5]  # OpenCV pads to the longest model
    return _intrinsics(
        name,
        camera="",
        size=_size(data, name),
        K=K,
        model="fisheye" if is_fisheye else "perspective",
        coefficients=coefficients if any(coefficients) or is_fisheye else [],
        residual=rms,
    )


def _intrinsics(
    name: str,
    *,
    camera: str,
    size: tuple[int, int],
    K: list[float],
    model: LensModel,
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
            model=model,
            distortion=tuple(coefficients),
            residual=residual,
        )
    except InvalidInputError as error:
        raise DocumentError(f"{name}: {error}") from error
