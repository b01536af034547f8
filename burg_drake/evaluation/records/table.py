"""The results table: its columns, one row a trial, in the order of the candidates.

    id, instance, object      which grasp on what; the id is what `burg-drake replay` takes
    outcome, stage            the one outcome, and the stage that decided it
    blocker, reason           the body in the way; the simulator's message if it failed
    width, score              distance of the contacts [m]; the sampler's score
    x, y, z, qw, qx, qy, qz   grasp frame in the object frame [m; quaternion]
    overlap ... end_time      margins, see `core.grasps.Margins` (SI units)
    moved_NAME                peak displacement of each object that was not the target [m]
    arm_clearance ... pushed  in the modes `reach` and `arm`: see `core.grasps.Margins`
    pushed_NAME, touched      in mode `arm`: displacement of each object before the hand closed [m];
                              what the arm touched first against its plan
    friction, mass            of the target, where the trial had others than the library's [-; kg]
    q_grasp_1 ...             arm configuration at the grasp [rad]; not in mode `hand`
    q_pregrasp_1 ...          and at the pregrasp
    seed, engine              of the run; an engine that is no preset is marked
    run                       short hash of all that decides about the results; `hash` in run.yaml
    cpu_clear, cpu_reach, cpu_trial   CPU time of each stage [s]: hand, arm, trial; in mode `arm`
                              there is cpu_plan, of the motion's timing

and what makes any row, wherever it is copied to, a trial that can be executed again:

    scene, station            where the documents were, or names of built-in ones
    scene_content, station_content   their content hashes; objects and robot models count
    mode                      what was asked, see `mode`
    engine_settings, trial_settings, versions   as name=value pairs
    X_OG                      grasp frame in the object frame: the upper three rows of the matrix,
                              bit for bit, which a quaternion is not

and, for grasps that were given, whatever else came with them:

    given_NAME                column NAME of their file, such as the label or confidence of others

The column `run` leads from a results file on its own to the run.yaml with the same `hash`, which
has the hashes of objects and grasps, too. Parquet files carry it along.

What is not defined for a trial is an empty cell in CSV and null in Parquet, NaN in memory. Tables
of several scenes can be put one below the other; each row then lacks the objects of the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import quaternion_from_rotation
from burg_drake.core.grasps import (
    COST,
    DECIDED,
    INPUT_PREFIX,
    MEASURED,
    POSTURE,
    VERDICT_FIELDS,
    TableShape,
    Verdict,
    fields_in,
)
from burg_drake.evaluation.candidates import Candidates
from burg_drake.evaluation.records.origin import ORIGIN_TEXT, TrialOrigin, engine_label
from burg_drake.evaluation.records.trial import RecordedTrial, pose_text

Columns = dict[str, NDArray[Any]]

TEXT = (
    *("id", "instance", "object"),
    *(one.name for one in VERDICT_FIELDS if one.is_text),
    *("engine", "run"),
    *ORIGIN_TEXT,
    "X_OG",
)
INTEGER = ("seed",)


def make_columns(
    candidates: Candidates,
    verdicts: Mapping[str, Verdict],
    origin: TrialOrigin,
    *,
    instances: Sequence[str],
    joints: int = 0,
) -> Columns:
    """The table of all grasps that are judged, in the order of the candidates.

    Args:
        candidates: the grasps.
        verdicts: by grasp id; grasps without one are left out.
        origin: what made them.
        instances: names of the scene's free objects.
        joints: number of the arm's joints, 0 without an arm.
    """
    grasps = candidates.grasps
    judged = [i for i, id in enumerate(candidates.id) if id in verdicts]
    trials = [
        RecordedTrial(
            id=candidates.id[i],
            instance=str(candidates.instance[i]),
            object=str(grasps.object[i]),
            X_OG=grasps.X_OG[i],
            width=float(grasps.width[i]),
            score=float(grasps.score[i]),
            verdict=verdicts[candidates.id[i]],
        )
        for i in judged
    ]
    columns = trial_columns(trials, origin, instances=instances, joints=joints)
    return columns | {INPUT_PREFIX + name: _plain(v[judged]) for name, v in grasps.columns.items()}


def trial_columns(
    trials: Sequence[RecordedTrial],
    origin: TrialOrigin,
    *,
    instances: Sequence[str],
    joints: int = 0,
) -> Columns:
    """The table of judged trials; see `make_columns`. Their ids need not differ."""
    rows = [t.verdict for t in trials if t.verdict is not None]
    if len(rows) != len(trials):
        raise ValueError("a table is made of judged trials only")
    shape = TableShape(origin.mode, instances, joints)
    X_OG = np.array([t.X_OG for t in trials]).reshape(-1, 4, 4)
    wxyz = quaternion_from_rotation(X_OG[:, :3, :3]) if rows else np.empty((0, 4))
    columns: Columns = {
        "id": _texts([t.id for t in trials]),
        "instance": _texts([t.instance for t in trials]),
        "object": _texts([t.object for t in trials]),
        **verdict_columns(rows, DECIDED, shape),
        "width": _numbers([t.width for t in trials]),
        "score": _numbers([t.score for t in trials]),
        **{name: X_OG[:, k, 3] for k, name in enumerate("xyz")},
        **{name: wxyz[:, k] for k, name in enumerate(("qw", "qx", "qy", "qz"))},
        **verdict_columns(rows, MEASURED, shape),
        "friction": _numbers([t.friction for t in trials]),
        "mass": _numbers([t.mass for t in trials]),
        **verdict_columns(rows, POSTURE, shape),
    }
    columns["seed"] = np.full(len(rows), origin.seed, dtype=np.int64)
    columns["engine"] = _same(engine_label(origin.engine), len(rows))
    columns["run"] = _same(origin.run, len(rows))
    columns |= verdict_columns(rows, COST, shape)
    for name, text in origin.cells().items():
        columns[name] = _same(text, len(rows))
    columns["X_OG"] = _texts([pose_text(t.X_OG) for t in trials])
    return columns


def verdict_columns(rows: Sequence[Verdict], part: str, shape: TableShape) -> Columns:
    """The columns of verdicts that lie in a part of a row, see `core.grasps.verdict_field`."""
    columns: Columns = {}
    for one in fields_in(shape.mode, part):
        values = [getattr(verdict, one.name) for verdict in rows]
        make = _texts if one.is_text else _numbers
        for name, key in one.columns(shape).items():
            columns[name] = make([one.cell(value, key) for value in values])
    return columns


def table_row(columns: Columns, index: int) -> dict[str, Any]:
    """One row as Python values by column."""
    return {name: values[index].item() for name, values in columns.items()}


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Truth values as 1 and 0, which every reader takes for numbers."""
    return values.astype(np.int64) if values.dtype.kind == "b" else values


def _texts(values: Sequence[str]) -> NDArray[Any]:
    return np.array(values, dtype=np.str_)


def _same(text: str, count: int) -> NDArray[Any]:
    """A column of one text, at the price of one cell."""
    return np.broadcast_to(np.array(text, dtype=np.str_), count)


def _numbers(values: Sequence[float | None]) -> NDArray[Any]:
    return np.array([math.nan if value is None else value for value in values], dtype=float)
