"""Confusion matrices of predicted and actual success: measures, 95 % intervals, and paired tests.

An undefined estimate is None with a reason, never 0 and never an exception: without a predicted
success, precision is unknown, not 0.

The cost of resampling depends on the number of strata, not of trials. Proportions of the cells of a
stratum are drawn from their Dirichlet distribution given the counts (the Bayesian bootstrap: D. B.
Rubin, Annals of Statistics 9, 1981). Redrawing the counts would treat an empty cell as impossible:
with 10 of 10 correct, the interval would have no width. Jeffreys' prior of half a trial for each
cell is divided among the strata in proportion to the population of each, so that many small strata
do not outweigh the observations. The n trials of a stratum count as n - 2, at least a third,
because the spread within the stratum is estimated from them, too. `benchmarks/compare.py` measures
the coverage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, wilson_interval

Flags = NDArray[np.bool_]
"""Truth values."""
Rows = NDArray[np.intp]
"""Indices."""
Values = NDArray[Any]
"""Numbers or texts of any type."""


CONFUSION_CELLS: Final = ("tp", "fp", "fn", "tn")
"""Order of the cells in all arrays."""


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval.

    Attributes:
        value: None if it is undefined.
        low, high: bounds; None if there is no interval.
        reason: reason for an undefined value; empty otherwise.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    reason: str = ""

    @classmethod
    def undefined(cls, reason: str) -> Estimate:
        """An undefined number with the reason."""
        return cls(None, reason=reason)

    @classmethod
    def between(cls, value: float, low: float, high: float) -> Estimate:
        """A number with its interval, which is widened to contain the number."""
        return cls(value, min(value, low), max(value, high))


def estimate_share(successes: float, trials: float) -> Estimate:
    """A proportion with Wilson's interval; undefined without trials. Effective counts need not be
    integers.
    """
    if trials <= 0:
        return Estimate.undefined("no trials")
    successes, trials = float(successes), float(trials)
    value = min(1.0, successes / trials)
    low, high = wilson_interval(successes, trials)
    return Estimate.between(value, low, high)


@dataclass(frozen=True)
class Measure:
    """A measure of agreement.

    Attributes:
        name: displayed name.
        part, whole: cells whose sums are numerator and denominator; empty if it is no share.
        compute: computes values from the four cells, arrays of one shape; NaN or infinite where
            undefined.
        low, high: range of possible values.
        reason: reason for an undefined value.
    """

    name: str
    compute: Callable[[Array, Array, Array, Array], Array]
    reason: str
    part: tuple[int, ...] = ()
    whole: tuple[int, ...] = ()
    low: float = 0.0
    high: float = 1.0

    @property
    def is_share(self) -> bool:
        """Whether the measure is a proportion of trials."""
        return bool(self.whole)


def _share_measure(
    name: str, part: tuple[int, ...], whole: tuple[int, ...], reason: str
) -> Measure:
    def compute(*cells: Array) -> Array:
        numerator: Array = np.sum([cells[k] for k in part], axis=0)
        denominator: Array = np.sum([cells[k] for k in whole], axis=0)
        return numerator / denominator

    return Measure(name, compute, reason, part, whole)


def _f1(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return 2 * tp / (2 * tp + fp + fn)


def _balanced_accuracy(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return (tp / (tp + fn) + tn / (tn + fp)) / 2


def _matthews(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    scale = np.sqrt(tp + fp) * np.sqrt(tp + fn) * np.sqrt(tn + fp) * np.sqrt(tn + fn)
    coefficient: Array = np.clip((tp * tn - fp * fn) / scale, -1.0, 1.0)
    return coefficient


def _kappa(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    # 1 minus the ratio of disagreement to that of independent judges with the same rates
    chance = (tp + fp) * (fp + tn) + (fn + tn) * (tp + fn)
    return 1.0 - (tp + fp + fn + tn) * (fp + fn) / chance


def _excess(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return (fp - fn) / (tp + fp + fn + tn)


AGREEMENT_MEASURES: Final[Mapping[str, Measure]] = {
    "precision": _share_measure("precision", (0,), (0, 1), "no success was predicted"),
    "recall": _share_measure("recall", (0,), (0, 2), "nothing succeeded"),
    "specificity": _share_measure("specificity", (3,), (1, 3), "nothing failed"),
    "f1": Measure("F1", _f1, "success was neither predicted nor seen"),
    "accuracy": _share_measure("accuracy", (0, 3), (0, 1, 2, 3), "no trials"),
    "balanced_accuracy": Measure("balanced accuracy", _balanced_accuracy, "all ended alike"),
    "matthews": Measure(
        "Matthews correlation", _matthews, "all verdicts or all outcomes are alike", low=-1.0
    ),
    "kappa": Measure("Cohen's kappa", _kappa, "all verdicts and outcomes are alike", low=-1.0),
    "predicted": _share_measure("predicted success", (0, 1), (0, 1, 2, 3), "no trials"),
    "actual": _share_measure("actual success", (0, 2), (0, 1, 2, 3), "no trials"),
    "excess": Measure("predicted minus actual success", _excess, "no trials", low=-1.0),
}
"""Measures by the name of their field in `Agreement`."""


RESAMPLING_DRAWS = 4000  # Resampled confusion matrices.
CELL_PRIOR = 0.5
"""Prior number of trials in each cell, over all strata."""


def draw_cells(counts: Values, population: Array, rng: np.random.Generator) -> Array:
    """Draws confusion matrices from the posterior distribution given the observed one.

    Args:
        counts: (S, 4) trials by stratum and cell.
        population: (S,) population of each stratum; strata without trials are left out.
        rng: random generator.

    Returns:
        (`RESAMPLING_DRAWS`, 4) cells of all strata together, in units of `population`.
    """
    seen = counts.sum(axis=1) > 0
    counts, population = counts[seen].astype(float), population[seen]
    size = counts.sum(axis=1, keepdims=True)
    alpha = counts * np.maximum(size - 2, size / 3) / size + distribute_prior(counts, population)
    drawn = rng.standard_gamma(alpha, (RESAMPLING_DRAWS, *alpha.shape))
    proportions = drawn / drawn.sum(axis=2, keepdims=True)
    expected: Array = np.einsum("dsc,s->dc", proportions, population)
    return expected


def distribute_prior(counts: Array, population: Array) -> Array:
    """Prior of half a trial for each cell, divided by population among the strata with the same
    predicted success as the cell, or among all strata if there are none.

    Args:
        counts: (S, 4) trials by stratum and cell, at least one in each stratum.
        population: (S,) population of each stratum.

    Returns:
        (S, 4) the columns sum to `CELL_PRIOR`.
    """
    shares = np.empty_like(counts)
    for cells in ((0, 1), (2, 3)):  # success predicted, failure predicted
        weight = counts[:, cells].sum(axis=1) / counts.sum(axis=1) * population
        if not weight.any():
            weight = population
        shares[:, cells] = (weight / weight.sum())[:, None]
    return CELL_PRIOR * shares


def draw_unstratified_cells(counts: Values, rng: np.random.Generator, draws: int) -> Array:
    """Draws as `draw_cells`, for many independent matrices.

    Args:
        counts: (G, 4) trials by matrix and cell.
        rng: random generator.
        draws: number of draws of each matrix.

    Returns:
        (draws, G, 4) proportions.
    """
    drawn = rng.standard_gamma(counts + CELL_PRIOR, (draws, *counts.shape))
    share: Array = drawn / drawn.sum(axis=2, keepdims=True)
    return share


def interval_bounds(values: Array) -> tuple[Array, Array]:
    """95 % interval of the values along the first axis; values that are not finite, as when all
    outcomes of a draw are alike, count as 0.

    Args:
        values: (draws, ...).

    Returns:
        Lower and upper bounds (...).
    """
    tails = (0.025, 0.975)  # Probabilities of the bounds of a 95 % interval.
    finite = np.where(np.isfinite(values), values, 0.0)
    ordered = np.sort(np.ascontiguousarray(np.moveaxis(finite, 0, -1)))
    last = ordered.shape[-1] - 1
    low, high = (_interpolate_sorted(ordered, tail * last) for tail in tails)
    return low, high


def _interpolate_sorted(ordered: Array, place: float) -> Array:
    """Interpolates sorted values (..., draws) at a fractional index."""
    below = min(int(place), ordered.shape[-1] - 2) if ordered.shape[-1] > 1 else 0
    one, other = ordered[..., below], ordered[..., min(below + 1, ordered.shape[-1] - 1)]
    return one + (other - one) * (place - below)


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """A confusion matrix of predicted and actual success, and its figures (`AGREEMENT_MEASURES`).

    Attributes:
        trials: number of trials.
        tp, fp, fn, tn: number of trials, or of the grasps that they stand for: predicted successes
            that succeeded and that failed, predicted failures that succeeded and that failed.
        precision: share of the predicted successes that succeeded.
        recall: share of the successes that were predicted.
        specificity: share of the failures that were predicted.
        f1: harmonic mean of precision and recall.
        accuracy: share of right verdicts.
        balanced_accuracy: mean of recall and specificity.
        matthews: correlation of predicted and actual success.
        kappa: agreement beyond chance.
        predicted, actual: shares of successes.
        excess: predicted minus actual; above 0 if too much success is predicted.
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
    """Figures of one matrix. Shares have Wilson's intervals; all other intervals are by resampling,
    see `draw_cells`.

    Args:
        counts: (4,) trials by cell, or (S, 4) trials by stratum and cell.
        population: (S,) population of each stratum. The figures then hold for the whole population,
            and all intervals are by resampling within strata. If None, the figures hold for the
            trials themselves.
        seed: seed of the resampling.
    """
    counts = np.atleast_2d(np.asarray(counts))
    size = counts.sum(axis=1)
    represented = size.astype(float) if population is None else np.asarray(population, dtype=float)
    if not size.any():
        return _make_agreement([0, 0, 0, 0], 0, np.full(len(AGREEMENT_MEASURES), np.nan), None)
    drawn = draw_cells(counts, represented, np.random.default_rng(seed))
    interval = interval_bounds(_compute_measures(drawn))
    trials = int(size.sum())
    if population is None:
        cells = counts.sum(axis=0)
        return _make_agreement(cells.tolist(), trials, _compute_measures(cells), interval)
    weight = np.divide(represented, size, out=np.zeros(len(size)), where=size > 0)
    cells = weight @ counts
    return _make_agreement(
        cells.tolist(), trials, _compute_measures(cells), interval, weighted=True
    )


def estimate_agreements(counts: Values, *, seed: int = 0) -> list[Agreement]:
    """Figures of many matrices at once.

    Args:
        counts: (G, 4) trials by group and cell.
        seed: seed of the resampling.
    """
    max_matrices = 500_000  # Matrices drawn at once, which bounds the memory.
    min_draws = 400  # Minimum number for each group.
    chunk_size = 64  # Groups processed at once; reused memory is faster.
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
    """Measures (..., M) from cells (..., 4); undefined ones are not finite."""
    parts = [cells[..., k].astype(float) for k in range(4)]
    with np.errstate(divide="ignore", invalid="ignore"):
        values = [measure.compute(*parts) for measure in AGREEMENT_MEASURES.values()]
        return np.stack(values, axis=-1)


def _make_agreement(
    cells: Sequence[float],
    trials: int,
    values: Array,
    interval: tuple[Array, Array] | None,
    *,
    weighted: bool = False,
) -> Agreement:
    """An agreement from cells, and from (M,) values of the measures with their bounds."""
    figures = {}
    for k, (name, measure) in enumerate(AGREEMENT_MEASURES.items()):
        if interval is None or not np.isfinite(values[k]):
            figures[name] = Estimate.undefined(measure.reason if trials else "no trials")
        elif measure.is_share and not weighted:
            part, whole = sum(cells[c] for c in measure.part), sum(cells[c] for c in measure.whole)
            figures[name] = estimate_share(part, whole)
        else:
            low, high = float(interval[0][k]), float(interval[1][k])
            figures[name] = Estimate.between(float(values[k]), low, high)
    figures["excess"] = _excess_from_actual(figures["excess"], figures["actual"], cells)
    tp, fp, fn, tn = cells
    return Agreement(trials=trials, tp=tp, fp=fp, fn=fn, tn=tn, **figures)


def _excess_from_actual(excess: Estimate, actual: Estimate, cells: Sequence[float]) -> Estimate:
    """The excess estimate, which follows from the actual success rate if all verdicts are alike."""
    tp, fp, fn, tn = cells
    if excess.value is None or actual.low is None or actual.high is None or (tp + fp and fn + tn):
        return excess
    predicted = 1.0 if tp + fp else 0.0
    return Estimate.between(excess.value, predicted - actual.high, predicted - actual.low)


@dataclass(frozen=True, kw_only=True)
class Paired:
    """Two yes-or-no answers about each trial.

    Attributes:
        trials: number of trials.
        both, only_first, only_second, neither: number of trials in which both answers are yes, only
            one, or neither.
        difference: share of yes among the first answers minus the share among the second.
        p_value: two-sided exact p-value of equal shares; None without trials.
    """

    trials: int
    both: int
    only_first: int
    only_second: int
    neither: int
    difference: Estimate
    p_value: float | None


def compare_paired(first: Flags, second: Flags, *, seed: int = 0) -> Paired:
    """Compares two yes-or-no answers about each trial.

    Args:
        first, second: (N,) truth values.
        seed: seed of the interval's resampling.
    """
    return compare_paired_counts(*count_cells(first, second).tolist(), seed=seed)


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
        differing = only_first + only_second
        if differing:  # both tails of the binomial distribution with one half, which is symmetric
            p_value = min(1.0, 2.0 * float(bdtr(min(only_first, only_second), differing, 0.5)))
    return Paired(
        trials=trials,
        both=both,
        only_first=only_first,
        only_second=only_second,
        neither=neither,
        difference=difference,
        p_value=p_value,
    )
