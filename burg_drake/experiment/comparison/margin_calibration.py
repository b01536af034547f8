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
"""Neighbouring trials share rows above it; this changes the ROC area by 2 / rows at most."""


@dataclass(frozen=True, eq=False)
class OrderedTrials:
    """Trials by increasing number; those with equal numbers are one row.

    Attributes:
        value: (G,) smallest number of each row, increasing.
        last: (G,) its largest number, which is the same unless there are too many rows.
        count, good: (G,) trials, and those that ended well.
        weight, good_weight: (G,) sums of what they stand for.
        squares, good_squares: (G,) sums of the squares of that.
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
            values: (N,) finite numbers.
            good: (N,) truth values.
            weight: (N,) what each stands for; 1 if None.
        """
        if weight is None:
            ordered, best = np.sort(values), np.sort(values[good])
            first = _row_starts(ordered)
            edges = np.r_[first, len(ordered)]
            below = np.r_[np.searchsorted(best, ordered[first]), len(best)]
            count, well = np.diff(edges).astype(float), np.diff(below).astype(float)
            return cls(ordered[first], ordered[edges[1:] - 1], *(count, well) * 3)
        order = np.argsort(values)
        ordered, w, g = values[order], weight[order], good[order]
        first = _row_starts(ordered)
        edges = np.r_[first, len(ordered)]

        def sums(column: Values) -> Array:
            return np.diff(np.r_[0.0, np.cumsum(column)][edges])

        ends = ordered[first], ordered[edges[1:] - 1]
        count = np.diff(edges).astype(float)
        return cls(*ends, count, sums(g), sums(w), sums(w * g), sums(w * w), sums(w * w * g))

    def parts(self, number: int) -> Rows:
        """Index of the first row of each of `number` parts with about equally many trials; fewer
        where ties leave fewer, as equal numbers are never parted."""
        if not len(self.value):
            return np.zeros(0, dtype=np.intp)
        middle = np.cumsum(self.count) - self.count / 2
        part = np.floor(middle / self.count.sum() * number).astype(np.intp)
        return np.flatnonzero(np.r_[True, part[1:] != part[:-1]])


def _row_starts(ordered: Array) -> Rows:
    """Where rows begin among sorted numbers."""
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
    """Probability that a trial which ended well has a larger number than one that did not; ties
    count half (the statistic of Mann and Whitney).

    The interval is DeLong's on the scale of log odds. Where the two kinds are told apart without
    error there is no spread to measure; it is then Wilson's for as many trials as there are of the
    rarer kind. Undefined with fewer than `MIN_TRIALS_PER_OUTCOME` of either kind.

    Args:
        trials: sorted by the number.
        weighted: for what the trials stand for, not for the trials.
    """
    # Reason of an undefined estimate.
    too_few = f"fewer than {MIN_TRIALS_PER_OUTCOME} successes or failures"
    good, bad = trials.good, trials.count - trials.good
    if not good.sum() or not bad.sum():
        return Estimate.undefined(
            "all ended alike" if trials.count.sum() else "no trials with this number"
        )
    if min(good.sum(), bad.sum()) < MIN_TRIALS_PER_OUTCOME:
        return Estimate.undefined(too_few)
    if weighted:
        up, down = trials.good_weight, trials.weight - trials.good_weight
        up2, down2 = trials.good_squares, trials.squares - trials.good_squares
    else:
        up, down, up2, down2 = good, bad, good, bad
    below = (np.cumsum(down) - down / 2) / down.sum()  # share of the bad that a good one beats
    above = 1.0 - (np.cumsum(up) - up / 2) / up.sum()
    area = float(up @ below / up.sum())
    variance = _placement_variance(up, up2, below, good) + _placement_variance(
        down, down2, above, bad
    )
    if not 1e-12 < area < 1 - 1e-12:
        rarer = float(min(good.sum(), bad.sum()))
        at = estimate_share(round(area * rarer, 9), rarer)
        return Estimate.between(area, at.low or 0.0, 1.0 if at.high is None else at.high)
    odds = math.log(area / (1 - area))
    half = Z_95 * math.sqrt(variance) / (area * (1 - area))
    return Estimate.between(area, _logistic(odds - half), _logistic(odds + half))


def _placement_variance(weight: Array, squares: Array, placed: Array, count: Array) -> float:
    """Variance of the mean of the placements of one kind of trials."""
    # Of the placements of trials by an uninformative number; two are added.
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
"""Margins and score: columns that may predict success."""


@dataclass(frozen=True, kw_only=True)
class Bin:
    """Trials with similar numbers.

    Attributes:
        low, high, mean: of the number, in the units of its column.
        trials, successes: counts.
        share: of successes.
        weighted: the same for what the trials stand for, its interval by the effective number of
            trials; None without weights.
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
    """What a number tells about success.

    Attributes:
        name: of the margin; `probability`.
        smaller_is_better: whether success should come with small numbers.
        trials, successes: with a number.
        share: of successes among them.
        weighted: the same for what the trials stand for; None without weights.
        without: trials that have none, as where the simulation stopped before it is measured.
        bins: by increasing number, about equally many trials in each.
        auroc: probability that a success has the better number of a success and a failure.
        auroc_weighted: the same for what the trials stand for; None without weights.
        isotonic: the best monotone fit of the share of successes, weighted if there are weights.
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
        margins: (N,) values by name; NaN where there is none.
        success: (N,) truth values.
        weight: (N,) what each trial stands for.
    """
    with ThreadPoolExecutor() as pool:  # sorting takes most of the time, and leaves Python alone
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
    """What a number tells about success.

    Args:
        name: of the number.
        values: (N,) NaN where there is none; infinite ones are left out, too.
        success: (N,) truth values.
        weight: (N,) what each trial stands for.
        smaller_is_better: as is known of margins if None.
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
    max_bins = 10  # Bins of a calibration.
    trials_per_bin = 10  # At least, where there are enough trials.
    total = trials.count.sum()
    first = trials.parts(int(np.clip(total // trials_per_bin, 1, max_bins)))
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
    """Share of successes of what trials stand for; Wilson's interval for the effective number of
    trials (L. Kish, Survey Sampling, 1965)."""
    weight, squares = trials.weight[part].sum(), trials.squares[part].sum()
    if not weight:
        return Estimate.undefined("no trials")
    effective = weight**2 / squares
    return estimate_share(trials.good_weight[part].sum() / weight * effective, effective)


def _fit_isotonic(trials: OrderedTrials, sign: float) -> list[IsotonicStep]:
    max_rows = 2000  # Rows of the isotonic fit; neighbours are combined to get there.
    from scipy.optimize import isotonic_regression

    if not len(trials.value):
        return []
    first = trials.parts(max_rows) if len(trials.value) > max_rows else np.arange(len(trials.value))
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
    """Rows by increasing number."""
    return tuple(reversed(rows)) if falling else tuple(rows)
