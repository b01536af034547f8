"""The results table: columns, and their files for other tools (CSV or Parquet).

Columns, one row a grasp, in the order of the candidates:

    id, instance, object      which grasp on what; the id is what `burg-drake replay` takes
    outcome, stage            the one outcome, and the stage that decided it
    blocker, reason           the body in the way; the simulator's message if it failed
    width, score              distance of the contacts [m]; the sampler's score
    x, y, z, qw, qx, qy, qz   grasp frame in the object frame [m; quaternion]
    overlap ... end_time      margins, see `simulation.result.Margins` (SI units)
    q_grasp_1 ...             arm configuration at the grasp [rad]; stations with an arm only
    q_pregrasp_1 ...          and at the pregrasp
    seed, engine              of the run
    run                       short hash of all that decides about the results; `hash` in run.yaml
    cpu_clear, cpu_reach, cpu_trial   CPU time of each stage [s]

The column `run` leads from a results file on its own to the run.yaml with the same `hash`, which
has the hashes of scene, station, objects and grasps, all settings, and the versions of burg_drake,
Drake and the libraries. Parquet files carry it along.

What is not defined for a grasp is an empty cell in CSV and null in Parquet, NaN in memory.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.errors import InvalidInputError, MissingDependencyError
from burg_drake.core.files import atomic_write
from burg_drake.core.frames import quaternion_from_rotation
from burg_drake.core.outcome import Stage
from burg_drake.evaluation.candidates import Candidates
from burg_drake.evaluation.judge import MARGINS, Verdict

TableFormat = Literal["csv", "parquet"]
Columns = dict[str, NDArray[Any]]

CPU_COLUMNS = {
    Stage.CLEAR: "cpu_clear",
    Stage.REACHABLE: "cpu_reach",
    Stage.EXECUTED: "cpu_trial",
}
TEXT = ("id", "instance", "object", "outcome", "stage", "blocker", "reason", "engine", "run")
INTEGER = ("seed",)
METADATA_KEY = b"burg_drake.run"
"""Parquet files carry the contents of run.yaml as JSON under this key of their metadata."""


def make_columns(
    candidates: Candidates,
    verdicts: Mapping[str, Verdict],
    *,
    joints: int,
    seed: int,
    engine: str,
    run: str,
) -> Columns:
    """The table of all grasps that are judged, in the order of the candidates.

    Args:
        candidates: the grasps.
        verdicts: by grasp id; grasps without one are left out.
        joints: number of the arm's joints, 0 without an arm.
        seed, engine: of the run.
        run: its hash.
    """
    judged = [i for i, id in enumerate(candidates.id) if id in verdicts]
    rows = [verdicts[candidates.id[i]] for i in judged]
    grasps = candidates.grasps.select(np.array(judged, dtype=int))
    wxyz = quaternion_from_rotation(grasps.X_OG[:, :3, :3]) if judged else np.empty((0, 4))
    columns: Columns = {
        "id": _texts([candidates.id[i] for i in judged]),
        "instance": _texts(candidates.instance[judged].tolist()),
        "object": _texts(grasps.object.tolist()),
        "outcome": _texts([v.outcome.value for v in rows]),
        "stage": _texts([v.stage.value for v in rows]),
        "blocker": _texts([v.blocker for v in rows]),
        "reason": _texts([v.reason for v in rows]),
        "width": grasps.width,
        "score": grasps.score,
        **{name: grasps.X_OG[:, k, 3] for k, name in enumerate("xyz")},
        **{name: wxyz[:, k] for k, name in enumerate(("qw", "qx", "qy", "qz"))},
        **{name: _numbers([v.margins.get(name, np.nan) for v in rows]) for name in MARGINS},
    }
    for name in ("q_grasp", "q_pregrasp"):
        for k in range(joints):
            angles = [q[k] if len(q := getattr(v, name)) > k else np.nan for v in rows]
            columns[f"{name}_{k + 1}"] = _numbers(angles)
    columns["seed"] = np.full(len(rows), seed, dtype=np.int64)
    columns["engine"] = _texts([engine] * len(rows))
    columns["run"] = _texts([run] * len(rows))
    for stage, name in CPU_COLUMNS.items():
        columns[name] = _numbers([v.cpu.get(stage, np.nan) for v in rows])
    return columns


def require_writer(table: str) -> None:
    """Finds out before any work whether a table format can be written.

    Raises:
        InvalidInputError: there is no such format.
        MissingDependencyError: Parquet without pyarrow.
    """
    if table not in ("csv", "parquet"):
        raise InvalidInputError(f"table format {table!r} does not exist; give csv or parquet")
    if table == "parquet":
        _pyarrow()


def write_table(path: Path, columns: Columns, metadata: Mapping[str, Any] | None = None) -> None:
    """Writes a table whole or not at all; the suffix (.csv or .parquet) gives the format.

    Args:
        path: the file.
        columns: equally long arrays by name.
        metadata: JSON values that Parquet files carry along; CSV has no place for them.

    Raises:
        MissingDependencyError: Parquet without pyarrow.
        InvalidInputError: the file cannot be written.
    """
    if path.suffix == ".parquet":
        atomic_write(path, _parquet_bytes(columns, metadata or {}))
    else:
        atomic_write(path, _csv_text(columns))


def read_table(path: Path) -> Columns:
    """Reads a file that `write_table` wrote; numbers come back bit for bit.

    Raises:
        InvalidInputError: the file is missing or something else.
        MissingDependencyError: Parquet without pyarrow.
    """
    try:
        if path.suffix == ".parquet":
            _, parquet = _pyarrow()
            table = parquet.read_table(path)
            cells = {name: table.column(name).to_pylist() for name in table.column_names}
        else:
            with path.open(newline="", encoding="utf-8") as file:
                header, *rows = list(csv.reader(file))
            cells = {name: [row[k] for row in rows] for k, name in enumerate(header)}
    except (OSError, ValueError, IndexError) as error:
        raise InvalidInputError(f"{path} is not a results table ({error})") from error
    return {name: _typed(name, values) for name, values in cells.items()}


def _csv_text(columns: Columns) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(_cells(values) for values in columns.values()), strict=True))
    return stream.getvalue()


def _cells(values: NDArray[Any]) -> list[Any]:
    """Python values of a column, an empty text for NaN; csv writes floats by repr: lossless."""
    return ["" if value != value else value for value in values.tolist()]


def _parquet_bytes(columns: Columns, metadata: Mapping[str, Any]) -> bytes:
    arrow, parquet = _pyarrow()
    arrays = {
        name: arrow.array(values.tolist(), arrow.string())
        if values.dtype.kind == "U"
        else arrow.array(values, from_pandas=True)  # NaN becomes null
        for name, values in columns.items()
    }
    table = arrow.table(arrays).replace_schema_metadata({METADATA_KEY: json.dumps(metadata)})
    sink = arrow.BufferOutputStream()
    parquet.write_table(table, sink)
    return bytes(sink.getvalue().to_pybytes())


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingDependencyError(
            "Parquet needs pyarrow; run: pip install 'burg-drake[parquet]', or choose csv"
        ) from error
    return pyarrow, pyarrow.parquet


def _typed(name: str, values: Sequence[Any]) -> NDArray[Any]:
    if name in TEXT:
        return _texts([str(v) for v in values])
    if name in INTEGER:
        return np.array([int(v) for v in values], dtype=np.int64)
    return _numbers([np.nan if v in (None, "") else float(v) for v in values])


def _texts(values: Sequence[str]) -> NDArray[Any]:
    return np.array(values, dtype=np.str_)


def _numbers(values: Sequence[float]) -> NDArray[Any]:
    return np.array(values, dtype=float)
