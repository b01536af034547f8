"""Whether a larger margin means more success: share by bins, ranking, and an isotonic fit."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import SMALLER_IS_BETTER
from burg_drake.experiment.statistics.arrays import Flags
from burg_drake.experiment.statistics.estimates import Estimate, share
from burg_drake.experiment.statistics.ordered import Ordered
from burg_drake.experiment.statistics.rank_statistics import ranking

T = TypeVar("T")

MOST_BINS, TRIALS_A_BIN = 10, 10
FINEST = 2000
"""Rows that an isotonic fit is made of; more are put together first."""
PROBABILITY: Final = "probability"
"""Name of the predicted probability of success, from a table of robustness."""
PREDICTORS: Final = (
    *("clearance", "slip", "tilt", "pad_force", "patch_area", "lift", "others_moved"),
    *("arm_clearance", "tracking_distance", "pushed", "score"),
)
"""Columns of results that may tell how a grasp ends: chosen margins, and the score."""


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
    """A level of an isotonic fit: `share` of successes from `low` to `high`."""

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


def calibrations(
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
            pool.map(lambda name: calibration(name, margins[name], success, weight), margins)
        )
    return tuple(c for c in found if c.bins and c.bins[0].low < c.bins[-1].high)


def calibration(
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
    falling = name in SMALLER_IS_BETTER if smaller_is_better is None else smaller_is_better
    known = np.isfinite(values)
    sign = -1.0 if falling else 1.0
    trials = Ordered.of(
        sign * values[known], success[known], None if weight is None else weight[known]
    )
    return MarginCalibration(
        name=name,
        smaller_is_better=falling,
        trials=int(trials.count.sum()),
        successes=int(trials.good.sum()),
        share=share(trials.good.sum(), trials.count.sum()),
        weighted=None if weight is None else _effective(trials, slice(None)),
        without=int((~known).sum()),
        bins=_along(_bins(trials, sign, weight is not None), falling),
        auroc=ranking(trials),
        auroc_weighted=None if weight is None else ranking(trials, weighted=True),
        isotonic=_along(_isotonic(trials, sign), falling),
    )


def _bins(trials: Ordered, sign: float, weighted: bool) -> list[Bin]:
    total = trials.count.sum()
    first = trials.parts(int(np.clip(total // TRIALS_A_BIN, 1, MOST_BINS)))
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
                share=share(int(good), int(count)),
                weighted=_effective(trials, part) if weighted else None,
            )
        )
    return bins


def _effective(trials: Ordered, part: slice) -> Estimate:
    """Share of successes of what trials stand for; Wilson's interval for the effective number of
    trials (L. Kish, Survey Sampling, 1965)."""
    weight, squares = trials.weight[part].sum(), trials.squares[part].sum()
    if not weight:
        return Estimate.undefined("no trials")
    effective = weight**2 / squares
    return share(trials.good_weight[part].sum() / weight * effective, effective)


def _isotonic(trials: Ordered, sign: float) -> list[IsotonicStep]:
    from scipy.optimize import isotonic_regression

    if not len(trials.value):
        return []
    first = trials.parts(FINEST) if len(trials.value) > FINEST else np.arange(len(trials.value))
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


def _along(rows: list[T], falling: bool) -> tuple[T, ...]:
    """Rows by increasing number."""
    return tuple(reversed(rows)) if falling else tuple(rows)
