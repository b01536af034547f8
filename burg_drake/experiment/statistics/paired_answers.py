"""Whether two answers about the same trials differ: McNemar's exact test."""

from __future__ import annotations

from dataclasses import dataclass

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
