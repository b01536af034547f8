"""Confidence intervals for proportions from counts, and robust weights of residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from burg_drake.core.arrays import Array

Z_95 = 1.959963984540054
"""97.5 % quantile of the normal distribution."""
TUKEY_LIMIT = 4.685
"""Standard deviations at which `tukey_weights` reach 0: 95 % efficiency on normal residuals."""


def wilson_interval(successes: float, trials: float) -> tuple[float, float]:
    """Wilson's 95 % score interval for a proportion (E. B. Wilson, JASA 22, 1927).

    Args:
        successes, trials: counts, or effective ones of weighted trials.

    Returns:
        Lower and upper bound in [0, 1]; all of it if there were no trials.
    """
    if trials == 0:
        return 0.0, 1.0
    share, z = successes / trials, Z_95
    scale = 1.0 + z * z / trials
    center = (share + z * z / (2 * trials)) / scale
    half = z / scale * math.sqrt(share * (1 - share) / trials + (z / (2 * trials)) ** 2)
    # the bounds meet 0 and 1 exactly in theory, but not in floating point
    lower = 0.0 if successes == 0 else max(0.0, center - half)
    upper = 1.0 if successes == trials else min(1.0, center + half)
    return lower, upper


def clustered_interval(successes: Sequence[float], trials: Sequence[float]) -> tuple[float, float]:
    """95 % interval for a proportion whose trials come in clusters that may differ, such as scenes:
    the linearised variance of a ratio of totals (W. G. Cochran, Sampling Techniques, 1977, ch. 6)
    with Student's quantile; never narrower than Wilson's, which takes all trials as independent.

    Args:
        successes, trials: (S,) counts of each cluster; sums of values between 0 and 1 and their
            number, for a mean of such values.

    Returns:
        Lower and upper bound in [0, 1]; all of it if there were no trials.
    """
    k, n = np.asarray(successes, dtype=float), np.asarray(trials, dtype=float)
    k, n = k[n > 0.0], n[n > 0.0]
    whole = float(n.sum())
    low, high = wilson_interval(float(k.sum()), whole)
    if len(n) < 2:
        return low, high
    from scipy.special import stdtrit

    share = float(k.sum()) / whole
    spread = float(((k - share * n) ** 2).sum()) * len(n) / (len(n) - 1)
    half = float(stdtrit(len(n) - 1, 0.975)) * (math.sqrt(spread) / whole)
    return max(0.0, min(low, share - half)), min(1.0, max(high, share + half))


def mean_interval(values: Array) -> tuple[float, float]:
    """95 % interval for the mean of values between 0 and 1, such as a precision in each scene.

    It is Wilson's with an effective number of trials: that at which a share would vary as much as
    the mean does (E. L. Korn and B. I. Graubard, Survey Methodology 24, 1998). At most three for
    each value, as a few values may lack the rare ones that matter.

    Args:
        values: (N,) independent values.

    Returns:
        Lower and upper bound in [0, 1]; all of it if there are no values.
    """
    n, mean = len(values), float(values.mean()) if len(values) else 0.0
    variance = float(values.var(ddof=1)) / n if n > 1 else 0.0
    if variance == 0.0:
        return wilson_interval(mean * n, n)
    from scipy.special import stdtrit

    trials = min(3.0 * n, mean * (1.0 - mean) / variance)
    trials *= (Z_95 / float(stdtrit(n - 1, 0.975))) ** 2
    return wilson_interval(mean * trials, trials)


def robust_sd(residuals: Array) -> float:
    """Standard deviation of normal residuals, by their median absolute value."""
    return 1.4826 * float(np.median(np.abs(residuals)))


def tukey_weights(ratio: Array) -> Array:
    """(N,) Tukey's weights of residuals (N,) that are given relative to the limit at which weights
    reach 0."""
    return np.where(np.abs(ratio) < 1.0, (1.0 - ratio**2) ** 2, 0.0)
