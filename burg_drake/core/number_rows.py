"""Tables of numbers as text without loss, without exponents where 12 decimals are enough."""

from __future__ import annotations

import numpy as np

from burg_drake.core.arrays import Array

GRID_SCALE = 1e12
"""Steps of the decimal grid in a unit: a thousandth of a nanometre or nanoradian."""


def round_to_grid(values: Array) -> Array:
    """The nearest numbers with 12 decimals; what is beyond 9000 in size stays as it is.

    Multiples of the grid are exact up to there: text and number read back with the same bits, as
    both are the floating-point number nearest to the same decimal.
    """
    small = np.abs(values) <= 9000.0
    units = np.rint(np.where(small, values, 0.0) * GRID_SCALE)
    return np.where(small, units / GRID_SCALE + 0.0, values)  # no negative zeros


def format_rows(values: Array, separator: str = ",") -> list[str]:
    """Each row of finite numbers (T, n) as text, which reads back bit by bit.

    Rows on the grid, see `round_to_grid`, are plain decimals; others are as Python has them.
    """
    on_grid = (np.abs(values) <= 9000.0) & (round_to_grid(values) == values)
    on_grid &= (values != 0.0) | ~np.signbit(values)
    rows = zip(values.tolist(), on_grid.all(axis=1).tolist(), strict=True)
    return [separator.join(map(_decimal_text if plain else repr, row)) for row, plain in rows]


def _decimal_text(value: float) -> str:
    text = f"{value:.12f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text
