"""Python's own parser and `repr` are the oracle."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.motion import format_rows, round_to_grid


def values() -> np.ndarray:
    rng = np.random.default_rng(0)
    whole = np.array([[0.0, -0.0, 1.0, -1.0, 8999.0, -9000.0, 9000.000000000001, 1e-12, -1e-12]])
    wide = rng.normal(size=(200, 9)) * 10.0 ** rng.integers(-13, 4, (200, 9))
    extreme = np.array([[1e300, -1e-300, 5e-324, 1e16, 123456.789, 0.1, 0.3, -2.5, 1e-13]])
    return np.concatenate([whole, wide, round_to_grid(wide), extreme])


@pytest.mark.parametrize("separator", [",", ", "])
def test_rows_read_back_bit_by_bit(separator: str) -> None:
    rows = format_rows(values(), separator)
    read = np.array([[float(text) for text in row.split(separator)] for row in rows])
    np.testing.assert_array_equal(read.view(np.int64), values().view(np.int64))


def test_numbers_on_the_grid_are_as_short_as_python_has_them() -> None:
    grid = round_to_grid(values()[:-1])
    grid = grid[np.abs(grid).max(axis=1) <= 9000.0]
    grid[np.abs(grid) < 1e-3] = 0.5  # for small ones Python has exponents
    assert format_rows(grid) == [",".join(map(repr, row)) for row in grid.tolist()]


def test_the_grid_is_the_nearest_decimal() -> None:
    given = values()[np.abs(values()).max(axis=1) < 9000.0]
    expected = [[float(f"{x:.12f}") for x in row] for row in given.tolist()]
    np.testing.assert_allclose(round_to_grid(given), expected, rtol=5e-16, atol=1.01e-12)


def test_no_rows_and_no_numbers() -> None:
    assert format_rows(np.zeros((0, 3))) == []
    assert format_rows(np.zeros((2, 0))) == ["", ""]
