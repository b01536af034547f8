"""Agreement by what trials have in common, and what became of grasps that were stopped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from burg_drake.core.grasps import Stage
from burg_drake.experiment.pairing import Factor, VerdictPairs
from burg_drake.experiment.statistics import Agreement, Estimate, Values, agreements, grouped, share


@dataclass(frozen=True, kw_only=True)
class FactorGroup:
    """Trials that have something in common, such as their object.

    Attributes:
        name: what that is.
        agreement: figures.
    """

    name: str
    agreement: Agreement


@dataclass(frozen=True, kw_only=True)
class Stopped:
    """Grasps with the same verdict, and what became of them.

    Attributes:
        stage, outcome, blocker: the verdict; the blocker is the body in the way, if any.
        trials: how many.
        successes: share that succeeded.
    """

    stage: str
    outcome: str
    blocker: str
    trials: int
    successes: Estimate


def by_factor(
    pairs: VerdictPairs, factor: Factor, names: Mapping[str, str] | None = None, *, seed: int = 0
) -> tuple[FactorGroup, ...]:
    """Agreement for each text of a column that occurs.

    Args:
        pairs: the trials.
        factor: (N,) the column.
        names: what its texts are called, in the order of the groups; as they are if None.
        seed: of the intervals' resampling.
    """
    counts = grouped(pairs.predicted, pairs.actual, factor.index, len(factor.names))
    seen = np.flatnonzero(counts.sum(axis=1)).tolist()
    if names:
        rank = {text: k for k, text in enumerate(names)}
        seen.sort(key=lambda k: rank.get(factor.names[k], len(rank)))
    found = agreements(counts[seen], seed=seed)
    labels = [factor.names[k] for k in seen]
    return tuple(
        FactorGroup(name=(names or {}).get(label, label), agreement=a)
        for label, a in zip(labels, found, strict=True)
    )


def stopped(pairs: VerdictPairs) -> tuple[Stopped, ...]:
    """What became of the grasps by verdict, the most frequent ones of a stage first; success is
    among the verdicts."""
    stages, outcomes, blockers = pairs.stage, pairs.simulated, pairs.blocker
    width = (len(outcomes.names), len(blockers.names))
    code = (stages.index * width[0] + outcomes.index) * width[1] + blockers.index
    found, index = np.unique(code, return_inverse=True)
    trials = np.bincount(index, minlength=len(found))
    good = np.bincount(index, weights=pairs.actual, minlength=len(found))
    rows = [
        Stopped(
            stage=stages.names[c // width[1] // width[0]],
            outcome=outcomes.names[c // width[1] % width[0]],
            blocker=blockers.names[c % width[1]],
            trials=int(trials[k]),
            successes=share(int(good[k]), int(trials[k])),
        )
        for k, c in enumerate(found.tolist())
    ]
    return tuple(sorted(rows, key=lambda row: (_STAGES.index(row.stage), -row.trials)))


def outcome_table(pairs: VerdictPairs) -> dict[str, dict[str, int]]:
    """How many trials ended how, by verdict; only what occurs."""
    return crossed(pairs.simulated, pairs.ended)


def crossed(rows: Factor, columns: Factor) -> dict[str, dict[str, int]]:
    """How many trials have which text of one column and which of another; only what occurs."""
    counts = _counts(rows, columns)
    return {
        rows.names[r]: {columns.names[c]: int(counts[r, c]) for c in np.flatnonzero(counts[r])}
        for r in np.flatnonzero(counts.sum(axis=1))
    }


def _counts(rows: Factor, columns: Factor) -> Values:
    width = len(columns.names)
    flat = np.bincount(rows.index * width + columns.index, minlength=len(rows.names) * width)
    return flat.reshape(len(rows.names), width)


_STAGES = [stage.value for stage in Stage]
