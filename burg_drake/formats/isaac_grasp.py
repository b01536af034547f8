"""`isaac_grasp` YAML: grasps of Isaac Sim's grasp editor, and grasps that GraspGen predicts.

The layout is the one of the manual of Isaac Sim (docs.isaacsim.omniverse.nvidia.com, "Grasp
Editor") and of "Isaac Grasp File" in that of Isaac ROS (nvidia-isaac-ros.github.io):

- `format: isaac_grasp` and `format_version: 1.0` (or "1.0") say what it is. `object_frame_link` and
  `gripper_frame_link` are prims such as `/World/mug` and `/World/panda_hand`; Isaac ROS spells them
  `object_frame` and `gripper_frame`.
- `grasps` has by name: `confidence` from 0 to 1; `position` and `orientation: {w, xyz}` of the
  gripper frame in the object frame [m]; `cspace_position`, the finger joints by name while the
  object is held; `pregrasp_cspace_position`, the same on approach.
- GraspDataGen (github.com/NVlabs/GraspDataGen, scripts/graspgen/grasp_guess.py) writes
  `object_file`, `object_scale` and `gripper_file` besides, and `bite_point` of each grasp; its
  `confidence` is 1 or 0.

The gripper frame is the named link of the hand, for the Panda `panda_hand`: +z towards the tips and
y along the closing direction. Isaac Sim itself ignores the name.

Predictions of GraspGen have the format `graspgen_yaml`: `save_to_isaac_grasp_format` in
grasp_gen/dataset/eval_utils.py (github.com/NVlabs/GraspGen) writes `format`, `format_version` and
of each grasp `confidence`, `position` and `orientation`, but neither object nor gripper frame nor
joints. The closing direction of these poses is x, as in `graspgen`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    FIXED_COLUMNS,
    Array,
    DocumentError,
    GraspSet,
    atomic_write,
    inverse,
    list_names,
    load_plain_yaml,
    make_pose,
    quaternion_from_rotation,
    quote_value,
    rotation_from_quaternion,
)
from burg_drake.formats.grasp_conversion import object_name, require_single_object, scale_note
from burg_drake.formats.grasp_format import (
    PREGRASP_WIDTH_COLUMN,
    GraspFormat,
    Gripper,
    ImportedGrasps,
    conversion_losses,
)


class IsaacGraspKeys:
    """Isaac grasp keys."""

    closed_joints = "cspace_position"  # Key of the joint positions while the object is held.
    open_joints = "pregrasp_cspace_position"  # Key of the joint positions on approach.
    # Keys of the gripper frame, in Isaac Sim and in Isaac ROS.
    gripper_frame = ("gripper_frame_link", "gripper_frame")
    # Keys that name the object, the preferred one first.
    object = ("object_file", "object_frame_link", "object_frame")


@dataclass(frozen=True)
class IsaacDialect:
    """A way to write `isaac_grasp` YAML.

    Attributes:
        name: of the format.
        title: of the format, for people.
        X_GF: (4, 4) pose in G of what the file's poses are those of, for a gripper.
        names_gripper_frame: whether it says which frames its poses relate, and where the joints
            are.
    """

    name: str
    title: str
    X_GF: Callable[[Gripper], Array]
    names_gripper_frame: bool


def read_isaac_grasp(dialect: IsaacDialect, path: Path, gripper: Gripper) -> ImportedGrasps:
    """The grasps of a file; `score` is the confidence.

    Args:
        dialect: of the file.
        path: the file.
        gripper: the hand of the grasps.

    Raises:
        DocumentError: no such file, or a value that cannot be used; the message says where.
    """
    document = load_plain_yaml(path)
    _check_format_version(path, document)
    grasps = document.get("grasps")
    if not isinstance(grasps, dict):
        raise _value_error(path, "grasps", grasps, "grasps by name")
    _check_gripper_link(path, document, gripper)
    for name, grasp in grasps.items():
        if not isinstance(grasp, dict):
            raise _value_error(path, f"grasps.{name}", grasp, "position and orientation")
    object, described = _read_object(path, document)
    X_FG = inverse(dialect.X_GF(gripper))
    columns: dict[str, NDArray[Any]] = {"name": np.array(list(grasps), dtype=str)}
    width, note = _widths_from_joints(path, grasps, IsaacGraspKeys.closed_joints, gripper)
    opening, _ = _widths_from_joints(path, grasps, IsaacGraspKeys.open_joints, gripper)
    if not np.isnan(opening).all():
        columns[PREGRASP_WIDTH_COLUMN] = opening
    further, left = _extra_columns(grasps)
    notes: tuple[str, ...] = ()
    if not any(key in document for key in IsaacGraspKeys.gripper_frame):
        axis = "xyz"[int(np.argmax(np.abs(X_FG[:3, 0])))]
        notes += (
            f"The file names no gripper frame; the fingers were taken to close along its {axis}.",
        )
    if not any(document.get(key) for key in IsaacGraspKeys.object):
        notes += (f"The file names no object; the object is called {object!r}.",)
    if "scale" in described:
        notes += (scale_note(object, str(described["file"]), float(described["scale"])),)
    set_ = GraspSet.create(
        _read_poses(path, grasps) @ X_FG,
        object=object,
        width=width,
        score=_read_confidences(path, grasps),
        columns={**further, **columns},
        provenance={
            "format": dialect.name,
            "file": str(path.absolute()),
            "object_files": {object: described},
        },
    )
    return ImportedGrasps(set_, "object", (*notes, *note, *left))


def _check_format_version(path: Path, document: Any) -> None:
    if not isinstance(document, dict) or document.get("format") != "isaac_grasp":
        given = document.get("format") if isinstance(document, dict) else document
        raise _value_error(path, "format", given, "isaac_grasp")
    version = document.get("format_version", "1.0")
    if version not in ("1.0", "1"):
        raise DocumentError(
            f"{path}: format_version: {version!r} cannot be read; this release reads 1.0"
        )


def _check_gripper_link(path: Path, document: Mapping[str, Any], gripper: Gripper) -> None:
    key = next((key for key in IsaacGraspKeys.gripper_frame if key in document), None)
    link = str(document[key]) if key is not None else ""
    if key is not None and object_name(link) != gripper.body:
        raise DocumentError(
            f"{path}: {key}: {link!r} is not {gripper.body!r}, the frame of hand "
            f"{gripper.name!r}; read the file with the hand that the grasps were made"
            f" for. If the two frames are the same, name {object_name(link)!r} as the"
            " gripper's link"
        ).about("gripper_link", "hand")


def _read_object(path: Path, document: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Its name, and what the file says of it."""
    file = next((str(document[key]) for key in IsaacGraspKeys.object if document.get(key)), "")
    described: dict[str, Any] = {"file": file} if "object_file" in document else {}
    if "object_file" in document and "object_scale" in document:
        scale = _parse_numbers(path, {"object_scale": document["object_scale"]}, (), "")[0]
        if not scale > 0.0:
            raise DocumentError(f"{path}: object_scale: {scale:g} must be above 0")
        described["scale"] = float(scale)
    return object_name(file) or path.stem, described


def _read_poses(path: Path, grasps: Mapping[str, Mapping[str, Any]]) -> Array:
    """(N, 4, 4) poses as written."""
    norm_tolerance = 1e-3  # Largest deviation of a quaternion's length from 1, as of five decimals.
    positions = {
        name: _require_field(path, name, g, "position", list) for name, g in grasps.items()
    }
    turned = {
        name: _require_field(path, name, g, "orientation", dict) for name, g in grasps.items()
    }
    quaternions = {}
    for name, q in turned.items():
        if "w" not in q or not isinstance(q.get("xyz"), list):
            raise _value_error(
                path, f"grasps.{name}.orientation", q, "{w: ..., xyz: [..., ..., ...]}"
            )
        quaternions[name] = [q["w"], *q["xyz"]]
    p = _parse_numbers(path, positions, (3,), "position")
    q = _parse_numbers(path, quaternions, (4,), "orientation")
    length = np.linalg.norm(q, axis=1)
    off = np.abs(length - 1.0) > norm_tolerance
    if off.any():
        i = int(np.argmax(off))
        raise DocumentError(
            f"{path}: grasps.{list(grasps)[i]}.orientation: the quaternion has length "
            f"{length[i]:.4g}; it must be 1"
        )
    return make_pose(rotation_from_quaternion(q), p)


def _require_field(path: Path, name: str, grasp: Mapping[str, Any], key: str, kind: type) -> Any:
    if not isinstance(grasp.get(key), kind):
        what = "[x, y, z]" if kind is list else "{w: ..., xyz: [..., ..., ...]}"
        raise _value_error(path, f"grasps.{name}.{key}", grasp.get(key), what)
    return grasp[key]


def _read_confidences(path: Path, grasps: Mapping[str, Mapping[str, Any]]) -> Array:
    """(N,); NaN where there is none."""
    given = {name: g["confidence"] for name, g in grasps.items() if "confidence" in g}
    unknown = {name for name, text in given.items() if text in (".nan", ".NaN", ".NAN", "null")}
    known = {name: text for name, text in given.items() if name not in unknown}
    values = dict(zip(known, _parse_numbers(path, known, (), "confidence"), strict=True))
    return np.array([values.get(name, np.nan) for name in grasps], dtype=float)


def _widths_from_joints(
    path: Path, grasps: Mapping[str, Mapping[str, Any]], key: str, gripper: Gripper
) -> tuple[Array, tuple[str, ...]]:
    """(N,) distance between the pads, NaN where no joint of the hand is given, and notes."""
    given = {joint.name: np.full(len(grasps), np.nan) for joint in gripper.joints}
    unknown: set[str] = set()
    for i, (name, grasp) in enumerate(grasps.items()):
        joints = grasp.get(key, {})
        if not isinstance(joints, dict):
            raise _value_error(path, f"grasps.{name}.{key}", joints, "positions by joint")
        for joint, text in joints.items():
            if joint in given:
                given[joint][i] = _parse_number(path, f"grasps.{name}.{key}.{joint}", text)
            else:
                unknown.add(joint)
    with np.errstate(all="ignore"):
        of_joints = [gripper.width({joint: q}) for joint, q in given.items()]
        stacked = np.stack(of_joints) if of_joints else np.empty((0, len(grasps)))
        count = (~np.isnan(stacked)).sum(axis=0)
        widths = np.where(count > 0, np.nansum(stacked, axis=0) / count, np.nan)
    note = f"{key}: joints that hand {gripper.name!r} does not have were ignored"
    return widths, (f"{note}: {list_names(sorted(unknown))}.",) if unknown else ()


def _extra_columns(
    grasps: Mapping[str, Mapping[str, Any]],
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """Columns of single values under foreign keys, and a note about the rest."""
    # Keys of a grasp that this reader interprets.
    known_keys = (
        "confidence",
        "position",
        "orientation",
        IsaacGraspKeys.closed_joints,
        IsaacGraspKeys.open_joints,
    )
    # Columns that keys of a file cannot fill.
    reserved_columns = (*FIXED_COLUMNS, "name", PREGRASP_WIDTH_COLUMN)
    keys = dict.fromkeys(key for g in grasps.values() for key in g if key not in known_keys)
    columns: dict[str, NDArray[Any]] = {}
    left = []
    for key in keys:
        values = [g.get(key, "") for g in grasps.values()]
        if key in reserved_columns or not all(isinstance(value, str) for value in values):
            left.append(key)
            continue
        try:
            columns[key] = np.array([float(v) if v else np.nan for v in values])
        except ValueError:
            columns[key] = np.array(values, dtype=str)
    return columns, (f"Ignored: {list_names(left)} of each grasp.",) if left else ()


def _parse_numbers(
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
            _parse_number(path, where, value)
        elif len(value) != shape[0]:
            raise _value_error(path, where, value, f"{shape[0]} numbers")
        else:
            for text in value:
                _parse_number(path, where, text)
    raise AssertionError("one of the values is not a finite number")


def _parse_number(path: Path, where: str, text: Any) -> float:
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = np.nan
    if not np.isfinite(value):
        raise _value_error(path, where, text, "a finite number")
    return value


def _value_error(path: Path, where: str, given: Any, expected: str) -> DocumentError:
    if given is None:
        return DocumentError(f"{path}: {where}: missing; expected {expected}")
    shown = quote_value(given) if isinstance(given, str) else f"a {type(given).__name__}"
    return DocumentError(f"{path}: {where}: {shown} instead of {expected}")


def write_isaac_grasp(
    dialect: IsaacDialect, grasps: GraspSet, path: Path, gripper: Gripper
) -> tuple[str, ...]:
    """Writes the grasps of one object; returns what the file cannot carry.

    Args:
        dialect: of the file.
        grasps: of one object.
        path: the file.
        gripper: the hand of the grasps.

    Raises:
        InvalidInputError: grasps of several objects, or the place cannot be written to.
    """
    object = require_single_object(grasps, f"a file of {dialect.title}")
    X_OF = grasps.X_OG @ dialect.X_GF(gripper)
    q = quaternion_from_rotation(X_OF[:, :3, :3])
    closed = gripper.positions(grasps.width)
    opening = grasps.columns.get(PREGRASP_WIDTH_COLUMN, np.full(len(grasps), gripper.opening[1]))
    opened = gripper.positions(opening)
    joints = dialect.names_gripper_frame
    frames = [
        f"object_frame_link: {json.dumps(f'/World/{object}')}",
        f"gripper_frame_link: {json.dumps(f'/World/{gripper.body}')}",
    ]
    lines = ["format: isaac_grasp", "format_version: 1.0", *(frames if joints else ()), "grasps:"]
    for i, name in enumerate(_grasp_names(grasps)):
        score = grasps.score[i]
        confidence = ".nan" if np.isnan(score) else _yaml_number(score)
        lines += [
            f"  {json.dumps(name)}:",
            f"    confidence: {confidence}",
            f"    position: {_yaml_list(X_OF[i, :3, 3])}",
            f"    orientation: {{w: {_yaml_number(q[i, 0])}, xyz: {_yaml_list(q[i, 1:])}}}",
        ]
        if joints and not np.isnan(grasps.width[i]):
            lines += [f"    {IsaacGraspKeys.closed_joints}:"]
            lines += [f"      {joint}: {_yaml_number(p[i])}" for joint, p in closed.items()]
        if joints and not np.isnan(opening[i]):
            lines += [f"    {IsaacGraspKeys.open_joints}:"]
            lines += [f"      {joint}: {_yaml_number(p[i])}" for joint, p in opened.items()]
    atomic_write(path, "\n".join(lines) + "\n")
    beyond = _notes_on_widths(grasps.width, opening, gripper) if joints else ()
    return (*beyond, *_notes_on_losses(grasps, dialect))


def _notes_on_widths(width: Array, opening: Array, gripper: Gripper) -> tuple[str, ...]:
    """A note if the hand cannot open or close so far."""
    opening_tolerance = 1e-6  # Metres by which single precision may exceed the hand's opening.
    low, high = gripper.opening
    off = [(w < low - opening_tolerance) | (w > high + opening_tolerance) for w in (width, opening)]
    count = int((off[0] | off[1]).sum())
    limits = f"the opening of hand {gripper.name!r}, {low:g} to {high:g} m; so are their joints."
    return (f"widths of {count} grasps are outside {limits}",) if count else ()


def _notes_on_losses(grasps: GraspSet, dialect: IsaacDialect) -> tuple[str, ...]:
    notes = []
    known = grasps.score[~np.isnan(grasps.score)]
    if len(known) < len(grasps):
        without = len(grasps) - len(known)
        whose = "1 grasp has" if without == 1 else f"{without} grasps have"
        notes.append(f"{whose} no score: confidence is .nan there.")
    if len(known) and not (known.min() >= 0.0 and known.max() <= 1.0):
        notes.append(
            f"{dialect.title} expects a confidence from 0 to 1; the scores, {known.min():.3g} to"
            f" {known.max():.3g}, are written as they are."
        )
    of_hand = ("object", "width", PREGRASP_WIDTH_COLUMN) if dialect.names_gripper_frame else ()
    return (*notes, *conversion_losses(grasps, ("score", "name", *of_hand), dialect.title))


def _grasp_names(grasps: GraspSet) -> list[str]:
    """Those that the grasps have, if they differ; else numbers."""
    given = grasps.columns.get("name", np.array([], dtype=str))
    names = [str(name) for name in given.tolist()]
    if all(names) and len(set(names)) == len(grasps):
        return names
    return [f"grasp_{i}" for i in range(len(grasps))]


def _yaml_list(values: Array) -> str:
    return f"[{', '.join(map(_yaml_number, values))}]"


def _yaml_number(value: float) -> str:
    """A number that YAML 1.1 takes for one: `1e-05` would be text, `1.0e-05` is not."""
    text = repr(float(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


_FORMAT_LINE = re.compile(rb"^[\"']?format[\"']?\s*:\s*[\"']?isaac_grasp\b", re.MULTILINE)
_GRIPPER_KEY = re.compile(
    rb"^[\"']?gripper_(frame|frame_link|file)[\"']?\s*:|cspace_position", re.MULTILINE
)
"""A key that describes the gripper or its joints."""


def _isaac_X_GF(gripper: Gripper) -> Array:
    """The hand's body."""
    return gripper.X_GH


def _has_gripper_frame(path: Path) -> bool:
    """Text with `format: isaac_grasp` that says something of the gripper."""
    return describes_gripper(path) is True


def describes_gripper(path: Path) -> bool | None:
    """Whether text with the line `format: isaac_grasp` has a gripper frame, a gripper's file or
    joints, which GraspGen does not write; None for other files."""
    # Bytes read at each end of a file; sorted keys have the gripper after the grasps.
    block_size = 1 << 16
    try:
        with path.open("rb") as stream:
            text = stream.read(block_size)
            stream.seek(max(block_size, path.stat().st_size - block_size))
            text += stream.read(block_size)
    except OSError:
        return None
    return _GRIPPER_KEY.search(text) is not None if _FORMAT_LINE.search(text) else None


_ISAAC_DIALECT = IsaacDialect(
    "isaac_grasp", "Isaac Sim grasp editor", _isaac_X_GF, names_gripper_frame=True
)
"""Files of Isaac Sim, with a gripper frame."""

ISAAC_GRASP_FORMAT = GraspFormat(
    name=_ISAAC_DIALECT.name,
    title=_ISAAC_DIALECT.title,
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="Isaac Sim manual, Grasp Editor; Isaac ROS manual, Isaac Grasp File",
    carries=("score as confidence", "width as finger joints", "names of grasps"),
    cannot_carry=("ids", "several objects", "further columns", "scale of the object"),
    X_GF=_isaac_X_GF,
    recognises=_has_gripper_frame,
    read=partial(read_isaac_grasp, _ISAAC_DIALECT),
    write=partial(write_isaac_grasp, _ISAAC_DIALECT),
    one_object=True,
)
"""The format of Isaac Sim's grasp editor."""


def _graspgen_X_GF(gripper: Gripper) -> Array:
    """The hand's base, x along the closing direction."""
    return gripper.X_GB


def _lacks_gripper_frame(path: Path) -> bool:
    """`isaac_grasp` YAML without a gripper frame."""
    return describes_gripper(path) is False


_GRASPGEN_DIALECT = IsaacDialect(
    "graspgen_yaml", "GraspGen predictions", _graspgen_X_GF, names_gripper_frame=False
)
"""Predictions of GraspGen, without a gripper frame."""

GRASPGEN_YAML_FORMAT = GraspFormat(
    name=_GRASPGEN_DIALECT.name,
    title=_GRASPGEN_DIALECT.title,
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="github.com/NVlabs/GraspGen, grasp_gen/dataset/eval_utils.py",
    carries=("score as confidence", "names of grasps"),
    cannot_carry=("ids", "several objects", "the object's name", "width", "further columns"),
    X_GF=_graspgen_X_GF,
    recognises=_lacks_gripper_frame,
    read=partial(read_isaac_grasp, _GRASPGEN_DIALECT),
    write=partial(write_isaac_grasp, _GRASPGEN_DIALECT),
    one_object=True,
)
"""The format of GraspGen's predictions."""
