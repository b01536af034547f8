"""How well verdicts agree with what happened: a confusion matrix and all that follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.experiment.statistics.arrays import Flags, Rows, Values
from burg_drake.experiment.statistics.estimates import MEASURES, Estimate, share
from burg_drake.experiment.statistics.resampling import DRAWS, bounds, draw_cells, draw_each

MOST_DRAWN = 500_000
FEWEST = 400
PIECE = 64
"""Matrices that are drawn for a list of groups, about; many groups get fewer each, and
are measured so many at a time, as memory that is used again is faster than more of it."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """A confusion matrix of predicted and actual success, and figures from it; see `MEASURES`.

    Attributes:
        trials: number of trials behind it.
        tp, fp, fn, tn: trials, or the grasps that they stand for: predicted successes that came
            true and that failed, failures that succeeded after all and that failed.
        precision: share of the predicted successes that succeeded.
        recall: share of the successes that were predicted.
        specificity: share of the failures that were predicted.
        f1: harmonic mean of precision and recall.
        accuracy: share of right verdicts.
        balanced_accuracy: mean of recall and specificity.
        matthews: correlation of predicted and actual success.
        kappa: agreement beyond chance.
        predicted, actual: shares of successes.
        excess: the first less the second: above 0 where too much is predicted.
    """

    trials: int
    tp: float
    fp: float
    fn: float
    tn: float
    precision: Estimate
    recall: Estimate
    specificity: Estimate
    f1: Estimate
    accuracy: Estimate
    balanced_accuracy: Estimate
    matthews: Estimate
    kappa: Estimate
    predicted: Estimate
    actual: Estimate
    excess: Estimate

    @property
    def cells(self) -> tuple[float, float, float, float]:
        """(tp, fp, fn, tn)."""
        return self.tp, self.fp, self.fn, self.tn

    def figure(self, name: str) -> Estimate:
        """One of `MEASURES`."""
        found: Estimate = getattr(self, name)
        return found


def matrix_of(predicted: Flags, actual: Flags) -> Values:
    """Counts of (tp, fp, fn, tn) from N verdicts and outcomes, both (N,) truth values."""
    counts: Values = grouped(predicted, actual, np.zeros(len(predicted), dtype=np.intp), 1)[0]
    return counts


def grouped(predicted: Flags, actual: Flags, group: Rows, count: int) -> Values:
    """Confusion matrices by group.

    Args:
        predicted, actual: (N,) truth values.
        group: (N,) index of each trial's group.
        count: number of groups.

    Returns:
        (count, 4) trials by group and cell.
    """
    cell = 2 * (~predicted).astype(np.intp) + ~actual
    return np.bincount(4 * group + cell, minlength=4 * count).reshape(count, 4)


def agreement(counts: Values, *, population: Array | None = None, seed: int = 0) -> Agreement:
    """Figures of one matrix. Its shares have Wilson's intervals, all others those of
    `resampling.draw_cells`.

    Args:
        counts: (4,) trials by cell, or (S, 4) by the stratum that they were chosen from.
        population: (S,) what each stratum stands for. The figures then hold for all that could
            have been chosen; shares, too, have intervals by resampling within strata. None: for
            the trials themselves.
        seed: of the resampling.
    """
    counts = np.atleast_2d(np.asarray(counts))
    size = counts.sum(axis=1)
    stands_for = size.astype(float) if population is None else np.asarray(population, dtype=float)
    if not size.any():
        return _agreement([0, 0, 0, 0], 0, np.full(len(MEASURES), np.nan), None)
    drawn = draw_cells(counts, stands_for, np.random.default_rng(seed))
    interval = bounds(_all_measures(drawn))
    trials = int(size.sum())
    if population is None:
        cells = counts.sum(axis=0)
        return _agreement(cells.tolist(), trials, _all_measures(cells), interval)
    weight = np.divide(stands_for, size, out=np.zeros(len(size)), where=size > 0)
    cells = weight @ counts
    return _agreement(cells.tolist(), trials, _all_measures(cells), interval, weighted=True)


def agreements(counts: Values, *, seed: int = 0) -> list[Agreement]:
    """Figures of many matrices at once.

    Args:
        counts: (G, 4) trials by group and cell.
        seed: of the resampling.
    """
    if not len(counts):
        return []
    draws = int(np.clip(MOST_DRAWN // len(counts), FEWEST, DRAWS))
    rng = np.random.default_rng(seed)
    found = []
    for part in np.array_split(counts, -(-len(counts) * draws // MOST_DRAWN)):
        drawn = draw_each(part, rng, draws)
        pieces = [
            bounds(_all_measures(drawn[:, k : k + PIECE])) for k in range(0, len(part), PIECE)
        ]
        low, high = (np.concatenate(bound) for bound in zip(*pieces, strict=True))
        sums = part.sum(axis=1).tolist()
        values = _all_measures(part)
        found += [
            _agreement(cells, sums[k], values[k], (low[k], high[k]))
            for k, cells in enumerate(part.tolist())
        ]
    return found


def _all_measures(cells: Values) -> Array:
    """(..., M) from (..., 4); what is undefined is not finite."""
    parts = [cells[..., k].astype(float) for k in range(4)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([measure.of(*parts) for measure in MEASURES.values()], axis=-1)


def _agreement(
    cells: Sequence[float],
    trials: int,
    values: Array,
    interval: tuple[Array, Array] | None,
    *,
    weighted: bool = False,
) -> Agreement:
    """An agreement from its cells, and (M,) values of its measures with their bounds."""
    figures = {}
    for k, (name, measure) in enumerate(MEASURES.items()):
        if interval is None or not np.isfinite(values[k]):
            figures[name] = Estimate.undefined(measure.reason if trials else "no trials")
        elif measure.is_share and not weighted:
            part, whole = (sum(cells[c] for c in of) for of in (measure.part, measure.whole))
            figures[name] = share(part, whole)
        else:
            low, high = float(interval[0][k]), float(interval[1][k])
            figures[name] = Estimate.between(float(values[k]), low, high)
    figures["excess"] = _within_prediction(figures["excess"], figures["actual"], cells)
    tp, fp, fn, tn = cells
    return Agreement(trials=trials, tp=tp, fp=fp, fn=fn, tn=tn, **figures)


def _within_prediction(excess: Estimate, actual: Estimate, cells: Sequence[float]) -> Estimate:
    """The difference of predicted and actual success, which follows from actual success where all
    verdicts are alike: nothing succeeds more often than always."""
    tp, fp, fn, tn = cells
    if excess.value is None or actual.low is None or actual.high is None or (tp + fp and fn + tn):
        return excess
    predicted = 1.0 if tp + fp else 0.0
    return Estimate.between(excess.value, predicted - actual.high, predicted - actual.low)
