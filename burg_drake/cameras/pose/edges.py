"""The edges between black and white cells of a board's markers, and what lies around each.

Every place where a cell of a marker, or the white around it, meets a cell of the other color gives
an edge of one cell's length. `edge_fit` looks for them in images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.scene.document import MarkerLayout

REACH = 2
"""Edges before and behind an edge that its surroundings tell [cells]."""
AROUND = np.arange(-REACH, REACH + 1)
"""Values of u at which the color may change."""


@dataclass(frozen=True, eq=False)
class MarkerEdges:
    """Edges of all markers of a board, in an order of which every beginning is spread over all.

    Coordinates around an edge, in cells from its middle: u across the edge, along S's x (`axis` 0)
    or y (`axis` 1), and v along the edge, along the other of the two.

    Attributes:
        p_SE: (N, 3) middles of the edges [m].
        axis: (N,) 0 if u runs along x, 1 if along y.
        steps: (N, 3, 2 REACH + 1) change of color at u = -REACH ... REACH: 1 from black to white,
            -1 from white to black, 0 none, in the rows of cells around v = -1, 0, 1.
        marker: (N,) which of the layout's markers each belongs to.
        from_center: (N, 3) from the middle of its marker [m].
        cell: (2,) size of a cell along x and y [m].
    """

    p_SE: Array
    axis: NDArray[np.intp]
    steps: NDArray[np.float32]
    marker: NDArray[np.intp]
    from_center: Array
    cell: Array


def marker_edges(layout: MarkerLayout, scale: tuple[float, float] = (1.0, 1.0)) -> MarkerEdges:
    """The edges of a board's markers.

    Args:
        layout: the markers.
        scale: size of the print against the document, along x and y, from S's origin.
    """
    parts = [_edges(layout, axis) for axis in (0, 1)]
    p_SE, steps, marker = (np.concatenate(part) for part in zip(*parts, strict=True))
    axis = np.repeat([0, 1], [len(part[0]) for part in parts])
    # Shuffled within each marker, then one edge of every marker after the other.
    chance = np.random.default_rng(0).permutation(len(marker))
    by_marker = np.lexsort((chance, marker))
    rank = np.empty(len(marker), dtype=np.intp)
    first = np.searchsorted(marker[by_marker], marker[by_marker])
    rank[by_marker] = np.arange(len(marker)) - first
    order = np.lexsort((marker, rank))
    cell = np.array(scale) * layout.side / layout.cells
    printed = [*scale, 1.0]
    from_center = (p_SE - layout.p_SQ.mean(axis=1)[marker]) * printed
    p_SE = p_SE * printed
    steps = steps[order].astype(np.float32)
    return MarkerEdges(p_SE[order], axis[order], steps, marker[order], from_center[order], cell)


def _edges(layout: MarkerLayout, axis: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """Middles, steps and markers of the edges across one axis."""
    pad = REACH + 2
    white = np.pad(~layout.black, ((0, 0), (pad, pad), (pad, pad)), constant_values=True)
    # Rows from the bottom, so that both indices rise with x and y; then u is the last index.
    grid = white[:, ::-1].astype(float)
    if axis == 1:
        grid = grid.transpose(0, 2, 1)
    step = np.diff(grid, axis=2)  # step[:, v, u] lies between the cells u and u + 1
    marker, v, u = np.nonzero(step)
    rows = [step[marker[:, None], v[:, None] + row, u[:, None] + AROUND] for row in (-1, 0, 1)]
    across, along = u + 1.0 - pad, v + 0.5 - pad
    x, y = (across, along) if axis == 0 else (along, across)
    lower_left = layout.p_SQ[marker, 3]
    cell = layout.side / layout.cells
    return lower_left + cell * np.column_stack([x, y, 0.0 * x]), np.stack(rows, axis=1), marker
