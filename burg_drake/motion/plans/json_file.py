"""Plans as JSON.

`joint_trajectory` is laid out as ROS's message `trajectory_msgs/JointTrajectory`; beside it
there is what the plan is for, the limits that it keeps, the samples a second, and where its phases
are among the points. `csv_file` has the same as a table.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import Array, DocumentError, InvalidInputError
from burg_drake.core.documents import load_json
from burg_drake.core.files import GRASP_FILE, atomic_write, format_rows
from burg_drake.motion.plans.plan_record import (
    NANO,
    Spans,
    assembled,
    joint_names,
    part,
    plan_data,
    read_data,
    require_version,
    require_writable,
    spans_of,
)
from burg_drake.motion.plans.planned_motion import PHASES, PlannedMotion


def write_json(plan: PlannedMotion, path: str | Path) -> None:
    """Writes a plan whole, for `load_plan` and others.

    Raises:
        InvalidInputError: the place cannot be written to, or the samples are not evenly spaced, or
            no finite numbers.
    """
    require_writable(plan)
    whole = plan.whole
    stamps = np.rint(whole.t * NANO).astype(int).tolist()
    rows = zip(stamps, *(format_rows(x, ", ") for x in (whole.q, whole.v, whole.a)), strict=True)
    points = ", ".join(
        f'{{"positions": [{q}], "velocities": [{v}], "accelerations": [{a}],'
        f' "time_from_start": {{"sec": {time // NANO}, "nanosec": {time % NANO}}}}}'
        for time, q, v, a in rows
    )
    document = plan_data(plan) | {
        "phases": {name: list(span) for name, span in spans_of(plan).items()},
        "joint_trajectory": {"joint_names": list(joint_names(plan)), "points": []},
    }
    text = json.dumps(document, allow_nan=False)
    atomic_write(path, text.removesuffix("]}}") + points + "]}}\n")


def read_json(path: Path) -> PlannedMotion:
    """Reads what `write_json` has written.

    Raises:
        InvalidInputError: see `load_plan`.
    """
    try:
        document = load_json(path, GRASP_FILE)
    except DocumentError as error:
        raise DocumentError(
            f"{error}; give a file that Plan.to_json or Plan.to_csv wrote"
        ) from error
    require_version(document, path)
    try:
        return _plan(document)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: the plan is damaged: {error}; write it again") from error


def _plan(document: dict[str, Any]) -> PlannedMotion:
    with part(document, "joint_trajectory") as motion:
        joints = tuple(str(name) for name in motion["joint_names"])
        rows = _rows(motion["points"], len(joints))
        stamps = [point["time_from_start"] for point in motion["points"]]
        t = np.array([stamp["sec"] + stamp["nanosec"] / NANO for stamp in stamps], dtype=float)
    description = read_data(document, joints)
    with part(document, "phases") as phases:
        spans: Spans = {name: (first, last) for name, (first, last) in phases.items()}
        if spans.keys() - set(PHASES):
            raise KeyError(spans)
        return assembled(description, t, spans, rows)


def _rows(points: list[dict[str, Any]], n: int) -> list[Array]:
    """Positions, velocities and accelerations, (T, n) each."""
    found = []
    for name in ("positions", "velocities", "accelerations"):
        for k, point in enumerate(points):
            if len(point[name]) != n or not np.isfinite(point[name]).all():
                raise InvalidInputError(f"{name} of point {k} must be {n} finite numbers")
        found.append(np.array([point[name] for point in points], dtype=float))
    return found
