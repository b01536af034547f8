"""Closed curves on the sheet: outlines of masks of pixels, and of the black cells of markers."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.printout.projection import Layer

SMOOTHING = 0.6
"""How far an outline may pass beside the pixels it is drawn along, if not told otherwise [px]."""
SPECK = 0.5e-6
"""Smaller areas of a mask are left out [m^2]."""


def mask_outlines(
    layer: Layer, mask: NDArray[np.bool_], smoothing: float = SMOOTHING
) -> list[Array]:
    """Outlines of a mask.

    Args:
        layer: tells where on the grid the mask lies.
        mask: (H, W) as the layer's heights.
        smoothing: how far an outline may pass beside the pixels it is drawn along [px].

    Returns:
        Closed polygons (N, 2) [m]: outer ones and, the other way round, those of holes. They run
        through the centres of the mask's outermost pixels.
    """
    curves, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    grid = layer.grid
    offset = np.array([layer.column, layer.row])
    least = SPECK / grid.resolution**2
    kept = [c for c in curves if cv2.contourArea(c) >= least]
    simple = [cv2.approxPolyDP(c, smoothing, True)[:, 0] for c in kept]
    return [grid.points(c + offset) for c in simple if len(c) > 2]


def cell_outlines(black: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Outlines of the black cells of a marker, so that neighbours become one shape: cells that are
    filled one by one would show hairs of white between them.

    Args:
        black: (K, K) cells, rows from the top.

    Returns:
        Closed polygons (N, 2) of columns and rows of corners of cells, with black to the right as
        seen in the image: outer ones clockwise, holes the other way round.
    """
    padded = np.pad(black, 1)
    after: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for row, column in np.argwhere(black).tolist():
        r, c = row + 1, column + 1
        sides = (
            (padded[r - 1, c], (column, row), (column + 1, row)),
            (padded[r, c + 1], (column + 1, row), (column + 1, row + 1)),
            (padded[r + 1, c], (column + 1, row + 1), (column, row + 1)),
            (padded[r, c - 1], (column, row + 1), (column, row)),
        )
        for neighbour, start, end in sides:
            if not neighbour:
                after.setdefault(start, []).append(end)
    loops = []
    while after:
        loop = [next(iter(after))]
        while loop[-1] in after:
            ends = after[loop[-1]]
            point = ends.pop()
            if not ends:
                del after[loop[-1]]
            loop.append(point)
        loops.append(_without_straight(np.array(loop[:-1])))
    return loops


def _without_straight(loop: NDArray[np.int64]) -> NDArray[np.int64]:
    """Only the corners of a closed polygon of unit steps."""
    turned = (np.roll(loop, 1, axis=0) - 2 * loop + np.roll(loop, -1, axis=0)).any(axis=1)
    return loop[turned]
