"""The results of runs as columns, whatever lies in the folder: one run, or runs of many scenes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.evaluation.run_store import Run, load_run
from burg_drake.evaluation.table import TEXT, Columns


def load_runs(path: str | Path) -> list[Run]:
    """The runs in a folder: one, or those of each scene of a run over many scenes.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
    """
    return [load_run(path)]


def read_results(path: str | Path, names: Sequence[str] | None = None) -> Columns:
    """Columns of all judged grasps in a folder, see `evaluation.table`; `run` and `id` together
    name a row.

    Args:
        path: folder of a run, of one scene or of many.
        names: of the columns; all if None. What a run does not have is NaN, or an empty text.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
    """
    tables = [run.results for run in load_runs(path)]
    wanted = names or list(dict.fromkeys(name for table in tables for name in table))
    return {name: np.concatenate([_column(table, name) for table in tables]) for name in wanted}


def _column(table: Columns, name: str) -> NDArray[Any]:
    if name in table:
        return table[name]
    missing = "" if name in TEXT else np.nan
    return np.full(len(table["id"]), missing)
