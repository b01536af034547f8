"""Relation of a margin to success: success rate by bin, area under the ROC curve, isotonic fit.

The area under the ROC curve has the variance of E. R. DeLong, D. M. DeLong, D. L. Clarke-Pearson,
Biometrics 44, 1988, with weights; it is computed from sorted trials as in X. Sun, W. Xu, IEEE
Signal Processing Letters 21, 2014.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from burg_drake.core import Z_95, Array, MarginNames
from burg_drake.experiment.comparison.confusion_matrix import (
    Estimate,
    Flags,
    Rows,
    Values,
    estimate_share,
)

MAX_ORDERED_ROWS = 20_000
"""Maximum number of rows; above it, neighbouring trials share rows, which changes the ROC area by
at most 2 / rows.
"""


@dataclass(frozen=True, eq=False)
class OrderedTrials:
    """Trials sorted by value; trials with equal values share a row.

    Attributes:
        value: (G,) smallest value of each row, increasing.
        last: (G,) largest value of each row; equal to `value` unless rows were combined.
        count, good: (G,) number of trials and of successes.
        weight, good_weight: (G,) sums of the weights of the trials and of the successes.
        squares, good_squares: (G,) sums of their squared weights.
    """

    value: Array
    last: Array
    count: Array
    good: Array
    weight: Array
    good_weight: Array
    squares: Array
    good_squares: Array

    @classmethod
    def of(cls, values: Array, good: Flags, weight: Array | None = None) -> OrderedTrials:
        """Sorts trials.

        Args:
            values: (N,) finite values.
            good: (N,) whether each is a success.
            weight: (N,) weight of each; 1 if None.
        """
        if weight is None:
            ordered, of_successes = np.sort(values), np.sort(values[good])
            first = _row_starts(ordered)
            edges = np.r_[first, len(ordered)]
            good_edges = np.r_[np.searchsorted(of_successes, ordered[first]), len(of_successes)]
            counts = np.diff(edges).astype(float), np.diff(good_edges).astype(float)
            return cls(ordered[first], ordered[edges[1:] - 1], *counts * 3)
        order = np.argsort(values)
        ordered, w, g = values[order], weight[order], good[order]
        first = _row_starts(ordered)
        edges = np.r_[first, len(ordered)]

        def sums(column: Values) -> Array:
            return np.diff(np.r_[0.0, np.cumsum(column)][edges])

        ends = ordered[first], ordered[edges[1:] - 1]
        count = np.diff(edges).astype(float)
        return cls(*ends, count, sums(g), sums(w), sums(w * g), sums(w * w), sums(w * w * g))

    def part_starts(self, number: int) -> Rows:
        """Divides the rows into `number` parts with about equally many trials; returns the index of
        the first row of each part. Equal values are never separated, so ties may give fewer parts.
        """
        if not len(self.value):
            return np.zeros(0, dtype=np.intp)
        middle = np.cumsum(self.count) - self.count / 2
        part = np.floor(middle / self.count.sum() * number).astype(np.intp)
        return np.flatnonzero(np.r_[True, part[1:] != part[:-1]])


def _row_starts(ordered: Array) -> Rows:
    """Start indices of the rows among sorted values."""
    first = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]][: len(ordered)])
    if len(first) <= MAX_ORDERED_ROWS:
        return first
    size = np.diff(np.r_[first, len(ordered)])
    part, large = first * MAX_ORDERED_ROWS // len(ordered), size * MAX_ORDERED_ROWS > len(ordered)
    begins = (part[1:] != part[:-1]) | large[1:] | large[:-1]
    return first[np.r_[True, begins]]


MIN_TRIALS_PER_OUTCOME = 5
"""With 5, one of ten uninformative margins ranks perfectly by chance in 8 % of cases."""


def estimate_auroc(trials: OrderedTrials, *, weighted: bool = False) -> Estimate:
    """Probability that a success has a larger value than a failure; ties count half (Mann-Whitney
    statistic).

    The interval is DeLong's on the log-odds scale. With perfect separation DeLong's variance is
    zero; the interval is then Wilson's for the number of trials with the rarer outcome. Undefined
    with fewer than `MIN_TRIALS_PER_OUTCOME` successes or failures.

    Args:
        trials: sorted trials.
        weighted: use the weights of the trials.
    """
    good, bad = trials.good, trials.count - trials.good
    if not good.sum() or not bad.sum():
        return Estimate.undefined(
            "all ended alike" if trials.count.sum() else "no trials with this number"
        )
    if min(good.sum(), bad.sum()) < MIN_TRIALS_PER_OUTCOME:
        return Estimate.undefined(f"fewer than {MIN_TRIALS_PER_OUTCOME} successes or failures")
    if weighted:
        up, down = trials.good_weight, trials.weight - trials.good_weight
        up2, down2 = trials.good_squares, trials.squares - trials.good_squares
    else:
        up, down, up2, down2 = good, bad, good, bad
    below = (np.cumsum(down) - down / 2) / down.sum()  # share of failures below a success
    above = 1.0 - (np.cumsum(up) - up / 2) / up.sum()
    area = float(up @ below / up.sum())
    variance = _placement_variance(up, up2, below, good) + _placement_variance(
        down, down2, above, bad
    )
    if not 1e-12 < area < 1 - 1e-12:
        rarer = float(min(good.sum(), bad.sum()))
        share = estimate_share(round(area * rarer, 9), rarer)
        return Estimate.between(area, share.low or 0.0, 1.0 if share.high is None else share.high)
    odds = math.log(area / (1 - area))
    half = Z_95 * math.sqrt(variance) / (area * (1 - area))
    return Estimate.between(area, _logistic(odds - half), _logistic(odds + half))


def _placement_variance(weight: Array, squares: Array, placed: Array, count: Array) -> float:
    """Variance of the mean placement of the successes or of the failures."""
    # Variance of the placements by an uninformative margin; two such trials are added.
    uninformative_variance = 1 / 12
    number, total = count.sum(), weight.sum()
    mean = weight @ placed / total
    share_of_squares = squares.sum() / total**2  # 1 / number without weights
    variance = squares @ (placed - mean) ** 2 / squares.sum() * number
    return float(share_of_squares * (variance + 2 * uninformative_variance) / (number + 1))


def _logistic(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-odds)) if odds > -700.0 else 0.0


T = TypeVar("T")

PROBABILITY_MARGIN: Final = "probability"
"""Name of the success probability predicted by a table of robustness."""
PREDICTOR_COLUMNS: Final = (
    *("clearance", "slip", "tilt", "pad_force", "patch_area", "lift", "others_moved"),
    *("arm_clearance", "tracking_distance", "pushed", "score"),
)
"""Columns that may predict success: margins and score."""


@dataclass(frozen=True, kw_only=True)
class Bin:
    """Trials with similar values.

    Attributes:
        low, high, mean: bounds and mean of the values, in the units of their column.
        trials, successes: counts.
        share: share of successes.
        weighted: weighted share, with its interval by the effective number of trials; None without
            weights.
    """

    low: float
    high: float
    mean: float
    trials: int
    successes: int
    share: Estimate
    weighted: Estimate | None = None


@dataclass(frozen=True, kw_only=True)
class IsotonicStep:
    """A level of an isotonic fit: `estimate_share` of successes from `low` to `high`."""

    low: float
    high: float
    share: float


@dataclass(frozen=True, kw_only=True)
class MarginCalibration:
    """Relation of a margin to success.

    Attributes:
        name: name of the margin; `probability`.
        smaller_is_better: whether small values should mean success.
        trials, successes: counts of trials with a value.
        share: share of successes among them.
        weighted: weighted share; None without weights.
        without: number of trials without a value, such as when the simulation ended before the
            measurement.
        bins: bins by increasing value, with about equally many trials.
        auroc: probability that a success has a better value than a failure.
        auroc_weighted: weighted AUROC; None without weights.
        isotonic: best monotone fit of the share of successes, weighted if there are weights.
    """

    name: str
    smaller_is_better: bool
    trials: int
    successes: int
    share: Estimate
    weighted: Estimate | None
    without: int
    bins: tuple[Bin, ...]
    auroc: Estimate
    auroc_weighted: Estimate | None
    isotonic: tuple[IsotonicStep, ...]


def calibrate_margins(
    margins: Mapping[str, Array], success: Flags, weight: Array | None = None
) -> tuple[MarginCalibration, ...]:
    """Calibration of each margin that differs between trials.

    Args:
        margins: (N,) values by name; NaN if unknown.
        success: (N,) truth values.
        weight: (N,) weight of each trial.
    """
    with ThreadPoolExecutor() as pool:  # sorting takes most of the time and releases the GIL
        found = list(
            pool.map(lambda name: calibrate_margin(name, margins[name], success, weight), margins)
        )
    return tuple(c for c in found if c.bins and c.bins[0].low < c.bins[-1].high)


def calibrate_margin(
    name: str,
    values: Array,
    success: Flags,
    weight: Array | None = None,
    *,
    smaller_is_better: bool | None = None,
) -> MarginCalibration:
    """Relation of a margin to success.

    Args:
        name: name of the margin.
        values: (N,) values; trials with NaN or infinity are left out.
        success: (N,) truth values.
        weight: (N,) weight of each trial.
        smaller_is_better: direction; that of the known margin if None.
    """
    falling = (
        name in MarginNames.smaller_is_better if smaller_is_better is None else smaller_is_better
    )
    known = np.isfinite(values)
    sign = -1.0 if falling else 1.0
    trials = OrderedTrials.of(
        sign * values[known], success[known], None if weight is None else weight[known]
    )
    return MarginCalibration(
        name=name,
        smaller_is_better=falling,
        trials=int(trials.count.sum()),
        successes=int(trials.good.sum()),
        share=estimate_share(trials.good.sum(), trials.count.sum()),
        weighted=None if weight is None else _population_share(trials, slice(None)),
        without=int((~known).sum()),
        bins=_sort_rising(_make_bins(trials, sign, weight is not None), falling),
        auroc=estimate_auroc(trials),
        auroc_weighted=None if weight is None else estimate_auroc(trials, weighted=True),
        isotonic=_sort_rising(_fit_isotonic(trials, sign), falling),
    )


def _make_bins(trials: OrderedTrials, sign: float, weighted: bool) -> list[Bin]:
    max_bins = 10  # Maximum number of bins.
    trials_per_bin = 10  # Minimum per bin, if there are enough trials.
    total = trials.count.sum()
    first = trials.part_starts(int(np.clip(total // trials_per_bin, 1, max_bins)))
    bins = []
    for start, end in zip(first, [*first[1:], len(trials.value)][: len(first)], strict=True):
        part = slice(start, end)
        ends = sorted((sign * trials.value[start], sign * trials.last[end - 1]))
        count, good = trials.count[part].sum(), trials.good[part].sum()
        bins.append(
            Bin(
                low=float(ends[0]),
                high=float(ends[1]),
                mean=float(sign * (trials.value[part] @ trials.count[part]) / count),
                trials=int(count),
                successes=int(good),
                share=estimate_share(int(good), int(count)),
                weighted=_population_share(trials, part) if weighted else None,
            )
        )
    return bins


def _population_share(trials: OrderedTrials, part: slice) -> Estimate:
    """Weighted share of successes, with Wilson's interval for the effective number of trials (L.
    Kish, Survey Sampling, 1965).
    """
    weight, squares = trials.weight[part].sum(), trials.squares[part].sum()
    if not weight:
        return Estimate.undefined("no trials")
    effective = weight**2 / squares
    return estimate_share(trials.good_weight[part].sum() / weight * effective, effective)


def _fit_isotonic(trials: OrderedTrials, sign: float) -> list[IsotonicStep]:
    max_rows = 2000  # Maximum number of rows of the isotonic fit; neighbours are combined.
    from scipy.optimize import isotonic_regression

    if not len(trials.value):
        return []
    first = np.arange(len(trials.value))
    if len(first) > max_rows:
        first = trials.part_starts(max_rows)
    weight = np.add.reduceat(trials.weight, first)
    shares = np.add.reduceat(trials.good_weight, first) / weight
    fit = isotonic_regression(shares, weights=weight)
    last = np.r_[first[1:], len(trials.value)] - 1
    steps = []
    for start, end in zip(fit.blocks[:-1], fit.blocks[1:], strict=True):
        ends = sorted((sign * trials.value[first[start]], sign * trials.last[last[end - 1]]))
        steps.append(
            IsotonicStep(low=float(ends[0]), high=float(ends[1]), share=float(fit.x[start]))
        )
    return steps


def _sort_rising(rows: list[T], falling: bool) -> tuple[T, ...]:
    """Sorts rows by increasing value."""
    return tuple(reversed(rows)) if falling else tuple(rows)
