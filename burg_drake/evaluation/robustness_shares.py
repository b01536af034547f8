"""Success probabilities (shares of perturbed repeats that lift) from robustness tables."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, list_names
from burg_drake.evaluation.table_file import read_table

ROBUSTNESS_FILES = ("robustness.csv", "robustness.parquet")
"""Names of the tables of `burg-drake robustness` in the folder of a run."""


def find_robustness_table(folder: Path) -> Path | None:
    """Path of the robustness table in the folder of a run; None if there is none."""
    places = (folder / name for name in ROBUSTNESS_FILES)
    return next((place for place in places if place.is_file()), None)


def lifted_shares(
    path: Path, runs: Collection[str], ids: Collection[str] | None
) -> dict[tuple[str, str], float]:
    """Reads the success shares of a robustness table, by run hash and grasp id.

    Args:
        path: path of the table.
        runs: hashes of the accepted runs.
        ids: ids of all grasps, if there is one run. A table without a column `run`, as earlier
            releases wrote it, is then accepted if it has no other grasps.

    Raises:
        InvalidInputError: the table cannot be read, has no such shares, or is of another run.
    """
    columns = read_table(path)
    if "success" not in columns or "id" not in columns or columns["success"].dtype.kind != "f":
        raise InvalidInputError(
            f"{path} is not a table of robustness (columns id and success are missing);"
            " `burg-drake robustness` writes one"
        )
    grasps, shares = columns["id"].tolist(), columns["success"].tolist()
    if "run" in columns:
        run_of_row = columns["run"].tolist()
        if grasps and not set(run_of_row) & set(runs):
            raise InvalidInputError(
                f"{path} is of run {list_names(sorted(set(run_of_row)))}, not of "
                f"{list_names(sorted(runs))}; give the table of the run that is compared"
            )
    else:
        run_of_row = [_require_one_run(path, runs, ids, grasps)] * len(grasps)
    rows = zip(run_of_row, grasps, shares, strict=True)
    return {(run, id): share for run, id, share in rows if np.isfinite(share)}


def _require_one_run(
    path: Path, runs: Collection[str], ids: Collection[str] | None, grasps: Collection[str]
) -> str:
    """Hash of the run of a table that has no column `run`."""
    if ids is None or len(runs) != 1:
        raise InvalidInputError(
            f"{path} has no column run, but ids of grasps repeat between scenes; make it"
            " again with `burg-drake robustness`, or give only one of the runs"
        )
    foreign = sorted(set(grasps) - set(ids))
    if foreign:
        raise InvalidInputError(
            f"{path} is of another run than {list_names(sorted(runs))}: that has no grasp"
            f" {foreign[0]}"
        )
    return next(iter(runs))
