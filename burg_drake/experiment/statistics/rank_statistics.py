"""How well a number ranks what ends well above what does not: the area under the ROC curve.

E. R. DeLong, D. M. DeLong, D. L. Clarke-Pearson, Biometrics 44, 1988, with weights; from sorted
trials as in X. Sun, W. Xu, IEEE Signal Processing Letters 21, 2014.
"""

from __future__ import annotations

import math

import numpy as np

from burg_drake.core import Z_95, Array
from burg_drake.experiment.statistics.estimates import Estimate, share
from burg_drake.experiment.statistics.ordered import Ordered

ALIKE = "all ended alike"
MIN_OF_EACH_OUTCOME = 5
"""Successes and failures that a ranking takes: tables show ten margins, and of ten that tell
nothing one ranks all trials without an error by chance with a probability of 8 %, but of 29 % with
four of each."""
TOO_FEW = f"fewer than {MIN_OF_EACH_OUTCOME} successes or failures"
USUAL = 1 / 12
"""Variance of the placements of trials by a number that tells nothing. Two such trials are added
to each kind, so that three failures that happen to be alike do not look certain."""


def ranking(trials: Ordered, *, weighted: bool = False) -> Estimate:
    """Probability that a trial which ended well has a larger number than one that did not; ties
    count half (the statistic of Mann and Whitney).

    The interval is DeLong's on the scale of log odds. Where the two kinds are told apart without
    error there is no spread to measure; it is then Wilson's for as many trials as there are of the
    rarer kind. Undefined with fewer than `MIN_OF_EACH_OUTCOME` of either kind.

    Args:
        trials: sorted by the number.
        weighted: for what the trials stand for, not for the trials.
    """
    good, bad = trials.good, trials.count - trials.good
    if not good.sum() or not bad.sum():
        return Estimate.undefined(ALIKE if trials.count.sum() else "no trials with this number")
    if min(good.sum(), bad.sum()) < MIN_OF_EACH_OUTCOME:
        return Estimate.undefined(TOO_FEW)
    if weighted:
        up, down = trials.good_weight, trials.weight - trials.good_weight
        up2, down2 = trials.good_squares, trials.squares - trials.good_squares
    else:
        up, down, up2, down2 = good, bad, good, bad
    below = (np.cumsum(down) - down / 2) / down.sum()  # share of the bad that a good one beats
    above = 1.0 - (np.cumsum(up) - up / 2) / up.sum()
    area = float(up @ below / up.sum())
    variance = _spread(up, up2, below, good) + _spread(down, down2, above, bad)
    if not 1e-12 < area < 1 - 1e-12:
        rarer = float(min(good.sum(), bad.sum()))
        at = share(round(area * rarer, 9), rarer)
        return Estimate.between(area, at.low or 0.0, 1.0 if at.high is None else at.high)
    odds = math.log(area / (1 - area))
    half = Z_95 * math.sqrt(variance) / (area * (1 - area))
    return Estimate.between(area, _logistic(odds - half), _logistic(odds + half))


def _spread(weight: Array, squares: Array, placed: Array, count: Array) -> float:
    """Variance of the mean of the placements of one kind of trials."""
    number, total = count.sum(), weight.sum()
    mean = weight @ placed / total
    share_of_squares = squares.sum() / total**2  # 1 / number without weights
    variance = squares @ (placed - mean) ** 2 / squares.sum() * number
    return float(share_of_squares * (variance + 2 * USUAL) / (number + 1))


def _logistic(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-odds)) if odds > -700.0 else 0.0
