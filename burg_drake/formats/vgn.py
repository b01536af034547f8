"""VGN and GIGA: `grasps.csv`, with one grasp and its simulated outcome in each line.

From the sources of github.com/ethz-asl/vgn and github.com/UT-Austin-RPL/GIGA:

- Columns scene_id, qx, qy, qz, qw, x, y, z, width, label (`write_grasp` in src/vgn/io.py). A data
  set has one file for all of its scenes; `label` is 1 for a grasp that lifted something, else 0.
- Poses are in the frame of the workspace, a cube of 6 finger depths, 0.3 m, with its origin in a
  lower corner; the table is at z = 0.05 m (`ClutterRemovalSim` in src/vgn/simulation.py).
- z is the approach and y the closing direction, as in Franka's hand frame. The fingers begin at
  the origin and end `finger_depth`, 0.05 m, along z (`_gripper_lines` in src/vgn/vis.py;
  `sample_grasp_point` in GIGA's scripts/generate_data_parallel.py puts the origin up to that far
  above the surface). On the hand that is, on the robot, 0.065 m from the flange
  (`ee_grasp_offset` in config/panda_grasp.yaml, marked there as to be checked), which would leave
  0.048 m to our finger tips, and in simulation 0.022 m from the hand's centre of mass, which is
  in a URDF outside of the repository. We take the 0.05 m that the grasps were sampled with.
- `width` is the distance of the fingers after closing where the grasp lifted something, else
  the hand's largest opening (`execute_grasp`), which tells nothing of the grasp.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    UNTRIED_OUTCOMES,
    Array,
    GraspSet,
    InvalidInputError,
    Outcome,
    atomic_write,
    inverse,
    make_pose,
    open_regular,
    quaternion_from_rotation,
    quote_value,
    read_rows,
    rot_z,
    rotation_from_quaternion,
    shorten_text,
)
from burg_drake.formats.grasp_format import (
    GraspFormat,
    Gripper,
    ImportedGrasps,
    conversion_losses,
    file_provenance,
)

POSE_COLUMNS = ("qx", "qy", "qz", "qw", "x", "y", "z")
"""Rotation and position in metres; files of predictions may have no other columns."""
VGN_COLUMNS = ("scene_id", *POSE_COLUMNS, "width", "label")
"""All columns of a file."""


def _X_GF(gripper: Gripper) -> Array:
    finger_depth = 0.05  # metres from the origin of a grasp to the finger tips
    return make_pose(rot_z(-np.pi / 2), (0.0, 0.0, gripper.tip - finger_depth))


def _recognise(path: Path) -> bool:
    try:
        with open_regular(path) as stream:
            line = stream.readline(1 << 16).decode("utf-8-sig")
        header = next(csv.reader([line]), [])
    except (InvalidInputError, UnicodeDecodeError, csv.Error):
        return False
    names = {name.strip() for name in header}
    return set(POSE_COLUMNS) <= names and "X_OG" not in names


def _read(path: Path, gripper: Gripper) -> ImportedGrasps:
    cells, lines = _read_cells(path)
    missing = [name for name in POSE_COLUMNS if name not in cells]
    if missing:
        raise InvalidInputError(
            f"{path} has no column {', '.join(missing)}; a file of VGN has the columns "
            f"{','.join(VGN_COLUMNS)}"
        )
    pose = [_parse_numbers(path, name, cells[name], lines) for name in POSE_COLUMNS]
    xyzw, p_VF = np.stack(pose[:4], axis=-1), np.stack(pose[4:], axis=-1)
    length = np.linalg.norm(xyzw, axis=-1)
    bad = ~(np.abs(length - 1.0) < 1e-3)
    if bad.any():
        i = int(np.argmax(bad))
        raise InvalidInputError(
            f"{path}:{lines[i]}: qx, qy, qz, qw have length {length[i]:g}; a rotation has length 1"
        )
    X_VF = make_pose(rotation_from_quaternion(np.roll(xyzw, 1, axis=-1)), p_VF)
    columns: dict[str, NDArray[Any]] = {
        name: np.array(texts) if name == "scene_id" else _parse_column(texts)
        for name, texts in cells.items()
        if name not in (*POSE_COLUMNS, "width")
    }
    width: Array | None = None
    notes: tuple[str, ...] = ()
    if "width" in cells:
        width = _parse_numbers(path, "width", cells["width"], lines)
        width, notes = _contact_widths(width, columns.get("label"))
    grasps = GraspSet.create(
        X_VF @ inverse(_X_GF(gripper)),
        object="",
        width=width,
        provenance=file_provenance(VGN_FORMAT, path),
        columns=columns,
    )
    return ImportedGrasps(grasps, VGN_FORMAT.frame, notes)


def _contact_widths(width: Array, label: NDArray[Any] | None) -> tuple[Array, tuple[str, ...]]:
    """(N,) widths, NaN for failed grasps, and a note if there were some."""
    if label is None or label.dtype.kind != "f":
        return width, ()
    failed = ~np.isnan(width) & (label == 0.0)
    note = f"the width of {int(failed.sum())} failed grasps was ignored: it is the open hand's."
    return np.where(failed, np.nan, width), (note,) if failed.any() else ()


def _read_cells(path: Path) -> tuple[dict[str, list[str]], list[int]]:
    """Texts of a CSV file by column, and the line numbers on which they end."""
    numbered = read_rows(path)
    if not numbered:
        raise InvalidInputError(
            f"{path} is empty; a file of VGN has the columns {','.join(VGN_COLUMNS)}"
        )
    (first, names), *rows = numbered
    header = [name.strip() for name in names]
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise InvalidInputError(f"{path}:{first}: column {quote_value(twice)} appears twice")
    for line, row in rows:
        if len(row) != len(header):
            raise InvalidInputError(
                f"{path}:{line}: the row has {len(row)} cells, the header has {len(header)}"
            )
    cells = {name: [row[k].strip() for _, row in rows] for k, name in enumerate(header)}
    return cells, [line for line, _ in rows]


def _parse_numbers(path: Path, name: str, texts: Sequence[str], lines: Sequence[int]) -> Array:
    """A column of finite numbers; widths may be NaN."""
    values = np.empty(len(texts))
    for i, text in enumerate(texts):
        try:
            values[i] = float(text) if text or name != "width" else np.nan
        except ValueError as error:
            where = f"{path}:{lines[i]}: {name}"
            raise InvalidInputError(f"{where} is {quote_value(text)}, not a number") from error
    bad = np.isinf(values) | (np.isnan(values) & (name != "width"))
    if bad.any():
        i = int(np.argmax(bad))
        raise InvalidInputError(
            f"{path}:{lines[i]}: {name} is {shorten_text(texts[i])}; give a finite number"
        )
    return values


def _parse_column(texts: Sequence[str]) -> NDArray[Any]:
    """Numbers if all cells are numbers or empty (NaN); else texts."""
    try:
        return np.array([float(text) if text else np.nan for text in texts])
    except ValueError:
        return np.array(texts)


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    notes = conversion_losses(grasps, ("width", "label", "outcome", "scene_id"), VGN_FORMAT.title)
    X_VF = grasps.X_OG @ _X_GF(gripper)
    xyzw = np.roll(quaternion_from_rotation(X_VF[:, :3, :3]), -1, axis=-1)
    scene_id = grasps.columns.get("scene_id", np.full(len(grasps), path.stem))
    label = _success_labels(grasps)
    if label is None:
        notes += ("No grasp has a label; the cells for it are empty.",)
        label = [""] * len(grasps)
    failed = np.array([mark == 0 for mark in label], dtype=bool)
    if failed.any():
        widest = f"{gripper.opening[1]:g} m"
        notes += (
            f"{int(failed.sum())} failed grasps got the hand's opening of {widest} as width.",
        )
    widths = np.where(failed, gripper.opening[1], grasps.width)
    if np.isnan(widths).any():
        notes += (f"{int(np.isnan(widths).sum())} grasps have no width; their cells are empty.",)
    width = ["" if np.isnan(w) else w for w in widths.tolist()]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(VGN_COLUMNS)
    numbers = np.column_stack([xyzw, X_VF[:, :3, 3]]).tolist()
    for id, row, w, mark in zip(scene_id.tolist(), numbers, width, label, strict=True):
        writer.writerow([id, *row, w, mark])
    atomic_write(path, stream.getvalue())
    return notes


def _success_labels(grasps: GraspSet) -> list[Any] | None:
    """Labels 1 for success, 0 for failure and empty if unknown, from the label that came with the
    grasps or else the outcome of their trials; None if all are unknown."""
    if "label" in grasps.columns:
        return [_label_text(value) for value in grasps.columns["label"].tolist()]
    if "outcome" in grasps.columns:
        outcomes = grasps.columns["outcome"].tolist()
        return [
            "" if text in UNTRIED_OUTCOMES else int(text == Outcome.LIFTED) for text in outcomes
        ]
    return None


def _label_text(value: Any) -> Any:
    """Whole numbers without a decimal point, as VGN writes them; an empty text for NaN."""
    if isinstance(value, str):
        return value
    if value != value:
        return ""
    return int(value) if float(value).is_integer() else value


VGN_FORMAT = GraspFormat(
    name="vgn",
    title="VGN and GIGA",
    suffixes=(".csv",),
    frame="world",
    source="github.com/ethz-asl/vgn, src/vgn/io.py",
    carries=("width of successes", "label", "scene_id"),
    cannot_carry=("ids", "score", "names of objects", "further columns", "provenance"),
    X_GF=_X_GF,
    recognises=_recognise,
    read=_read,
    write=_write,
)
"""The format of VGN and GIGA."""
