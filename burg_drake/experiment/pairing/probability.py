"""The probability of success that perturbed repeats of the grasps of a run predict."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core import Array
from burg_drake.evaluation.robustness import lifted_shares, own_table
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.pairing.pairs import VerdictPairs
from burg_drake.experiment.pairing.side import JudgedRuns


def predicted_probability(
    judged: JudgedRuns, pairs: VerdictPairs, table: str | Path | None = None
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
    places = _places(found, None if table is None else Path(table))
    for runs, path in places:
        known |= lifted_shares(
            path, runs, None if isinstance(found, Campaign) else found.candidates.id
        )
    return _along(pairs, known) if places else None


def _places(found: Run | Campaign, table: Path | None) -> list[tuple[set[str], Path]]:
    """Tables, with the runs that they may be of."""
    folders = {found.document.hash: found.path}
    if isinstance(found, Campaign):
        folders = {state.run: found.folder(n) for n, state in found.states.items() if state.run}
    if table is not None:
        return [(set(folders), table)]
    own = {run: own_table(folder) for run, folder in folders.items()}
    return [({run}, path) for run, path in own.items() if path is not None]


def _along(pairs: VerdictPairs, known: dict[tuple[str, str], float]) -> Array:
    """(N,) shares of pairs by run and id."""
    values = np.full(len(pairs), np.nan)
    tested = {run for run, _ in known}
    rows = np.flatnonzero(pairs.run.where([name in tested for name in pairs.run.names]))
    for row in rows.tolist():
        values[row] = known.get((pairs.run[row], pairs.id[row]), np.nan)
    return values
