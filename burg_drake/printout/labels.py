"""Finds room for words on the sheet: beside what they name, and on nothing that matters."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.printout.projection import Grid, Layer

STEP = 0.5e-3
"""Side of a cell of the map of what is taken [m]."""
REACH = 0.05
"""How far from what they name words may stand [m]."""


class FreeSpace:
    """The sheet, and what of it is taken.

    Attributes:
        grid: cells of the sheet.
        taken: (H, W) cells with something on them.
    """

    def __init__(self, size: tuple[float, float]) -> None:
        """A bare sheet.

        Args:
            size: its extents [m].
        """
        self.grid = Grid(size, STEP)
        self.taken: NDArray[np.bool_] = np.zeros(self.grid.shape, dtype=bool)

    def take(self, lower: Iterable[float], upper: Iterable[float], clear: float = 0.0) -> None:
        """Takes a rectangle, given by its corners, and `clear` around it [m]."""
        rows, columns = self._cells(np.array([*lower]) - clear, np.array([*upper]) + clear)
        self.taken[rows, columns] = True

    def take_beyond(self, lower: Iterable[float], upper: Iterable[float]) -> None:
        """Takes all but a rectangle."""
        self.taken |= ~self.within(lower, upper)

    def take_layer(self, layer: Layer, clear: float) -> NDArray[np.bool_]:
        """Takes what an instance covers and `clear` around it [m].

        Returns:
            (H, W) the cells that it covers.
        """
        points = layer.points()
        covered = np.zeros_like(self.taken)
        cells = np.rint(self.grid.pixels(points)).astype(int)
        columns, rows = np.clip(cells, 0, np.array(covered.shape[::-1]) - 1).T
        covered[rows, columns] = True
        reach = 2 * round(clear / STEP) + 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
        self.taken |= cv2.dilate(covered.astype(np.uint8), disc) > 0
        return covered

    def cell(self, point: Iterable[float]) -> NDArray[np.bool_]:
        """(H, W) only the cell at a point."""
        at = np.zeros_like(self.taken)
        column, row = np.rint(self.grid.pixels(np.array([*point]))).astype(int)
        at[row, column] = True
        return at

    def within(self, lower: Iterable[float], upper: Iterable[float]) -> NDArray[np.bool_]:
        """(H, W) the cells that a rectangle touches."""
        inside = np.zeros_like(self.taken)
        rows, columns = self._cells(np.array([*lower]), np.array([*upper]))
        inside[rows, columns] = True
        return inside

    def place(
        self,
        extent: tuple[float, float],
        beside: NDArray[np.bool_],
        within: NDArray[np.bool_] | None = None,
    ) -> Array | None:
        """Places a box on free cells as close to something as possible, and takes its place.

        Args:
            extent: of the box along x and y [m].
            beside: (H, W) cells of what it is to stand close to; not empty.
            within: (H, W) cells that it may stand on; all if None.

        Returns:
            (2,) its lower left corner [m]; None if there is no room within `REACH`.
        """
        columns, rows = (max(1, int(np.ceil(e / STEP))) for e in extent)
        window = _around(beside, max(rows, columns) + round(REACH / STEP))
        taken, beside = self.taken[window], beside[window]
        blocked = taken if within is None else taken | ~within[window]
        if rows > taken.shape[0] or columns > taken.shape[1]:
            return None
        sums = cv2.integral(blocked.astype(np.uint8))
        inside = sums[rows:, columns:] - sums[:-rows, columns:]
        inside += sums[:-rows, :-columns] - sums[rows:, :-columns]
        # Close by: the box's nearest cell, and among those alike its middle.
        away = cv2.distanceTransform((~beside).astype(np.uint8), cv2.DIST_L2, 5)
        near = cv2.erode(away, np.ones((rows, columns), np.uint8), anchor=(0, 0))
        near = near[: inside.shape[0], : inside.shape[1]]
        centre = np.argwhere(beside).mean(axis=0)
        r, c = np.indices(inside.shape)
        middle = np.hypot(r + rows / 2 - centre[0], c + columns / 2 - centre[1])
        cost = np.where(inside == 0, near + 0.2 * middle, np.inf)
        row, column = np.unravel_index(np.argmin(cost), cost.shape)
        if not np.isfinite(cost[row, column]):
            return None
        taken[row : row + rows, column : column + columns] = True
        corner = [window[1].start + column - 0.5, window[0].start + row + rows - 0.5]
        return self.grid.points(np.array(corner))

    def _cells(self, lower: Array, upper: Array) -> tuple[slice, slice]:
        """Rows and columns that a rectangle touches."""
        (height, width), y = self.taken.shape, self.grid.size[1]
        left, right = np.floor(lower[0] / STEP), np.ceil(upper[0] / STEP)
        top, bottom = np.floor((y - upper[1]) / STEP), np.ceil((y - lower[1]) / STEP)
        rows = slice(*np.clip([top, bottom], 0, height).astype(int).tolist())
        return rows, slice(*np.clip([left, right], 0, width).astype(int).tolist())


def _around(mask: NDArray[np.bool_], reach: int) -> tuple[slice, slice]:
    """Rows and columns of a mask's cells, and so many more on all sides."""
    rows, columns = (np.flatnonzero(mask.any(axis=1 - axis)) for axis in (0, 1))
    return (
        slice(max(rows[0] - reach, 0), rows[-1] + reach + 1),
        slice(max(columns[0] - reach, 0), columns[-1] + reach + 1),
    )
