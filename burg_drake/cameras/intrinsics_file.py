"""Read and write intrinsics: files of this project, ROS and OpenCV, and cameras of stations."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from burg_drake.cameras.intrinsics import (
    FISHEYE_COEFFICIENTS,
    Intrinsics,
    camera_intrinsics,
)
from burg_drake.core import (
    MAX_INTEGER_DIGITS,
    STANDARD_TAGS,
    DocumentError,
    FileLimits,
    InvalidInputError,
    Tree,
    UnknownNameError,
    atomic_write,
    parse_document,
    parse_plain_yaml,
    quote_value,
    read_text,
    save_document,
    suggest_names,
)
from burg_drake.station import Station, load_station

SIMULATED_PREFIX = "sim:"  # Prefix of references to cameras of stations.
DEFAULT_CAMERA = "board"  # Camera of a station with several cameras if the reference names none.


def find_simulated_camera(reference: str) -> tuple[Station, str]:
    """Finds the station and the camera's name for `sim:STATION[/CAMERA]`.

    STATION is a built-in name or a file. CAMERA defaults to `board`, or to the only one.

    Raises:
        UnknownNameError: no such station or camera.
        InvalidInputError: the station has several cameras and none is named, or it has none.
    """
    text = reference.removeprefix(SIMULATED_PREFIX)
    named = None
    try:
        station = load_station(text)
    except UnknownNameError as error:
        before, slash, named = text.rpartition("/")
        if not slash:
            raise UnknownNameError(f"station of {reference}: {error}") from None
        try:
            station = load_station(before)
        except UnknownNameError as without_camera:
            reason = error if text.endswith((".yaml", ".yml")) else without_camera
            raise UnknownNameError(f"station of {reference}: {reason}") from None
    known = station.document.cameras
    if not known:
        raise InvalidInputError(f"station {station.name!r} ({station.path}) has no cameras")
    camera = named or (next(iter(known)) if len(known) == 1 else DEFAULT_CAMERA)
    if named is None and camera not in known:
        raise InvalidInputError(
            f"{reference} has several cameras; name one, as in {reference}/CAMERA;"
            f" {suggest_names(DEFAULT_CAMERA, known)}"
        )
    station.camera(camera)
    return station, camera


def read_opencv(text: str, name: str) -> Tree:
    """Parses the contents of an OpenCV file.

    Args:
        text: contents of the file.
        name: stands for the file in messages.

    Raises:
        DocumentError: it is neither OpenCV's YAML nor its XML, or exceeds the limits of documents.
    """
    if text.lstrip().startswith("<"):
        return _read_xml(text, name)
    if text.startswith("%YAML"):  # `%YAML:1.0`, which is not valid YAML, on a line of its own
        text = "#" + text
    return parse_plain_yaml(text, name, tags=STANDARD_TAGS | {"tag:yaml.org,2002:opencv-matrix"})


def _read_xml(text: str, name: str) -> Tree:
    """Parses XML elements to dicts by tag; text of `data` elements becomes a list of words."""
    parser: Any = ElementTree.XMLPullParser(("start", "end"))
    opened: list[dict[str, Any]] = [{}]
    values, line = 0, 1

    def failure(what: str) -> DocumentError:
        return DocumentError(f"{name}:{line}: {what}")

    try:
        for number, words in enumerate(io.StringIO(text), 1):
            line = number
            if "<!DOCTYPE" in words:  # it may define entities, which grow beyond all limits
                raise failure("document type declarations (DOCTYPE) are not supported; remove it")
            parser.feed(words)
            for event, element in parser.read_events():
                if event == "start":
                    values += 1
                    if len(opened) > FileLimits.document.depth:
                        raise failure(f"nested more than {FileLimits.document.depth} levels deep")
                    if values > FileLimits.document.values:
                        raise failure(f"more than {FileLimits.document.values:,} values")
                    opened.append({})
                    continue
                inner, content = opened.pop(), element.text or ""
                if element.tag != "_" and element.tag in opened[-1]:  # `_` is the item of a list
                    raise failure(f"{element.tag!r} appears twice in the same element")
                is_list = element.tag == "data"
                opened[-1][element.tag] = inner or (content.split() if is_list else content.strip())
        parser.close()
    except ElementTree.ParseError as error:
        line = error.position[0]
        raise failure(f"not valid XML: {str(error).split(':')[0]}") from error
    return opened[0].get("opencv_storage", {})


ROS_MATRIX_KEYS = ("camera_matrix", "K", "k")
"""Keys of K in a calibration file and in messages of ROS 1 and ROS 2."""
ROS_DISTORTION_KEYS = ("distortion_coefficients", "D", "d")
"""Keys of the distortion in a calibration file and in messages of ROS 1 and ROS 2."""
ROS_FISHEYE_MODEL = "equidistant"  # Name of the fisheye model in ROS.
ROS_LENS_MODELS = {
    "plumb_bob": (4, 5),
    "rational_polynomial": (8,),
    ROS_FISHEYE_MODEL: (4,),
    "none": (0,),
    "": (0,),
}
"""Supported distortion models of ROS and their possible numbers of coefficients."""


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
    if str(path).startswith(SIMULATED_PREFIX):
        station, camera = find_simulated_camera(str(path))
        return camera_intrinsics(station.camera(camera))
    text = read_text(path)
    name = str(path)
    # Texts that only OpenCV's files contain.
    if any(mark in text for mark in ("%YAML:1.0", "!!opencv-matrix", "<opencv_storage>")):
        return _intrinsics_from_opencv(read_opencv(text, name), name)
    data = parse_plain_yaml(
        text, name, empty="the document is empty; expected a camera's intrinsics"
    )
    is_ros = isinstance(data, dict) and any(key in data for key in ROS_MATRIX_KEYS)
    if is_ros and "focal" not in data:
        return _intrinsics_from_ros(data, name)
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
        "camera_matrix": _matrix_data(3, 3, K.ravel().tolist()),
        "distortion_model": model,
        "distortion_coefficients": _matrix_data(1, len(coefficients), coefficients),
        "rectification_matrix": _matrix_data(3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "projection_matrix": _matrix_data(
            3, 4, [value for row in K.tolist() for value in (*row, 0.0)]
        ),
    }


def ros_distortion(intrinsics: Intrinsics) -> tuple[str, list[float]]:
    """ROS's name of the distortion model, and its coefficients.

    Raises:
        InvalidInputError: ROS has no name for this number of coefficients.
    """
    k = list(intrinsics.distortion)
    if intrinsics.is_fisheye:
        return ROS_FISHEYE_MODEL, k
    if len(k) > 8:
        raise InvalidInputError(
            f"ROS has no distortion model of {len(k)} coefficients; calibrate with 8 (rational) or"
            " fewer"
        )
    return ("rational_polynomial", k) if len(k) == 8 else ("plumb_bob", k + [0.0] * (5 - len(k)))


def _matrix_data(rows: int, columns: int, data: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": data}


def _intrinsics_from_ros(data: Tree, name: str) -> Intrinsics:
    model = _read_text(data, "distortion_model", name)
    K = _read_camera_matrix(data, name)
    _refuse_cropped_image(data, name)
    coefficients = _read_numbers(data, ROS_DISTORTION_KEYS, name)
    if model not in ROS_LENS_MODELS:
        raise InvalidInputError(
            f"{name}: distortion_model {quote_value(model)} is not supported; supported are"
            f" plumb_bob, rational_polynomial and {ROS_FISHEYE_MODEL} (fisheye): calibrate with"
            " `burg-drake camera calibrate`"
        )
    if any(coefficients) and len(coefficients) not in ROS_LENS_MODELS[model]:
        raise DocumentError(
            f"{name}: distortion_model {model!r} has {len(coefficients)} coefficients;"
            f" {' or '.join(map(str, ROS_LENS_MODELS[model]))} are expected"
        )
    fisheye = is_ros_fisheye(model, coefficients)
    camera = _read_text(data, "camera_name", name)
    return _build_intrinsics(data, name, K, coefficients, fisheye=fisheye, camera=camera)


def is_ros_fisheye(model: str, coefficients: Sequence[float]) -> bool:
    """Whether a distortion model of ROS is a fisheye. Four zeros are an equidistant fisheye;
    messages without coefficients, or with five zeros, are of cameras without distortion.
    """
    return model == ROS_FISHEYE_MODEL and (
        len(coefficients) == FISHEYE_COEFFICIENTS or any(coefficients)
    )


def _refuse_cropped_image(data: Tree, name: str) -> None:
    """Rejects messages whose images are a part of the sensor's image, to which K refers."""
    binning = [_read_integer(data, key, name) for key in ("binning_x", "binning_y") if key in data]
    roi = data.get("roi")
    roi = roi if isinstance(roi, dict) else {}
    keys = ("x_offset", "y_offset", "width", "height")
    part = [_read_integer(roi, key, name) for key in keys if key in roi]
    if any(n > 1 for n in binning) or any(part):
        raise InvalidInputError(
            f"{name}: binning or roi is set, so images show only a part of what the camera matrix"
            " describes; that is not supported: calibrate at the resolution that you use"
        )


def _read_size(data: Tree, name: str) -> tuple[int, int]:
    """Width and height; messages and files use different keys."""
    keys = [
        side if side in data and f"image_{side}" not in data else f"image_{side}"
        for side in ("width", "height")
    ]
    return _read_integer(data, keys[0], name), _read_integer(data, keys[1], name)


def _read_integer(data: Tree, key: str, name: str) -> int:
    value = data.get(key)
    if isinstance(value, str) and len(value) <= MAX_INTEGER_DIGITS and value.isdecimal():
        return int(value)
    raise DocumentError(f"{name}: {key} must be a whole number of pixels, not {quote_value(value)}")


def _read_text(data: Tree, key: str, name: str) -> str:
    value = data.get(key, "")
    if not isinstance(value, str):
        raise DocumentError(f"{name}: {key} is a list or mapping; expected text")
    return value


def _read_camera_matrix(data: Tree, name: str) -> list[float]:
    K = _read_numbers(data, ROS_MATRIX_KEYS, name)
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


def _read_numbers(data: Tree, keys: tuple[str, ...], name: str) -> list[float]:
    """Numbers of the first of several keys: a matrix in a file, a list in a message."""
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


def _intrinsics_from_opencv(data: Tree, name: str) -> Intrinsics:
    if not isinstance(data, dict) or "camera_matrix" not in data:
        raise DocumentError(f"{name}: camera_matrix with 3 x 3 numbers is missing")
    K = _read_camera_matrix(data, name)
    try:
        is_fisheye = float(data.get("fisheye_model", 0)) == 1.0
        rms = float(data["avg_reprojection_error"]) if "avg_reprojection_error" in data else None
    except (TypeError, ValueError) as error:
        raise DocumentError(
            f"{name}: fisheye_model and avg_reprojection_error must be numbers"
        ) from error
    key = ROS_DISTORTION_KEYS[0]
    coefficients = _read_numbers(data, (key,), name) if key in data else []
    if not any(coefficients[5:]):
        coefficients = coefficients[:5]  # OpenCV pads to the longest model
    return _build_intrinsics(data, name, K, coefficients, fisheye=is_fisheye, residual=rms)


def _build_intrinsics(
    data: Tree,
    name: str,
    K: list[float],
    coefficients: list[float],
    *,
    fisheye: bool,
    camera: str = "",
    residual: float | None = None,
) -> Intrinsics:
    """Builds intrinsics from a file's numbers; errors name the file."""
    width, height = _read_size(data, name)
    try:
        return Intrinsics(
            camera=camera,
            width=width,
            height=height,
            focal=(K[0], K[4]),
            center=(K[2], K[5]),
            model="fisheye" if fisheye else "perspective",
            distortion=tuple(coefficients) if any(coefficients) or fisheye else (),
            residual=residual,
        )
    except InvalidInputError as error:
        raise DocumentError(f"{name}: {error}") from error
