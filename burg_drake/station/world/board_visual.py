"""The printed sheet to look at: white paper and black cells of its markers, as meshes in memory.

Both lie in the plane z = 0 of the scene frame, on which the objects stand, so that a camera sees
the markers' corners exactly where the board's layout has them, at any distance.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from burg_drake.core import Array, InvalidInputError
from burg_drake.scene.document import Board

SAME_LINE = 1e-7
"""Edges of cells that are nearer to each other than this are one [m]."""


@lru_cache(maxsize=16)
def board_meshes(board: Board) -> dict[str, Mesh]:
    """The sheet's parts, `paper` and `markers`, in the scene frame.

    A board that its markers do not fit on has paper only.
    """
    try:
        x, y, black = marker_grid(board)
    except InvalidInputError:
        (x, y), black = ([np.array([0.0, s]) for s in board.size]), np.zeros((1, 1), dtype=bool)
    parts = {"paper": ~black, "markers": black}
    return {name: _squares(x, y, cells) for name, cells in parts.items() if cells.any()}


def marker_grid(board: Board) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Lines across the whole sheet wherever a cell of a marker begins or ends.

    Meshes of this one grid have all their vertices in common, so that no seam shows what is below.

    Returns:
        x (X + 1,) and y (Y + 1,) of the lines [m], ascending; (X, Y) which squares between them
        are black.

    Raises:
        InvalidInputError: the markers do not fit.
    """
    layout = board.layout
    steps = np.linspace(0.0, layout.side, layout.cells + 1)
    left, bottom = layout.p_SQ[:, 3, 0], layout.p_SQ[:, 3, 1]
    x, y = (
        _distinct(np.append((first[:, None] + steps).ravel(), [0.0, extent]))
        for first, extent in zip((left, bottom), board.size, strict=True)
    )
    black = np.zeros((len(x) - 1, len(y) - 1), dtype=bool)
    columns, rows = np.searchsorted(x, left - SAME_LINE), np.searchsorted(y, bottom - SAME_LINE)
    for column, row, cells in zip(columns, rows, layout.black, strict=True):
        black[column : column + len(cells), row : row + len(cells)] = cells[::-1].T
    return x, y, black


def _distinct(values: Array) -> Array:
    ascending = np.sort(values)
    lines: Array = ascending[np.append(True, np.diff(ascending) > SAME_LINE)]
    return lines


def _squares(x: Array, y: Array, chosen: NDArray[np.bool_]) -> Mesh:
    """Chosen squares of a grid, facing up, as an OBJ."""
    i, j = np.nonzero(chosen)
    around = [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]  # counter-clockwise
    corners = np.ravel_multi_index(around, (len(x), len(y))).T  # (N, 4)
    used, faces = np.unique(corners, return_inverse=True)
    u, v = np.unravel_index(used, (len(x), len(y)))
    lines = [f"v {a:.9g} {b:.9g} 0" for a, b in zip(x[u], y[v], strict=True)]
    lines.append("vn 0 0 1")
    lines += ["f " + " ".join(f"{n}//1" for n in face) for face in faces.reshape(-1, 4) + 1]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines), ".obj", "board")))
