"""Trials in the order of a number that should tell how they end, ties put together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.experiment.statistics.arrays import Flags, Rows, Values

FINEST = 20_000
"""Rows, about; of more the trials with neighbouring numbers share one.

A number that more than one in so many trials have keeps its own row, so that two in so many share
one at most. That changes the area under the ROC curve by 2 / FINEST = 1e-4 at most: it halves what
a success and a failure in one row count, and a row has at most 4 / FINEST of the more frequent kind
of them. `benchmarks/compare.py area` measures it.
"""


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
        if weight is None:
            ordered, best = np.sort(values), np.sort(values[good])
            first = _first(ordered)
            edges = np.r_[first, len(ordered)]
            below = np.r_[np.searchsorted(best, ordered[first]), len(best)]
            count, well = np.diff(edges).astype(float), np.diff(below).astype(float)
            return cls(ordered[first], ordered[edges[1:] - 1], *(count, well) * 3)
        order = np.argsort(values)
        ordered, w, g = values[order], weight[order], good[order]
        first = _first(ordered)
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


def _first(ordered: Array) -> Rows:
    """Where rows begin among sorted numbers."""
    first = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]][: len(ordered)])
    if len(first) <= FINEST:
        return first
    size = np.diff(np.r_[first, len(ordered)])
    part, large = first * FINEST // len(ordered), size * FINEST > len(ordered)
    begins = (part[1:] != part[:-1]) | large[1:] | large[:-1]
    return first[np.r_[True, begins]]
