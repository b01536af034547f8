"""Plans as tables: CSV with a row a sample, and beside it a file by the standard of CSV on the Web
that has the units of its columns and what the plan is for; see `core.grasps.csv_metadata_file`.

Columns are `t` [s], `phase`, `q_JOINT`, `v_JOINT` and `a_JOINT` of each joint, and `width`, the
wanted distance between the pads [m]: from when the hand closes that of the target, on which it
presses with its force, or 0 if nobody knows it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import Array, InvalidInputError, quoted
from burg_drake.core.documents import load_json
from burg_drake.core.files import GRASP_FILE, READ_ERRORS, atomic_write_all, format_rows, read_rows
from burg_drake.core.grasps import TEXT, Column, csv_metadata, metadata_path
from burg_drake.motion.plans.plan_record import (
    assembled,
    closed,
    joint_names,
    plan_data,
    read_data,
    require_version,
    require_writable,
    spans_of,
)
from burg_drake.motion.plans.planned_motion import PHASES, PlannedMotion

CsvRows = Sequence[tuple[int, list[str]]]
"""Cells of samples, with the line of the file that they are on."""
WIDTH_TOLERANCE = 1e-6
"""What rounding by other programs may change of a width [m]."""
KINDS = {
    "q": ("rad", "position of joint {}; m of a joint that slides"),
    "v": ("rad/s", "velocity of joint {}; m/s of a joint that slides"),
    "a": ("rad/s2", "acceleration of joint {}; m/s2 of a joint that slides"),
}
"""Unit and meaning of a joint's columns, by what begins their names."""


def write_csv(plan: PlannedMotion, path: str | Path) -> None:
    """Writes the samples of all phases as a table, and what they are for beside it.

    Raises:
        InvalidInputError: the place cannot be written to, or the samples are not evenly spaced, or
            no finite numbers.
    """
    path, whole = Path(path), plan.whole
    require_writable(plan)
    joints = joint_names(plan)
    meanings = _meanings(joints)
    lines = [",".join(map(_cell, meanings))]
    times = format_rows(whole.t[:, None])
    rows = format_rows(np.hstack([whole.q, whole.v, whole.a]))
    for phase, (first, last) in spans_of(plan).items():
        start, end = first if first == 0 else first + 1, f",{_width(plan, phase)}"
        lines += [f"{times[k]},{phase},{rows[k]}{end}" for k in range(start, last + 1)]
    described = json.dumps(csv_metadata(path.name, meanings, [plan_data(plan)]), indent=1)
    atomic_write_all({metadata_path(path): described + "\n", path: "\n".join(lines) + "\n"})


def read_csv(path: Path) -> PlannedMotion:
    """Reads what `write_csv` has written; the table alone is a plan that does not tell what it is
    for.

    Raises:
        InvalidInputError: see `load_plan`.
    """
    rows = read_rows(path, GRASP_FILE)
    header = rows.pop(0)[1] if rows else []
    joints = tuple(name[2:] for name in header if name.startswith("q_"))
    if not joints or header != list(_meanings(joints)):
        raise InvalidInputError(
            f"{path} is not a plan: it must have the columns t, phase, q_JOINT, v_JOINT, a_JOINT,"
            " width"
        )
    beside = metadata_path(path)
    try:
        data = _data_beside(beside, header) if beside.exists() else None
        return _plan(rows, joints, data)
    except InvalidInputError as error:
        if str(beside) in str(error):
            raise
        raise InvalidInputError(f"{path}: the plan is damaged: {error}; write it again") from error


def _data_beside(path: Path, header: Sequence[str]) -> dict[str, Any]:
    """What the file beside a table says of the plan."""
    document = load_json(path)
    try:
        (data,) = document["notes"]
        titles = [column["titles"] for column in document["tableSchema"]["columns"]]
    except READ_ERRORS as error:
        raise InvalidInputError(f"{path} does not describe a plan; write the plan again") from error
    if titles != list(header):
        raise InvalidInputError(
            f"{path} describes a table with other columns; write the plan again"
        )
    require_version(data, path)
    return dict(data)


def _plan(rows: CsvRows, joints: tuple[str, ...], data: Any) -> PlannedMotion:
    n = len(joints)
    for line, row in rows:
        if len(row) != 3 * n + 3:
            raise InvalidInputError(f"line {line} has {len(row)} cells; expected {3 * n + 3}")
    spans = _read_spans(rows)
    t = np.array([_number(row[0], "t", line) for line, row in rows])
    names = [f"{kind}_{joint}" for kind in KINDS for joint in joints]
    values = np.empty((len(rows), 3 * n))
    for k, (line, row) in enumerate(rows):
        try:
            values[k] = row[2:-1]
        except ValueError:
            values[k] = [_number(c, m, line) for c, m in zip(row[2:-1], names, strict=True)]
    if not np.isfinite(values).all():
        k, column = np.argwhere(~np.isfinite(values))[0]
        raise InvalidInputError(f"{names[column]} in line {rows[k][0]} is not a finite number")
    q, v, a = np.hsplit(values, 3)
    if data is None:
        data = _described_by_rows(rows, t, spans)
    plan = assembled(read_data(data, joints), t, spans, (q, v, a))
    _require_widths(plan, rows)
    return plan


def _require_widths(plan: PlannedMotion, rows: CsvRows) -> None:
    """The hand is open until it closes, and then as wide as the target in all rows."""
    for line, (_, phase, *_, text) in rows:
        wanted = _width(plan, phase)
        if text == wanted:
            continue
        if not (wanted and abs(_number(text, "width", line) - float(wanted)) <= WIDTH_TOLERANCE):
            raise InvalidInputError(
                f"width in line {line} is {quoted(text)}; in phase {phase!r} of this plan it is"
                f" {quoted(wanted)}"
            )


def _read_spans(rows: CsvRows) -> dict[str, tuple[int, int]]:
    """First and last row of each phase."""
    spans: dict[str, tuple[int, int]] = {}
    for k, (line, row) in enumerate(rows):
        name = row[1]
        if name not in PHASES:
            raise InvalidInputError(
                f"line {line} has phase {quoted(name)}; expected one of {', '.join(PHASES)}"
            )
        if name in spans and spans[name][1] != k - 1:
            raise InvalidInputError(f"phase {name!r} starts a second time in line {line}")
        spans[name] = (spans[name][0] if name in spans else max(0, k - 1), k)
    return spans


def _described_by_rows(
    rows: CsvRows, t: Array, spans: dict[str, tuple[int, int]]
) -> dict[str, Any]:
    """What a table alone tells of its plan."""
    step = float(t[1]) if len(t) > 1 else 0.0
    if not step > 0.0:
        raise InvalidInputError("the times t do not increase from 0")
    near = round(1.0 / step, 6)
    first, last = spans.get("close", (0, 0))
    widths = [_number(r[-1], "width", n) if r[-1] else None for n, r in (rows[0], rows[-1])]
    rate = near if near and 1.0 / near == step else 1.0 / step
    hand = {"opening": widths[0], "width": widths[1] or None, "close_time": (last - first) / rate}
    return {"rate": rate, "hand": hand, "origin": None}


def _number(text: str, name: str, line: int) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError(
            f"{name} in line {line} is {quoted(text)}, which is not a number"
        ) from error


def _width(plan: PlannedMotion, phase: str) -> str:
    """Commanded distance between the pads [m]; empty if nobody knows how wide an open hand is."""
    width = plan.width if closed(phase) else plan.opening
    if np.isnan(width):
        return "0.0" if closed(phase) else ""
    return repr(float(width))


def _meanings(joints: Sequence[str]) -> dict[str, tuple[str, Column]]:
    """Datatype, unit and meaning of each column."""
    moves = {
        f"{kind}_{joint}": ("double", Column(unit, text.format(joint)))
        for kind, (unit, text) in KINDS.items()
        for joint in joints
    }
    return {
        "t": ("double", Column("s", "time since the plan's beginning")),
        "phase": ("string", Column(TEXT, f"one of {', '.join(PHASES)}")),
        **moves,
        "width": ("double", Column("m", "wanted distance between the pads; 0: closed")),
    }


def _cell(text: str) -> str:
    """A text of the header, quoted where that is needed."""
    quotes = any(sign in text for sign in ',"\n\r')
    return '"' + text.replace('"', '""') + '"' if quotes else text
