"""Smooth random images that can be laid side by side without a seam."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, Indices


def smooth_noise(rng: np.random.Generator, size: int, rows: int, columns: int) -> Array:
    """Value noise: random numbers on a periodic grid, with smooth steps between them.

    Args:
        rng: draws.
        size: of the image, in pixels along each side.
        rows, columns: of the grid.

    Returns:
        (size, size) from 0 to 1.
    """
    grid = rng.random((rows, columns))
    down, below, v = _steps(size, rows)
    right, beside, u = _steps(size, columns)
    upper = grid[down][:, right] * (1.0 - u) + grid[down][:, beside] * u
    lower = grid[below][:, right] * (1.0 - u) + grid[below][:, beside] * u
    image: Array = upper * (1.0 - v[:, None]) + lower * v[:, None]
    return image


def layered_noise(
    rng: np.random.Generator, size: int, rows: int, columns: int, layers: int = 5
) -> Array:
    """Sum of value noise of ever finer grids, each half as strong as the one before.

    Returns:
        (size, size) from 0 to 1.
    """
    total, weight = np.zeros((size, size)), 0.0
    for k in range(layers):
        finer = (min(rows << k, size), min(columns << k, size))
        total += smooth_noise(rng, size, *finer) / 2**k
        weight += 1.0 / 2**k
    return total / weight


def _steps(size: int, cells: int) -> tuple[Indices, Indices, Array]:
    """(size,) the grid's index before and after each pixel, and how far it is from the first."""
    place = (np.arange(size) + 0.5) * cells / size
    first = np.floor(place).astype(np.intp)
    share = place - first
    return first % cells, (first + 1) % cells, share * share * (3.0 - 2.0 * share)
