"""Reads documents in `isaac_grasp` YAML; which frame their poses are those of is the matter of
`isaac_grasp` and `graspgen_yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    DocumentError,
    inverse,
    listing,
    make_pose,
    quoted,
    rotation_from_quaternion,
)
from burg_drake.core.documents import load_plain_yaml
from burg_drake.core.grasps import FIXED_COLUMNS, GraspSet
from burg_drake.formats.common import (
    PREGRASP_WIDTH,
    Gripper,
    ImportedGrasps,
    object_name,
    scale_note,
)
from burg_drake.formats.grasps.isaac_dialect import CLOSED, NAME, OPEN, Dialect

GRIPPER_KEYS = ("gripper_frame_link", "gripper_frame")
OBJECT_KEYS = ("object_file", "object_frame_link", "object_frame")
KNOWN = ("confidence", "position", "orientation", CLOSED, OPEN)
TAKEN = (*FIXED_COLUMNS, NAME, PREGRASP_WIDTH)
UNIT = 1e-3
"""Largest deviation of a quaternion's length from 1 that is taken for rounding; the manual's own
example has five decimals."""


def read_yaml(dialect: Dialect, path: Path, gripper: Gripper) -> ImportedGrasps:
    """The grasps of a file; `score` is the confidence.

    Args:
        dialect: of the file.
        path: the file.
        gripper: the hand of the grasps.

    Raises:
        DocumentError: no such file, or a value that cannot be used; the message says where.
    """
    document = load_plain_yaml(path)
    _check_kind(path, document)
    grasps = document.get("grasps")
    if not isinstance(grasps, dict):
        raise _fail(path, "grasps", grasps, "grasps by name")
    _check_gripper(path, document, gripper)
    for name, grasp in grasps.items():
        if not isinstance(grasp, dict):
            raise _fail(path, f"grasps.{name}", grasp, "position and orientation")
    object, described = _object(path, document)
    X_FG = inverse(dialect.X_GF(gripper))
    columns: dict[str, NDArray[Any]] = {NAME: np.array(list(grasps), dtype=str)}
    width, note = _widths(path, grasps, CLOSED, gripper)
    opening, _ = _widths(path, grasps, OPEN, gripper)
    if not np.isnan(opening).all():
        columns[PREGRASP_WIDTH] = opening
    further, left = _further(grasps)
    notes: tuple[str, ...] = ()
    if not any(key in document for key in GRIPPER_KEYS):
        axis = "xyz"[int(np.argmax(np.abs(X_FG[:3, 0])))]
        notes += (
            f"The file names no gripper frame; the fingers were taken to close along its {axis}.",
        )
    if not any(document.get(key) for key in OBJECT_KEYS):
        notes += (f"The file names no object; the object is called {object!r}.",)
    if "scale" in described:
        notes += (scale_note(object, str(described["file"]), float(described["scale"])),)
    set_ = GraspSet.create(
        _poses(path, grasps) @ X_FG,
        object=object,
        width=width,
        score=_confidences(path, grasps),
        columns={**further, **columns},
        provenance={
            "format": dialect.name,
            "file": str(path.absolute()),
            "object_files": {object: described},
        },
    )
    return ImportedGrasps(set_, "object", (*notes, *note, *left))


def _check_kind(path: Path, document: Any) -> None:
    if not isinstance(document, dict) or document.get("format") != "isaac_grasp":
        given = document.get("format") if isinstance(document, dict) else document
        raise _fail(path, "format", given, "isaac_grasp")
    version = document.get("format_version", "1.0")
    if version not in ("1.0", "1"):
        raise DocumentError(
            f"{path}: format_version: {version!r} cannot be read; this release reads 1.0"
        )


def _check_gripper(path: Path, document: Mapping[str, Any], gripper: Gripper) -> None:
    key = next((key for key in GRIPPER_KEYS if key in document), None)
    link = str(document[key]) if key is not None else ""
    if key is not None and object_name(link) != gripper.body:
        raise DocumentError(
            f"{path}: {key}: {link!r} is not {gripper.body!r}, the frame of hand "
            f"{gripper.name!r}; read the file with the hand that the grasps were made"
            f" for. If the two frames are the same, name {object_name(link)!r} as the"
            " gripper's link"
        ).about("gripper_link", "hand")


def _object(path: Path, document: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Its name, and what the file says of it."""
    file = next((str(document[key]) for key in OBJECT_KEYS if document.get(key)), "")
    described: dict[str, Any] = {"file": file} if "object_file" in document else {}
    if "object_file" in document and "object_scale" in document:
        scale = _numbers(path, {"object_scale": document["object_scale"]}, (), "")[0]
        if not scale > 0.0:
            raise DocumentError(f"{path}: object_scale: {scale:g} must be above 0")
        described["scale"] = float(scale)
    return object_name(file) or path.stem, described


def _poses(path: Path, grasps: Mapping[str, Mapping[str, Any]]) -> Array:
    """(N, 4, 4) poses as written."""
    positions = {name: _field(path, name, g, "position", list) for name, g in grasps.items()}
    turned = {name: _field(path, name, g, "orientation", dict) for name, g in grasps.items()}
    quaternions = {}
    for name, q in turned.items():
        if "w" not in q or not isinstance(q.get("xyz"), list):
            raise _fail(path, f"grasps.{name}.orientation", q, "{w: ..., xyz: [..., ..., ...]}")
        quaternions[name] = [q["w"], *q["xyz"]]
    p = _numbers(path, positions, (3,), "position")
    q = _numbers(path, quaternions, (4,), "orientation")
    length = np.linalg.norm(q, axis=1)
    off = np.abs(length - 1.0) > UNIT
    if off.any():
        i = int(np.argmax(off))
        raise DocumentError(
            f"{path}: grasps.{list(grasps)[i]}.orientation: the quaternion has length "
            f"{length[i]:.4g}; it must be 1"
        )
    return make_pose(rotation_from_quaternion(q), p)


def _field(path: Path, name: str, grasp: Mapping[str, Any], key: str, kind: type) -> Any:
    if not isinstance(grasp.get(key), kind):
        what = "[x, y, z]" if kind is list else "{w: ..., xyz: [..., ..., ...]}"
        raise _fail(path, f"grasps.{name}.{key}", grasp.get(key), what)
    return grasp[key]


def _confidences(path: Path, grasps: Mapping[str, Mapping[str, Any]]) -> Array:
    """(N,); NaN where there is none."""
    given = {name: g["confidence"] for name, g in grasps.items() if "confidence" in g}
    unknown = {name for name, text in given.items() if text in (".nan", ".NaN", ".NAN", "null")}
    known = {name: text for name, text in given.items() if name not in unknown}
    values = dict(zip(known, _numbers(path, known, (), "confidence"), strict=True))
    return np.array([values.get(name, np.nan) for name in grasps], dtype=float)


def _widths(
    path: Path, grasps: Mapping[str, Mapping[str, Any]], key: str, gripper: Gripper
) -> tuple[Array, tuple[str, ...]]:
    """(N,) distance between the pads, NaN where no joint of the hand is given, and notes."""
    given = {joint.name: np.full(len(grasps), np.nan) for joint in gripper.joints}
    unknown: set[str] = set()
    for i, (name, grasp) in enumerate(grasps.items()):
        joints = grasp.get(key, {})
        if not isinstance(joints, dict):
            raise _fail(path, f"grasps.{name}.{key}", joints, "positions by joint")
        for joint, text in joints.items():
            if joint in given:
                given[joint][i] = _number(path, f"grasps.{name}.{key}.{joint}", text)
            else:
                unknown.add(joint)
    with np.errstate(all="ignore"):
        of_joints = [gripper.width({joint: q}) for joint, q in given.items()]
        stacked = np.stack(of_joints) if of_joints else np.empty((0, len(grasps)))
        count = (~np.isnan(stacked)).sum(axis=0)
        widths = np.where(count > 0, np.nansum(stacked, axis=0) / count, np.nan)
    note = f"{key}: joints that hand {gripper.name!r} does not have were ignored"
    return widths, (f"{note}: {listing(sorted(unknown))}.",) if unknown else ()


def _further(
    grasps: Mapping[str, Mapping[str, Any]],
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """Columns of single values under foreign keys, and a note about the rest."""
    keys = dict.fromkeys(key for g in grasps.values() for key in g if key not in KNOWN)
    columns: dict[str, NDArray[Any]] = {}
    left = []
    for key in keys:
        values = [g.get(key, "") for g in grasps.values()]
        if key in TAKEN or not all(isinstance(value, str) for value in values):
            left.append(key)
            continue
        try:
            columns[key] = np.array([float(v) if v else np.nan for v in values])
        except ValueError:
            columns[key] = np.array(values, dtype=str)
    return columns, (f"Ignored: {listing(left)} of each grasp.",) if left else ()


def _numbers(
    path: Path, given: Mapping[str, Any], shape: tuple[int, ...], key: str
) -> NDArray[np.float64]:
    """(N, *shape) finite numbers from texts; the error names the first value that is none."""
    expected = (len(given), *shape)
    try:
        values = np.array(list(given.values()) or np.empty(expected), dtype=float)
        if values.shape == expected and np.isfinite(values).all():
            return values
    except (TypeError, ValueError):
        pass
    for name, value in given.items():
        where = f"grasps.{name}.{key}" if key else name
        if not shape:
            _number(path, where, value)
        elif len(value) != shape[0]:
            raise _fail(path, where, value, f"{shape[0]} numbers")
        else:
            for text in value:
                _number(path, where, text)
    raise AssertionError("one of the values is not a finite number")


def _number(path: Path, where: str, text: Any) -> float:
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = np.nan
    if not np.isfinite(value):
        raise _fail(path, where, text, "a finite number")
    return value


def _fail(path: Path, where: str, given: Any, expected: str) -> DocumentError:
    if given is None:
        return DocumentError(f"{path}: {where}: missing; expected {expected}")
    shown = quoted(given) if isinstance(given, str) else f"a {type(given).__name__}"
    return DocumentError(f"{path}: {where}: {shown} instead of {expected}")
