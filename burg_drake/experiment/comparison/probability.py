"""The probability of success that perturbed repeats of the grasps of a run predict."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core.frames import Array
from burg_drake.evaluation.campaign import Campaign
from burg_drake.evaluation.robustness_shares import lifted_shares, own_table
from burg_drake.experiment.comparison.pairs import Pairs
from burg_drake.experiment.comparison.side import Judged


def predicted_probability(
    judged: Judged, pairs: Pairs, table: str | Path | None = None
) -> Array | None:
    """Share of the perturbed repeats that were lifted.

    Args:
        judged: the run of the grasps.
        pairs: N verdicts of it.
        table: of robustness; those in the folders of its runs if None.

    Returns:
        (N,) NaN where a grasp was not tested; None without a table.

    Raises:
        InvalidInputError: a table cannot be read, or is of another run.
    """
    found = judged.found
    known: dict[tuple[str, str], float] = {}
    if isinstance(found, Campaign):
        runs = {name: state.run for name, state in found.states.items() if state.run}
        tables = {run: own_table(found.folder(name)) for name, run in runs.items()}
        places = [({run}, path) for run, path in tables.items() if path is not None]
        if table is not None:
            places = [(set(tables), Path(table))]
        for hashes, path in places:
            known |= lifted_shares(path, hashes, None)
    else:
        path = own_table(found.path) if table is None else Path(table)
        places = [] if path is None else [({found.document.hash}, path)]
        for hashes, path in places:
            known |= lifted_shares(path, hashes, found.candidates.id)
    if not places:
        return None
    return _along(pairs, known)


def _along(pairs: Pairs, known: dict[tuple[str, str], float]) -> Array:
    """(N,) shares of pairs by run and id."""
    values = np.full(len(pairs), np.nan)
    tested = {run for run, _ in known}
    rows = np.flatnonzero(pairs.run.where([name in tested for name in pairs.run.names]))
    for row in rows.tolist():
        values[row] = known.get((pairs.run[row], pairs.id[row]), np.nan)
    return values
