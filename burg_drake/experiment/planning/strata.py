"""What the grasps of an object are balanced by, and how many of each stratum are chosen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, nearest, quoted
from burg_drake.core.grasps import MARGINS, Outcome
from burg_drake.core.terminal import format_number
from burg_drake.evaluation.robustness import TABLE_FILES, lifted_shares, own_table
from burg_drake.evaluation.store import Run
from burg_drake.experiment.planning.eligible import EligibleGrasps
from burg_drake.experiment.trials import Selection, succeeded

SUCCESS, FAILURE = "success", "failure"


def labels_of(
    pool: EligibleGrasps, selection: Selection, probability: Callable[[Run], Mapping[str, float]]
) -> NDArray[np.str_]:
    """(N,) the stratum of each grasp within its object; empty where it has none.

    Args:
        pool: the grasps.
        selection: what they are balanced by.
        probability: gives the predicted probability of success by grasp id.

    Raises:
        InvalidInputError: the run has no such margin.
    """
    if selection.balance == "none":
        return np.full(len(pool.rows), "all")
    outcomes = pool.cells("outcome").tolist()
    if selection.balance == "outcome":
        good = [succeeded(Outcome(outcome), selection.success) for outcome in outcomes]
        return np.where(good, SUCCESS, FAILURE)
    if selection.balance == "stage":
        pairs = zip(pool.cells("stage").tolist(), outcomes, strict=True)
        return np.array([f"{stage}/{outcome}" for stage, outcome in pairs], dtype=np.str_)
    if selection.balance == "margin":
        values, name = _margin(pool, selection.margin), selection.margin
    else:
        known = probability(pool.run)
        values = np.array([known.get(id, np.nan) for id in pool.cells("id").tolist()])
        name = "probability"
    objects = pool.cells("object")
    labels = np.full(len(values), "", dtype=object)
    for held in np.unique(objects):
        mine = objects == held
        labels[mine] = _bins(values[mine], name, selection.bins)
    return labels.astype(np.str_)


def robustness_of(run: Run, table: Path | None = None) -> dict[str, float]:
    """Share of a grasp's perturbed repeats that were lifted, by grasp id.

    Args:
        run: the run.
        table: what `robustness` has written; the one in the run's folder if None.

    Raises:
        InvalidInputError: there is no such table, it has no such shares, or it is of another run.
    """
    found = own_table(run.path) if table is None else table
    if found is None:
        raise InvalidInputError(
            f"{run.path / TABLE_FILES[0]} does not exist; run `burg-drake robustness "
            f"{run.path}`, which predicts how often grasps are lifted"
        )
    shares = lifted_shares(found, {run.document.hash}, run.candidates.id)
    return {id: share for (of, id), share in shares.items() if of == run.document.hash}


def allocate(populations: Mapping[str, int], wanted: int, first: Sequence[str]) -> dict[str, int]:
    """How many of each stratum: as evenly as there are enough, together `wanted` if there are.

    Args:
        populations: by stratum.
        wanted: in all.
        first: the strata, those first that get one more where it does not come out even.
    """
    chosen = dict.fromkeys(populations, 0)
    left = min(wanted, sum(populations.values()))
    while left:
        for label in first:
            if left and chosen[label] < populations[label]:
                chosen[label] += 1
                left -= 1
    return chosen


def even_shares(labels: Sequence[str], wanted: int) -> dict[str, int]:
    """How many of each stratum are asked for, the first ones one more."""
    share, more = divmod(wanted, len(labels))
    return {label: share + (k < more) for k, label in enumerate(labels)}


def _margin(pool: EligibleGrasps, name: str) -> NDArray[np.float64]:
    if name not in pool.run.results or name not in MARGINS:
        there = [margin for margin in MARGINS if margin in pool.run.results]
        raise InvalidInputError(
            f"{pool.run.path} has no margin {quoted(name)}; {nearest(name, there)}"
        )
    return pool.cells(name).astype(float)


def _bins(values: NDArray[np.float64], name: str, bins: int) -> NDArray[np.str_]:
    """Labels of bins of as equal numbers as equal values, which stay together, allow."""
    known = np.isfinite(values)
    labels = np.full(len(values), "", dtype=object)
    if known.any():
        edges = np.unique(np.quantile(values[known], np.linspace(0.0, 1.0, bins + 1)))
        place = np.searchsorted(edges[1:-1], values, side="right")
        for k in np.unique(place[known]):
            own = known & (place == k)
            low, high = (format_number(float(v), 4) for v in (values[own].min(), values[own].max()))
            text = low if low == high else f"{low} to {high}"
            labels[own] = f"{name} {text} ({k + 1} of {max(len(edges) - 1, 1)})"
    return labels
