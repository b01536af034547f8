"""From numbers to bins of a colour bar: a range that a few outliers do not widen, and its ticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, InvalidInputError
from burg_drake.visualization.style.color_map import map_colors

BINS = 32
"""Colours of a bar: steps in lightness of 2.5, about what eyes tell apart."""
QUANTILES = (0.02, 0.98)
"""What lies between them is always told apart."""
REACH = 0.25
"""The range goes on to the extremes if they are this share of it beyond the quantiles, at most."""
HUGE = 1e100
"""Larger numbers stand for infinity, as some programs write it."""
TINY = 1e-300
"""Ranges are longer than that."""
TICKS = 6
"""Most intervals between round numbers on a bar."""


@dataclass(frozen=True)
class ColorScale:
    """Which colours numbers get.

    Attributes:
        lower, upper: what the first and the last colour begin and end with.
    """

    lower: float
    upper: float

    def bins(self, values: ArrayLike) -> NDArray[np.int64]:
        """The bin (N,), 0 to `BINS` - 1, of values (N,); -1 of NaN.

        What is beyond the range, infinite numbers included, is in the outermost bins.
        """
        numbers = np.asarray(values, dtype=float)
        known = ~np.isnan(numbers)
        share = (np.clip(numbers, self.lower, self.upper) - self.lower) / (self.upper - self.lower)
        index = np.minimum((np.where(known, share, 0.0) * BINS).astype(np.int64), BINS - 1)
        return np.where(known, index, -1)

    def beyond(self, values: ArrayLike) -> tuple[int, int]:
        """How many values (N,) are below and above the range."""
        numbers = np.asarray(values, dtype=float)
        return int((numbers < self.lower).sum()), int((numbers > self.upper).sum())

    def colors(self) -> Array:
        """(BINS, 3) colours of the bins."""
        return map_colors((np.arange(BINS) + 0.5) / BINS)

    def ticks(self) -> tuple[float, ...]:
        """Round numbers in the range, rising."""
        step = _round_step(self.upper - self.lower)
        slack = 1e-9 * step
        first, last = np.ceil((self.lower - slack) / step), np.floor((self.upper + slack) / step)
        return tuple(float(k) * step for k in np.arange(first, last + 1.0))


def scale_of(values: ArrayLike, limits: tuple[float, float] | None = None) -> ColorScale:
    """The scale for values: from and to round numbers, without their outliers.

    Args:
        values: (N,), NaN and infinite ones allowed.
        limits: lower and upper end to be taken as they are.

    Raises:
        InvalidInputError: the limits do not rise, or are not finite.
    """
    if limits is not None:
        if not TINY < limits[1] - limits[0] < HUGE:
            raise InvalidInputError(
                f"the range {limits[0]:g} to {limits[1]:g} does not rise from one finite number"
                " to another"
            )
        return ColorScale(*limits)
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[np.abs(numbers) < HUGE]
    if not len(numbers):
        return ColorScale(0.0, 1.0)
    lower, upper = without_outliers(numbers)
    if not upper - lower > max(
        TINY, 1e-9 * max(abs(lower), abs(upper))
    ):  # one value: it is in the middle
        half = 0.5 * abs(lower) or 0.5
        return ColorScale(lower - half, upper + half)
    step = _round_step(upper - lower)
    return ColorScale(
        float(np.floor(lower / step + 1e-9)) * step, float(np.ceil(upper / step - 1e-9)) * step
    )


def without_outliers(numbers: Array) -> tuple[float, float]:
    """Ends of the range of numbers (N,), N > 0: the extremes, or quantiles if those are far."""
    lower, upper = (float(q) for q in np.quantile(numbers, QUANTILES))
    reach = REACH * (upper - lower)
    least, most = float(numbers.min()), float(numbers.max())
    if not upper > lower:  # nearly all are one value; what the others are is all there is to see
        return least, most
    return (
        least if lower - least <= reach else lower,
        most if most - upper <= reach else upper,
    )


def _round_step(span: float) -> float:
    """The smallest of 1, 2, 5, 10, 20 ... that divides a span in at most `TICKS` parts."""
    power = 10.0 ** np.floor(np.log10(span / TICKS))
    return float(
        next(m * power for m in (1.0, 2.0, 5.0, 10.0) if span <= TICKS * m * power * 1.001)
    )
