"""Confusion matrices of predicted and actual success, and McNemar's test of two predictors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.experiment.comparison.estimates import (
    AGREEMENT_MEASURES,
    CELL_PRIOR,
    RESAMPLING_DRAWS,
    Estimate,
    Flags,
    Rows,
    Values,
    draw_cells,
    draw_unstratified_cells,
    estimate_share,
    interval_bounds,
)


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """A confusion matrix of predicted and actual success, and its figures (`AGREEMENT_MEASURES`).

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
        """One of `AGREEMENT_MEASURES`."""
        found: Estimate = getattr(self, name)
        return found


def count_cells(predicted: Flags, actual: Flags) -> Values:
    """Counts of (tp, fp, fn, tn) from N verdicts and outcomes, both (N,) truth values."""
    counts: Values = count_cells_by_group(
        predicted, actual, np.zeros(len(predicted), dtype=np.intp), 1
    )[0]
    return counts


def count_cells_by_group(predicted: Flags, actual: Flags, group: Rows, count: int) -> Values:
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


def estimate_agreement(
    counts: Values, *, population: Array | None = None, seed: int = 0
) -> Agreement:
    """Figures of one matrix. Its shares have Wilson's intervals, all others those of
    `draw_cells`.

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
        return _make_agreement([0, 0, 0, 0], 0, np.full(len(AGREEMENT_MEASURES), np.nan), None)
    drawn = draw_cells(counts, stands_for, np.random.default_rng(seed))
    interval = interval_bounds(_compute_measures(drawn))
    trials = int(size.sum())
    if population is None:
        cells = counts.sum(axis=0)
        return _make_agreement(cells.tolist(), trials, _compute_measures(cells), interval)
    weight = np.divide(stands_for, size, out=np.zeros(len(size)), where=size > 0)
    cells = weight @ counts
    return _make_agreement(
        cells.tolist(), trials, _compute_measures(cells), interval, weighted=True
    )


def estimate_agreements(counts: Values, *, seed: int = 0) -> list[Agreement]:
    """Figures of many matrices at once.

    Args:
        counts: (G, 4) trials by group and cell.
        seed: of the resampling.
    """
    max_matrices = 500_000  # Matrices drawn at once, which bounds the memory.
    min_draws = 400  # For each group, however many groups there are.
    chunk_size = 64  # Groups measured at once; reused memory is faster.
    if not len(counts):
        return []
    draws = int(np.clip(max_matrices // len(counts), min_draws, RESAMPLING_DRAWS))
    rng = np.random.default_rng(seed)
    found = []
    for part in np.array_split(counts, -(-len(counts) * draws // max_matrices)):
        drawn = draw_unstratified_cells(part, rng, draws)
        pieces = [
            interval_bounds(_compute_measures(drawn[:, k : k + chunk_size]))
            for k in range(0, len(part), chunk_size)
        ]
        low, high = (np.concatenate(bound) for bound in zip(*pieces, strict=True))
        sums = part.sum(axis=1).tolist()
        values = _compute_measures(part)
        found += [
            _make_agreement(cells, sums[k], values[k], (low[k], high[k]))
            for k, cells in enumerate(part.tolist())
        ]
    return found


def _compute_measures(cells: Values) -> Array:
    """(..., M) from (..., 4); what is undefined is not finite."""
    parts = [cells[..., k].astype(float) for k in range(4)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([measure.of(*parts) for measure in AGREEMENT_MEASURES.values()], axis=-1)


def _make_agreement(
    cells: Sequence[float],
    trials: int,
    values: Array,
    interval: tuple[Array, Array] | None,
    *,
    weighted: bool = False,
) -> Agreement:
    """An agreement from its cells, and (M,) values of its measures with their bounds."""
    figures = {}
    for k, (name, measure) in enumerate(AGREEMENT_MEASURES.items()):
        if interval is None or not np.isfinite(values[k]):
            figures[name] = Estimate.undefined(measure.reason if trials else "no trials")
        elif measure.is_share and not weighted:
            part, whole = (sum(cells[c] for c in of) for of in (measure.part, measure.whole))
            figures[name] = estimate_share(part, whole)
        else:
            low, high = float(interval[0][k]), float(interval[1][k])
            figures[name] = Estimate.between(float(values[k]), low, high)
    figures["excess"] = _excess_from_actual(figures["excess"], figures["actual"], cells)
    tp, fp, fn, tn = cells
    return Agreement(trials=trials, tp=tp, fp=fp, fn=fn, tn=tn, **figures)


def _excess_from_actual(excess: Estimate, actual: Estimate, cells: Sequence[float]) -> Estimate:
    """The difference of predicted and actual success, which follows from actual success where all
    verdicts are alike: nothing succeeds more often than always."""
    tp, fp, fn, tn = cells
    if excess.value is None or actual.low is None or actual.high is None or (tp + fp and fn + tn):
        return excess
    predicted = 1.0 if tp + fp else 0.0
    return Estimate.between(excess.value, predicted - actual.high, predicted - actual.low)


@dataclass(frozen=True, kw_only=True)
class Paired:
    """Two answers, yes or no, about each of some trials.

    Attributes:
        trials: number of trials.
        both, only_first, only_second, neither: trials by who said yes.
        difference: share of yes of the first less that of the second.
        p_value: two-sided, exact: how often answers that are the same in truth would differ at
            least so unevenly; None without trials.
    """

    trials: int
    both: int
    only_first: int
    only_second: int
    neither: int
    difference: Estimate
    p_value: float | None


def compare_paired(first: Flags, second: Flags, *, seed: int = 0) -> Paired:
    """Compares answers.

    Args:
        first, second: (N,) truth values.
        seed: of the interval's resampling.
    """
    both, neither = int((first & second).sum()), int((~first & ~second).sum())
    one, other = int((first & ~second).sum()), int((~first & second).sum())
    return compare_paired_counts(both, one, other, neither, seed=seed)


def compare_paired_counts(
    both: int, only_first: int, only_second: int, neither: int, *, seed: int = 0
) -> Paired:
    """As `compare_paired`, from counts."""
    from scipy.special import bdtr

    trials = both + only_first + only_second + neither
    difference, p_value = Estimate.undefined("no trials"), None
    if trials:
        cells = np.array([both, only_first, only_second, neither]) + CELL_PRIOR
        drawn = np.random.default_rng(seed).dirichlet(cells, RESAMPLING_DRAWS)
        low, high = interval_bounds(drawn[:, 1] - drawn[:, 2])
        value = (only_first - only_second) / trials
        difference = Estimate.between(value, float(low), float(high))
        p_value = 1.0
        apart = only_first + only_second
        if apart:  # either tail of the binomial distribution with one half, which is symmetric
            p_value = min(1.0, 2.0 * float(bdtr(min(only_first, only_second), apart, 0.5)))
    return Paired(
        trials=trials,
        both=both,
        only_first=only_first,
        only_second=only_second,
        neither=neither,
        difference=difference,
        p_value=p_value,
    )
