"""How far the hand lifts where there is no room for the whole lift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array

LENGTH_TOLERANCE = 1e-9
"""Lengths that differ by less are the same [m]."""


@dataclass(frozen=True)
class ShortLifts:
    """Grasps with room for a part of the lift.

    Attributes:
        grasps: how many have room for any of the lifts that were allowed.
        short: how many of them for less than the whole one.
        whole: its length [m].
        median, least: of the short ones [m].
    """

    grasps: int
    short: int
    whole: float
    median: float
    least: float

    def __str__(self) -> str:
        text = (
            f"For {self.short} of {self.grasps} grasps there is no room to lift the whole"
            f" {1e3 * self.whole:g} mm: "
        )
        if self.short == 1:
            return f"{text}it is lifted {1e3 * self.least:.0f} mm."
        least = f"the shortest lift is {1e3 * self.least:.0f} mm"
        return f"{text}the median is {1e3 * self.median:.0f} mm, {least}."


def short_lifts(lift_height: Array, whole: float) -> ShortLifts | None:
    """Counts them.

    Args:
        lift_height: (N,) column of a table, NaN where there is no lift [m].
        whole: length of the lift that was asked for [m].

    Returns:
        None if no lift is short.
    """
    known = lift_height[np.isfinite(lift_height)]
    short = known[known < whole - LENGTH_TOLERANCE]
    if not len(short):
        return None
    return ShortLifts(len(known), len(short), whole, float(np.median(short)), float(short.min()))
