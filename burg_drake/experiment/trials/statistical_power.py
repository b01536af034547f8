"""Expected interval widths and detectable differences for a number of trials.

Both are known before the first trial, for assumed success rates.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import TextTable, wilson_interval
from burg_drake.experiment.trials.trial_sheet import Stratum, TrialSheet, is_success


@dataclass(frozen=True)
class ExpectedEstimate:
    """A share to be estimated.

    Attributes:
        name: name of the share.
        trials: effective number of trials, not whole if trials have different weights.
    """

    name: str
    trials: float


def half_width(share: float, trials: int) -> float:
    """Half the width that Wilson's 95 % interval of a share will have on average.

    Args:
        share: true share of successes.
        trials: number of trials.
    """
    from scipy.stats import binom

    if trials == 0:
        return 0.5
    counts = np.arange(trials + 1)
    bounds = np.array([wilson_interval(k, trials) for k in counts.tolist()])
    return float(binom.pmf(counts, trials, share) @ (bounds[:, 1] - bounds[:, 0]) / 2.0)


def mcnemar_power(trials: int, better: float, worse: float, alpha: float = 0.05) -> float:
    """Power of McNemar's exact test to tell two methods apart on the same trials.

    Args:
        trials: number of trials.
        better: share of trials where only the better method is right.
        worse: share of trials where only the other method is right.
        alpha: significance level, two-sided.
    """
    from scipy.stats import binom

    disagreement = better + worse
    if disagreement <= 0.0:
        return 0.0
    m = np.arange(trials + 1)  # number of trials on which the methods disagree
    limit = _rejection_limit(m, alpha)
    q = better / disagreement
    power = np.where(limit >= 0, binom.cdf(limit, m, q) + binom.sf(m - limit - 1, m, q), 0.0)
    return float(binom.pmf(m, trials, min(disagreement, 1.0)) @ power)


def smallest_difference(
    trials: int, worse: float = 0.0, *, power: float = 0.8, alpha: float = 0.05
) -> float:
    """Smallest difference between two methods that McNemar's exact test finds with a given power.

    Args:
        trials: number of trials of both methods.
        worse: share of trials where only the worse method is right.
        power: chance that the test finds the difference.
        alpha: significance level, two-sided.

    Returns:
        Difference of the shares of right answers; NaN if even the largest possible one is not
        found.
    """
    from scipy.optimize import brentq

    largest = 1.0 - 2.0 * worse  # in all other trials only the better method is right

    def missing_power(difference: float) -> float:
        return mcnemar_power(trials, worse + difference, worse, alpha) - power

    if largest <= 0.0 or missing_power(largest) < 0.0:
        return math.nan
    return float(brentq(missing_power, 0.0, largest, xtol=1e-4))


def expected_estimates(sheet: TrialSheet) -> list[ExpectedEstimate]:
    """Shares that the trials will estimate: success by object, overall, and weighted to all
    grasps; precision and recall of the simulation.
    """
    objects = Counter(trial.object for trial in sheet.trials)
    positive = sum(is_success(t.simulated, sheet.selection.success) for t in sheet.trials)
    figures = [ExpectedEstimate(name, count) for name, count in sorted(objects.items())]
    figures.append(ExpectedEstimate("all", len(sheet.trials)))
    weighted = effective_trials(sheet.strata)
    if weighted < len(sheet.trials) - 0.5:
        figures.append(ExpectedEstimate("all, weighted", weighted))
    return [*figures, ExpectedEstimate("precision", positive), ExpectedEstimate("recall", positive)]


def effective_trials(strata: Mapping[str, Stratum]) -> float:
    """Effective number of trials of strata, where each trial represents `population / selected`
    grasps (L. Kish, Survey Sampling, 1965).
    """
    chosen = [s for s in strata.values() if s.selected]
    total = sum(s.population for s in chosen)
    squares = sum(s.population**2 / s.selected for s in chosen)
    return total**2 / squares if squares else 0.0


def power_table(sheet: TrialSheet) -> TextTable:
    """Table of expected widths of 95 % intervals, one row per figure."""
    shares = (0.5, 0.8, 0.95)  # intervals are widest at 0.5
    table = TextTable("Half-width of the 95 % interval if the share turns out to be").names("share")
    table.numbers("trials", *(f"{100 * share:.0f} %" for share in shares))
    for row in expected_estimates(sheet):
        widths = [half_width(share, round(row.trials)) for share in shares]
        cells = [f"± {100 * width:.0f} %" for width in widths]
        table.row(row.name, f"{row.trials:.0f}", *cells)
    table.caption = (
        "precision: of the grasps that succeed in simulation; recall: if as many succeed"
        " on the robot; weighted: for all grasps to choose from, not only the chosen"
        " ones"
    )
    return table


def detectable_difference_sentence(trials: int) -> str:
    """Sentence on the detectable difference between two methods."""
    # Keys: share of trials in which only the method that is worse overall is right.
    found = {worse: smallest_difference(trials, worse) for worse in (0.0, 0.05, 0.1)}
    if all(math.isnan(size) for size in found.values()):
        return (
            f"{trials} trials are too few for McNemar's exact test (5 %) to tell two"
            " methods apart with 80 % power, however much they differ."
        )
    differences = [
        f"{100 * size:.0f} points"
        + (f", if it is right alone in {100 * worse:.0f} % of the trials" if worse else "")
        for worse, size in found.items()
        if not math.isnan(size)
    ]
    return (
        f"Comparing two methods on the same {trials} trials (McNemar's exact test at 5 %,"
        " power 80 %): if the worse one is never right alone, they must differ by "
        f"{'; by '.join(differences)}."
    )


def _rejection_limit(m: NDArray[np.int64], alpha: float) -> NDArray[np.int64]:
    """Largest count of the rarer of the two kinds of `m` disagreements at which the two-sided exact
    test rejects; -1 where it never rejects."""
    from scipy.stats import binom

    # smallest count whose lower tail is at least alpha / 2
    most = binom.ppf(alpha / 2.0, m, 0.5).astype(np.int64)
    critical: NDArray[np.int64] = np.where(2.0 * binom.cdf(most, m, 0.5) <= alpha, most, most - 1)
    return critical
