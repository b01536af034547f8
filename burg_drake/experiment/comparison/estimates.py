"""Estimates with 95 % intervals, measures of a confusion matrix, and resampling of its cells.

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

from collections.abc import Callable, Mapping
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
        reason: why it is undefined; empty otherwise.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    reason: str = ""

    @classmethod
    def undefined(cls, reason: str) -> Estimate:
        """No number, and why."""
        return cls(None, reason=reason)

    @classmethod
    def between(cls, value: float, low: float, high: float) -> Estimate:
        """A number within its interval, which is stretched to it where it has to be."""
        return cls(value, min(value, low), max(value, high))


def estimate_share(successes: float, trials: float, reason: str = "no trials") -> Estimate:
    """A proportion with Wilson's interval; counts may be effective ones, and then no integers.

    Args:
        successes, trials: counts.
        reason: why it is undefined if there are no trials.
    """
    if trials <= 0:
        return Estimate.undefined(reason)
    successes, trials = float(successes), float(trials)
    value = min(1.0, successes / trials)
    low, high = wilson_interval(successes, trials)
    return Estimate.between(value, low, high)


@dataclass(frozen=True)
class Measure:
    """A measure of agreement.

    Attributes:
        name: in words.
        part, whole: cells whose sums it is the ratio of; empty if it is no share.
        of: its values from cells, arrays of one shape; NaN or infinite where undefined.
        low, high: its range.
        reason: why it may be undefined.
    """

    name: str
    of: Callable[[Array, Array, Array, Array], Array]
    reason: str
    part: tuple[int, ...] = ()
    whole: tuple[int, ...] = ()
    low: float = 0.0
    high: float = 1.0

    @property
    def is_share(self) -> bool:
        """Whether it is a proportion of trials."""
        return bool(self.whole)


def _share_measure(
    name: str, part: tuple[int, ...], whole: tuple[int, ...], reason: str
) -> Measure:
    def of(*cells: Array) -> Array:
        added: list[Array] = [np.sum([cells[k] for k in of], axis=0) for of in (part, whole)]
        return added[0] / added[1]

    return Measure(name, of, reason, part, whole)


def _f1(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return 2 * tp / (2 * tp + fp + fn)


def _balanced_accuracy(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return (tp / (tp + fn) + tn / (tn + fp)) / 2


def _matthews(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    scale = np.sqrt(tp + fp) * np.sqrt(tp + fn) * np.sqrt(tn + fp) * np.sqrt(tn + fn)
    coefficient: Array = np.clip((tp * tn - fp * fn) / scale, -1.0, 1.0)
    return coefficient


def _kappa(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    # 1 less the share of disagreement by that of two independent judges with the same habits
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
"""Trials added to each cell, over all strata."""


def draw_cells(
    counts: Values, population: Array, rng: np.random.Generator, draws: int = RESAMPLING_DRAWS
) -> Array:
    """Confusion matrices that may stand behind the one that was seen.

    Args:
        counts: (S, 4) trials by stratum and cell.
        population: (S,) what each stratum stands for; strata without trials are left out.
        rng: of the draws.
        draws: how many.

    Returns:
        (draws, 4) cells of all strata together, in units of `population`.
    """
    seen = counts.sum(axis=1) > 0
    counts, population = counts[seen].astype(float), population[seen]
    size = counts.sum(axis=1, keepdims=True)
    alpha = counts * np.maximum(size - 2, size / 3) / size + distribute_prior(counts, population)
    drawn = rng.standard_gamma(alpha, (draws, *alpha.shape))
    proportions = drawn / drawn.sum(axis=2, keepdims=True)
    expected: Array = np.einsum("dsc,s->dc", proportions, population)
    return expected


def distribute_prior(counts: Array, population: Array) -> Array:
    """Half a trial for each cell, shared among the strata with such verdicts by what those stand
    for, or among all where no stratum has such verdicts.

    Args:
        counts: (S, 4) trials by stratum and cell, at least one in each stratum.
        population: (S,) what each stratum stands for.

    Returns:
        (S, 4) the columns sum to `CELL_PRIOR`.
    """
    shares = np.empty_like(counts)
    for cells in ((0, 1), (2, 3)):  # success predicted, and not
        of = counts[:, cells].sum(axis=1) / counts.sum(axis=1) * population
        if not of.any():
            of = population
        shares[:, cells] = (of / of.sum())[:, None]
    return CELL_PRIOR * shares


def draw_unstratified_cells(
    counts: Values, rng: np.random.Generator, draws: int = RESAMPLING_DRAWS
) -> Array:
    """As `draw_cells` for many matrices that have nothing to do with each other.

    Args:
        counts: (G, 4) trials by matrix and cell.
        rng: of the draws.
        draws: how many of each.

    Returns:
        (draws, G, 4) proportions.
    """
    drawn = rng.standard_gamma(counts + CELL_PRIOR, (draws, *counts.shape))
    share: Array = drawn / drawn.sum(axis=2, keepdims=True)
    return share


def interval_bounds(values: Array) -> tuple[Array, Array]:
    """95 % of the values along the first axis; what is not finite, as where all outcomes of a draw
    are alike, counts as 0.

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
    """What sorted values (..., draws) are at a place between two of them."""
    below = min(int(place), ordered.shape[-1] - 2) if ordered.shape[-1] > 1 else 0
    one, other = ordered[..., below], ordered[..., min(below + 1, ordered.shape[-1] - 1)]
    return one + (other - one) * (place - below)
