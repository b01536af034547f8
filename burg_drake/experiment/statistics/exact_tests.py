"""Exact tests: whether two judges of the same trials differ (McNemar), and whether one group of
trials errs more often than the others (Fisher), with Holm's correction for many groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from burg_drake.experiment.statistics.arrays import Flags
from burg_drake.experiment.statistics.estimates import Estimate
from burg_drake.experiment.statistics.resampling import DRAWS, PRIOR, bounds


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


def paired(first: Flags, second: Flags, *, seed: int = 0) -> Paired:
    """Compares answers.

    Args:
        first, second: (N,) truth values.
        seed: of the interval's resampling.
    """
    both, neither = int((first & second).sum()), int((~first & ~second).sum())
    one, other = int((first & ~second).sum()), int((~first & second).sum())
    return paired_counts(both, one, other, neither, seed=seed)


def paired_counts(
    both: int, only_first: int, only_second: int, neither: int, *, seed: int = 0
) -> Paired:
    """As `paired`, from counts."""
    from scipy.special import bdtr

    trials = both + only_first + only_second + neither
    difference, p_value = Estimate.undefined("no trials"), None
    if trials:
        cells = np.array([both, only_first, only_second, neither]) + PRIOR
        drawn = np.random.default_rng(seed).dirichlet(cells, DRAWS)
        low, high = bounds(drawn[:, 1] - drawn[:, 2])
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


def excess_p_value(errors: int, trials: int, other_errors: int, other_trials: int) -> float:
    """One-sided p-value of Fisher's exact test that a group errs no more often than the others.

    It is the mid-p (H. O. Lancaster, JASA 56, 1961): half the probability of what was seen counts,
    as the exact one finds less than it may where counts are small.

    Args:
        errors, trials: of the group.
        other_errors, other_trials: of all others.
    """
    total = errors + other_errors
    ways = [
        comb(trials, k) * comb(other_trials, total - k)
        for k in range(errors, min(trials, total) + 1)
    ]
    return (ways[0] + 2 * sum(ways[1:])) / (2 * comb(trials + other_trials, total))


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values corrected for their number (S. Holm, Scandinavian Journal of Statistics 6, 1979):
    with those below 0.05 taken for real, the probability of any false one is at most 0.05."""
    order = np.argsort(p_values, kind="stable")
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    scaled = np.minimum(1.0, np.asarray(p_values)[order] * factors)
    corrected[order] = np.maximum.accumulate(scaled)
    return [float(p) for p in corrected]
