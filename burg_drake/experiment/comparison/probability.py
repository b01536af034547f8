"""The probability of success that perturbed repeats of the grasps of a run predict."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.evaluation.robustness import TABLE_FILE
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.table_file import read_table
from burg_drake.experiment.comparison.arrays import Values
from burg_drake.experiment.comparison.side import Judged


def predicted_probability(
    judged: Judged, ids: Values, table: str | Path | None = None
) -> Array | None:
    """Share of the perturbed repeats that were lifted.

    Args:
        judged: the run of the grasps.
        ids: (N,) of the grasps.
        table: of robustness; that in the run's folder if None.

    Returns:
        (N,) NaN where a grasp was not tested; None without a table.

    Raises:
        InvalidInputError: the table cannot be read, or is another one.
    """
    if table is None:
        table = judged.path / TABLE_FILE
        if not isinstance(judged.found, Run) or not table.is_file():
            return None
    columns = read_table(Path(table))
    if not {"id", "success"} <= set(columns):
        raise InvalidInputError(f"{table} is no table of robustness: it has no column success")
    values = columns["success"].astype(float).tolist()
    known = dict(zip(columns["id"].tolist(), values, strict=True))
    return np.array([known.get(id, np.nan) for id in ids.tolist()], dtype=float)
