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
from collections.abc import Mapping
from dataclasses import replace
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
    file_provenance,
)

CLOSED_JOINTS_KEY = "cspace_position"
"""Key of the joint positions while the object is held."""
OPEN_JOINTS_KEY = "pregrasp_cspace_position"
"""Key of the joint positions on approach."""
GRIPPER_FRAME_KEYS = ("gripper_frame_link", "gripper_frame")
"""Keys of the gripper frame, in Isaac Sim and in Isaac ROS."""
OBJECT_KEYS = ("object_file", "object_frame_link", "object_frame")
"""Keys that name the object, the preferred one first."""


def read_isaac_grasp(format: GraspFormat, path: Path, gripper: Gripper) -> ImportedGrasps:
    """Reads the grasps of a file; `score` is the confidence.

    Args:
        format: format of the file, Isaac Sim's or GraspGen's.
        path: the file.
        gripper: the hand of the grasps.

    Raises:
        DocumentError: no such file, or an invalid value; the message says where.
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
    object, description = _read_object(path, document)
    X_FG = inverse(format.X_GF(gripper))
    columns: dict[str, NDArray[Any]] = {"name": np.array(list(grasps), dtype=str)}
    width, width_notes = _widths_from_joints(path, grasps, CLOSED_JOINTS_KEY, gripper)
    opening, _ = _widths_from_joints(path, grasps, OPEN_JOINTS_KEY, gripper)
    if not np.isnan(opening).all():
        columns[PREGRASP_WIDTH_COLUMN] = opening
    extra_columns, ignored_notes = _extra_columns(grasps)
    notes: tuple[str, ...] = ()
    if not any(key in document for key in GRIPPER_FRAME_KEYS):
        axis = "xyz"[int(np.argmax(np.abs(X_FG[:3, 0])))]
        notes += (
            f"The file names no gripper frame; the fingers were taken to close along its {axis}.",
        )
    if not any(document.get(key) for key in OBJECT_KEYS):
        notes += (f"The file names no object; the object is called {object!r}.",)
    if "scale" in description:
        notes += (scale_note(object, str(description["file"]), float(description["scale"])),)
    set_ = GraspSet.create(
        _read_poses(path, grasps) @ X_FG,
        object=object,
        width=width,
        score=_read_confidences(path, grasps),
        columns={**extra_columns, **columns},
        provenance=file_provenance(format, path, object_files={object: description}),
    )
    return ImportedGrasps(set_, "object", (*notes, *width_notes, *ignored_notes))


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
    key = next((key for key in GRIPPER_FRAME_KEYS if key in document), None)
    link = str(document[key]) if key is not None else ""
    if key is not None and object_name(link) != gripper.body:
        raise DocumentError(
            f"{path}: {key}: {link!r} is not {gripper.body!r}, the frame of hand "
            f"{gripper.name!r}; read the file with the hand that the grasps were made"
            f" for. If the two frames are the same, name {object_name(link)!r} as the"
            " gripper's link"
        ).about("gripper_link", "hand")


def _read_object(path: Path, document: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """The object's name, and its description in the file."""
    file = next((str(document[key]) for key in OBJECT_KEYS if document.get(key)), "")
    description: dict[str, Any] = {"file": file} if "object_file" in document else {}
    if "object_file" in document and "object_scale" in document:
        scale = _parse_numbers(path, {"object_scale": document["object_scale"]}, (), "")[0]
        if not scale > 0.0:
            raise DocumentError(f"{path}: object_scale: {scale:g} must be above 0")
        description["scale"] = float(scale)
    return object_name(file) or path.stem, description


def _read_poses(path: Path, grasps: Mapping[str, Mapping[str, Any]]) -> Array:
    """(N, 4, 4) poses as in the file."""
    positions = {
        name: _require_field(path, name, g, "position", list) for name, g in grasps.items()
    }
    quaternions = {}
    for name, grasp in grasps.items():
        q = _require_field(path, name, grasp, "orientation", dict)
        if "w" not in q or not isinstance(q.get("xyz"), list):
            raise _value_error(
                path, f"grasps.{name}.orientation", q, "{w: ..., xyz: [..., ..., ...]}"
            )
        quaternions[name] = [q["w"], *q["xyz"]]
    p = _parse_numbers(path, positions, (3,), "position")
    q = _parse_numbers(path, quaternions, (4,), "orientation")
    length = np.linalg.norm(q, axis=1)
    off = np.abs(length - 1.0) > 1e-3  # allows five decimals
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
    """(N,) confidences; NaN for grasps without one."""
    given = {name: g["confidence"] for name, g in grasps.items() if "confidence" in g}
    unknown = {name for name, text in given.items() if text in (".nan", ".NaN", ".NAN", "null")}
    known = {name: text for name, text in given.items() if name not in unknown}
    values = dict(zip(known, _parse_numbers(path, known, (), "confidence"), strict=True))
    return np.array([values.get(name, np.nan) for name in grasps], dtype=float)


def _widths_from_joints(
    path: Path, grasps: Mapping[str, Mapping[str, Any]], key: str, gripper: Gripper
) -> tuple[Array, tuple[str, ...]]:
    """(N,) distance between the pads, NaN for grasps without a joint of the hand, and notes."""
    positions = {joint.name: np.full(len(grasps), np.nan) for joint in gripper.joints}
    unknown: set[str] = set()
    for i, (name, grasp) in enumerate(grasps.items()):
        joints = grasp.get(key, {})
        if not isinstance(joints, dict):
            raise _value_error(path, f"grasps.{name}.{key}", joints, "positions by joint")
        for joint, text in joints.items():
            if joint in positions:
                positions[joint][i] = _parse_number(path, f"grasps.{name}.{key}.{joint}", text)
            else:
                unknown.add(joint)
    with np.errstate(all="ignore"):
        joint_widths = [gripper.width({joint: q}) for joint, q in positions.items()]
        stacked = np.stack(joint_widths) if joint_widths else np.empty((0, len(grasps)))
        count = (~np.isnan(stacked)).sum(axis=0)
        widths = np.where(count > 0, np.nansum(stacked, axis=0) / count, np.nan)
    note = f"{key}: joints that hand {gripper.name!r} does not have were ignored"
    return widths, (f"{note}: {list_names(sorted(unknown))}.",) if unknown else ()


def _extra_columns(
    grasps: Mapping[str, Mapping[str, Any]],
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """Columns for unknown keys with single values, and a note about the other keys."""
    interpreted = ("confidence", "position", "orientation", CLOSED_JOINTS_KEY, OPEN_JOINTS_KEY)
    reserved_columns = (*FIXED_COLUMNS, "name", PREGRASP_WIDTH_COLUMN)
    keys = dict.fromkeys(key for g in grasps.values() for key in g if key not in interpreted)
    columns: dict[str, NDArray[Any]] = {}
    ignored = []
    for key in keys:
        values = [g.get(key, "") for g in grasps.values()]
        if key in reserved_columns or not all(isinstance(value, str) for value in values):
            ignored.append(key)
            continue
        try:
            columns[key] = np.array([float(v) if v else np.nan for v in values])
        except ValueError:
            columns[key] = np.array(values, dtype=str)
    return columns, (f"Ignored: {list_names(ignored)} of each grasp.",) if ignored else ()


def _parse_numbers(
    path: Path, given: Mapping[str, Any], shape: tuple[int, ...], key: str
) -> NDArray[np.float64]:
    """(N, *shape) finite numbers from texts; the error names the first invalid value."""
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
    format: GraspFormat, grasps: GraspSet, path: Path, gripper: Gripper
) -> tuple[str, ...]:
    """Writes the grasps of one object; returns notes on data that the file cannot carry.

    Args:
        format: format of the file; GraspGen's has neither frames nor joints.
        grasps: grasps of one object.
        path: the file.
        gripper: the hand of the grasps.

    Raises:
        InvalidInputError: grasps of several objects, or the file cannot be written.
    """
    object = require_single_object(grasps, f"a file of {format.title}")
    X_OF = grasps.X_OG @ format.X_GF(gripper)
    q = quaternion_from_rotation(X_OF[:, :3, :3])
    closed = gripper.positions(grasps.width)
    opening = grasps.columns.get(PREGRASP_WIDTH_COLUMN, np.full(len(grasps), gripper.opening[1]))
    opened = gripper.positions(opening)
    has_gripper = format is ISAAC_GRASP_FORMAT
    frames = [
        f"object_frame_link: {json.dumps(f'/World/{object}')}",
        f"gripper_frame_link: {json.dumps(f'/World/{gripper.body}')}",
    ]
    lines = [
        "format: isaac_grasp",
        "format_version: 1.0",
        *(frames if has_gripper else ()),
        "grasps:",
    ]
    for i, name in enumerate(_grasp_names(grasps)):
        score = grasps.score[i]
        lines += [
            f"  {json.dumps(name)}:",
            f"    confidence: {'.nan' if np.isnan(score) else _yaml_number(score)}",
            f"    position: {_yaml_list(X_OF[i, :3, 3])}",
            f"    orientation: {{w: {_yaml_number(q[i, 0])}, xyz: {_yaml_list(q[i, 1:])}}}",
        ]
        joints = ((CLOSED_JOINTS_KEY, grasps.width, closed), (OPEN_JOINTS_KEY, opening, opened))
        for key, width, positions in joints if has_gripper else ():
            if not np.isnan(width[i]):
                lines += [f"    {key}:"]
                lines += [f"      {joint}: {_yaml_number(p[i])}" for joint, p in positions.items()]
    atomic_write(path, "\n".join(lines) + "\n")
    notes = _notes_on_widths(grasps.width, opening, gripper) if has_gripper else ()
    return (*notes, *_notes_on_losses(grasps, format))


def _notes_on_widths(width: Array, opening: Array, gripper: Gripper) -> tuple[str, ...]:
    """A note if the hand cannot open or close to these widths."""
    low, high = gripper.opening
    tolerance = 1e-6  # metres, for widths in single precision
    outside = [(w < low - tolerance) | (w > high + tolerance) for w in (width, opening)]
    count = int((outside[0] | outside[1]).sum())
    limits = f"the opening of hand {gripper.name!r}, {low:g} to {high:g} m; so are their joints."
    return (f"widths of {count} grasps are outside {limits}",) if count else ()


def _notes_on_losses(grasps: GraspSet, format: GraspFormat) -> tuple[str, ...]:
    notes = []
    known = grasps.score[~np.isnan(grasps.score)]
    if len(known) < len(grasps):
        without = len(grasps) - len(known)
        whose = "1 grasp has" if without == 1 else f"{without} grasps have"
        notes.append(f"{whose} no score: confidence is .nan there.")
    if len(known) and not (known.min() >= 0.0 and known.max() <= 1.0):
        notes.append(
            f"{format.title} expects a confidence from 0 to 1; the scores, {known.min():.3g} to"
            f" {known.max():.3g}, are written as they are."
        )
    of_hand = ("object", "width", PREGRASP_WIDTH_COLUMN) if format is ISAAC_GRASP_FORMAT else ()
    return (*notes, *conversion_losses(grasps, ("score", "name", *of_hand), format.title))


def _grasp_names(grasps: GraspSet) -> list[str]:
    """Names of the grasps if these are unique, else numbers."""
    given = grasps.columns.get("name", np.array([], dtype=str))
    names = [str(name) for name in given.tolist()]
    if all(names) and len(set(names)) == len(grasps):
        return names
    return [f"grasp_{i}" for i in range(len(grasps))]


def _yaml_list(values: Array) -> str:
    return f"[{', '.join(map(_yaml_number, values))}]"


def _yaml_number(value: float) -> str:
    """A number in a form that YAML 1.1 reads as a number: `1.0e-05`, as `1e-05` would be text."""
    text = repr(float(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


_FORMAT_LINE = re.compile(rb"^[\"']?format[\"']?\s*:\s*[\"']?isaac_grasp\b", re.MULTILINE)
_GRIPPER_KEY = re.compile(
    rb"^[\"']?gripper_(frame|frame_link|file)[\"']?\s*:|cspace_position", re.MULTILINE
)
"""A key that describes the gripper or its joints."""


def describes_gripper(path: Path) -> bool | None:
    """Whether an `isaac_grasp` file has a gripper frame, gripper file or joints, which GraspGen
    does not write; None for files without the line `format: isaac_grasp`."""
    block_size = 1 << 16  # read at both ends, as sorted keys have the gripper after the grasps
    try:
        with path.open("rb") as stream:
            text = stream.read(block_size)
            stream.seek(max(block_size, path.stat().st_size - block_size))
            text += stream.read(block_size)
    except OSError:
        return None
    return _GRIPPER_KEY.search(text) is not None if _FORMAT_LINE.search(text) else None


ISAAC_GRASP_FORMAT: GraspFormat = GraspFormat(
    name="isaac_grasp",
    title="Isaac Sim grasp editor",
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="Isaac Sim manual, Grasp Editor; Isaac ROS manual, Isaac Grasp File",
    carries=("score as confidence", "width as finger joints", "names of grasps"),
    cannot_carry=("ids", "several objects", "further columns", "scale of the object"),
    X_GF=lambda gripper: gripper.X_GH,
    recognises=lambda path: describes_gripper(path) is True,
    read=lambda path, gripper: read_isaac_grasp(ISAAC_GRASP_FORMAT, path, gripper),
    write=lambda grasps, path, hand: write_isaac_grasp(ISAAC_GRASP_FORMAT, grasps, path, hand),
    one_object=True,
)
"""The format of Isaac Sim's grasp editor, with a gripper frame: the hand's body."""

GRASPGEN_YAML_FORMAT: GraspFormat = replace(
    ISAAC_GRASP_FORMAT,
    name="graspgen_yaml",
    title="GraspGen predictions",
    source="github.com/NVlabs/GraspGen, grasp_gen/dataset/eval_utils.py",
    carries=("score as confidence", "names of grasps"),
    cannot_carry=("ids", "several objects", "the object's name", "width", "further columns"),
    X_GF=lambda gripper: gripper.X_GB,
    recognises=lambda path: describes_gripper(path) is False,
    read=lambda path, gripper: read_isaac_grasp(GRASPGEN_YAML_FORMAT, path, gripper),
    write=lambda grasps, path, hand: write_isaac_grasp(GRASPGEN_YAML_FORMAT, grasps, path, hand),
)
"""The format of GraspGen's predictions: the hand's base, x along the closing direction."""
