"""In which parts of the image corners of the target were seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.calibration.target import CharucoView
from burg_drake.cameras.optics import PARTS
from burg_drake.core import Array, Indices

CELLS = (6, 8)
"""Rows and columns of the grid on which coverage is counted. Its border has the image's edges and
corners."""
SEEN = 0.5
"""Share of the cells of an edge in which corners were seen, at least."""


def coverage(views: Sequence[CharucoView], size: tuple[int, int]) -> NDArray[np.int_]:
    """How many corners were seen in each part of the image.

    Args:
        views: of the target.
        size: width and height of the image [pixels].

    Returns:
        `CELLS` counts, rows from the top.
    """
    corners = np.concatenate([view.corners for view in views] or [np.empty((0, 2))])
    edges = [np.linspace(-0.5, n - 0.5, k + 1) for n, k in zip(size[::-1], CELLS, strict=True)]
    counts, *_ = np.histogram2d(corners[:, 1], corners[:, 0], bins=edges)
    whole: NDArray[np.int_] = counts.astype(int)
    return whole


def unseen_parts(counts: NDArray[np.int_]) -> tuple[str, ...]:
    """Which of `PARTS` show no corners, or along less than half of an edge; from `coverage`."""
    bands = (slice(0, 1), slice(1, -1), slice(-1, None))
    cells = (counts[rows, columns] for rows in bands for columns in bands)
    return tuple(name for name, part in zip(PARTS, cells, strict=True) if (part > 0).mean() < SEEN)


def part_of(pixels: Array, size: tuple[int, int]) -> Indices:
    """(N,) which of `PARTS` each place (N, 2) is in."""
    bands = []
    for values, length, count in zip(pixels.T, size, CELLS[::-1], strict=True):
        cell = np.floor((values + 0.5) / length * count)
        bands.append((cell >= 1).astype(int) + (cell >= count - 1))
    return np.asarray(3 * bands[1] + bands[0])
