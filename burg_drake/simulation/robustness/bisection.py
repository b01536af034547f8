"""Finds the largest of a growing load that something still bears."""

from __future__ import annotations

import math
from collections.abc import Callable

STRIDE = 1.5
"""Factor between two loads as long as the limit is not between any two."""


def largest_passing(
    passes: Callable[[float], bool], *, guess: float, low: float, high: float, tolerance: float
) -> float:
    """Searches from a guess in growing or falling strides, then by bisection of the logarithm.

    What bears a load need not bear every smaller one; the load that is returned is borne, and one
    that is larger by at most `tolerance` is not.

    Args:
        passes: whether a load is borne.
        guess: where the search starts; the nearer to the limit, the fewer loads are tried.
        low, high: smallest and largest load tried, above 0.
        tolerance: relative, above 0.

    Returns:
        The load; 0 if not even `low` is borne, infinity if `high` is.
    """
    borne, lost = 0.0, math.inf
    load = min(max(guess, low), high)
    while True:
        if passes(load):
            if load == high:
                return math.inf
            borne = load
        else:
            if load == low:
                return 0.0
            lost = load
        if lost == math.inf:
            load = min(borne * STRIDE, high)
        elif borne == 0.0:
            load = max(lost / STRIDE, low)
        elif lost <= borne * (1.0 + tolerance):
            return borne
        else:
            load = math.sqrt(borne * lost)
