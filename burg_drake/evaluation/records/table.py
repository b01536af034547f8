"""The results table: its columns, one row a trial, in the order of the candidates.

`core.grasps.column_meanings` has unit and meaning of every column. A row tells, from left to right:

    which grasp it is, and how it ended      id, instance, object; outcome, stage, blocker, reason
    where the grasp is on its object         width, score, x ... qz
    what was measured                        margins, displacements, what was touched
    with which object                        friction, mass, where they were not the library's
    where the arm was                        q_grasp_1 ..., q_pregrasp_1 ...
    which run it is of, and what it cost     seed, engine, run, cpu_clear ...
    what executes it again, wherever         scene, station, their content, mode, settings,
    the row is copied to                     versions; X_OG to the bit, which a quaternion is not
    what came with grasps that were given    given_NAME for column NAME of their file

What is said of the verdict follows from its declaration, `core.grasps.verdict`; what a mode does
not ask has no column. The column `run` leads from a results file on its own to the run.yaml with
the same `hash`, which has the hashes of objects and grasps, too. Parquet files carry it along.

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
    INPUT_PREFIX,
    VERDICT_FIELDS,
    TableShape,
    Verdict,
    VerdictPart,
    fields_in,
)
from burg_drake.evaluation.candidates import Candidates
from burg_drake.evaluation.records.limit_numbers import APPROACH
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
    approach = bool(origin.trial.get(APPROACH))
    shape = TableShape(origin.mode, instances, joints, approach)
    X_OG = np.array([t.X_OG for t in trials]).reshape(-1, 4, 4)
    wxyz = quaternion_from_rotation(X_OG[:, :3, :3]) if rows else np.empty((0, 4))
    columns: Columns = {
        "id": _texts([t.id for t in trials]),
        "instance": _texts([t.instance for t in trials]),
        "object": _texts([t.object for t in trials]),
        **columns_of_verdicts(rows, "decided", shape),
        "width": _numbers([t.width for t in trials]),
        "score": _numbers([t.score for t in trials]),
        **{name: X_OG[:, k, 3] for k, name in enumerate("xyz")},
        **{name: wxyz[:, k] for k, name in enumerate(("qw", "qx", "qy", "qz"))},
        **columns_of_verdicts(rows, "measured", shape),
        "friction": _numbers([t.friction for t in trials]),
        "mass": _numbers([t.mass for t in trials]),
        **columns_of_verdicts(rows, "posture", shape),
    }
    columns["seed"] = np.full(len(rows), origin.seed, dtype=np.int64)
    judges = [verdict.judged_again for verdict in rows]
    origins = {name: origin.judged_by(name) for name in {*judges, ""}}
    labels = {name: engine_label(one.engine) for name, one in origins.items()}
    columns["engine"] = _by_judge(labels, judges)
    columns["run"] = _same(origin.run, len(rows))
    columns |= columns_of_verdicts(rows, "cost", shape)
    cells = {name: one.cells() for name, one in origins.items()}
    for name in ORIGIN_TEXT:
        texts = {judge: cells[judge][name] for judge in cells}
        columns[name] = _by_judge(texts, judges)
    columns["X_OG"] = _texts([pose_text(t.X_OG) for t in trials])
    return columns


def columns_of_verdicts(rows: Sequence[Verdict], part: VerdictPart, shape: TableShape) -> Columns:
    """The columns of verdicts that lie in a part of a row, see `core.grasps.verdict_field`."""
    columns: Columns = {}
    for one in fields_in(shape, part):
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


def _by_judge(texts: Mapping[str, str], judges: Sequence[str]) -> NDArray[Any]:
    """A column of the texts of judges, which are mostly the same."""
    if len(set(texts.values())) == 1:
        return _same(texts[""], len(judges))
    return _texts([texts[judge] for judge in judges])


def _numbers(values: Sequence[float | None]) -> NDArray[Any]:
    return np.array([math.nan if value is None else value for value in values], dtype=float)
