"""Trials in the order of a number that should tell how they end, ties put together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core.frames import Array
from burg_drake.experiment.comparison.arrays import Flags, Rows, Values

FINEST = 20_000
"""Rows; of more the trials with neighbouring numbers share one, which changes a share of trials by
less than 1e-4."""


@dataclass(frozen=True, eq=False)
class Ordered:
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
    def of(cls, values: Array, good: Flags, weight: Array | None = None) -> Ordered:
        """Sorts trials.

        Args:
            values: (N,) finite numbers.
            good: (N,) truth values.
            weight: (N,) what each stands for; 1 if None.
        """
        order = np.argsort(values)
        ordered = values[order]
        first = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]][: len(ordered)])
        if len(first) > FINEST:
            even = np.linspace(0, len(ordered), FINEST, endpoint=False)
            first = np.unique(first[np.searchsorted(first, even[even <= first[-1]])])
        edges = np.r_[first, len(ordered)]
        ends = ordered[first], ordered[edges[1:] - 1]

        def sums(column: Values) -> Array:
            return np.diff(np.r_[0.0, np.cumsum(column)][edges])

        count, well = np.diff(edges).astype(float), sums(good[order])
        if weight is None:
            return cls(*ends, count, well, count, well, count, well)
        w, g = weight[order], good[order]
        return cls(*ends, count, well, sums(w), sums(w * g), sums(w * w), sums(w * w * g))

    def parts(self, number: int) -> Rows:
        """Index of the first row of each of `number` parts with about equally many trials; fewer
        where ties leave fewer, as equal numbers are never parted."""
        if not len(self.value):
            return np.zeros(0, dtype=np.intp)
        middle = np.cumsum(self.count) - self.count / 2
        part = np.floor(middle / self.count.sum() * number).astype(np.intp)
        return np.flatnonzero(np.r_[True, part[1:] != part[:-1]])
