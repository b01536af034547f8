"""The results of runs as columns, whatever lies in the folder: one run, or runs of many scenes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from burg_drake.evaluation.records import TEXT, Columns
from burg_drake.evaluation.store.campaign_folder import Campaign, is_campaign, load_campaign
from burg_drake.evaluation.store.part_store import PARTS_FOLDER, StoredRun, read_rows
from burg_drake.evaluation.store.run_folder import Run, load_run


def open_results(path: str | Path) -> Run | Campaign:
    """The run in a folder, of one scene or of many.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
    """
    return load_campaign(path) if is_campaign(path) else load_run(path)


def load_runs(path: str | Path) -> list[Run]:
    """The runs in a folder: one, or those of each scene of a run over many scenes.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
    """
    found = open_results(path)
    return list(found.runs) if isinstance(found, Campaign) else [found]


def read_results(path: str | Path, names: Sequence[str] | None = None) -> Columns:
    """Reads columns of all judged grasps in a folder.

    `run` and `id` together name a row.

    Example::

        columns = burg.read_results("runs/first", ["object", "outcome", "clearance"])
        lifted = columns["object"][columns["outcome"] == "lifted"]

    Args:
        path: folder of a run, of one scene or of many.
        names: of the columns, which is all that is read where there are many grasps; all if None.
            What a run does not have is NaN, or an empty text.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
        MissingDependencyError: a run over many scenes without pyarrow.
    """
    found = open_results(path)
    if isinstance(found, Campaign):
        return found.columns(names)
    if (found.path / PARTS_FOLDER).is_dir():
        rows = read_rows(found.path, [StoredRun("", found.path)], names)
        return rows.columns(rows.table.column_names)
    table = found.results
    count = len(table["id"])
    missing = {name: np.full(count, "" if name in TEXT else np.nan) for name in names or ()}
    return table if names is None else {name: {**missing, **table}[name] for name in names}
