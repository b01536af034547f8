"""Solids that are unions of boxes along the axes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .arrays import Array
from .solid import Solid

FIRST = (0.1, 0.25, 0.45, 0.7)
"""Ends of the first cells from an edge, over the spacing beyond: what is pressed into a pad there
is less deep than wide."""

Box = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lower and upper corner [m]."""


def graded(length: float, spacing: float) -> Array:
    """Ends of cells from 0 to a length: even ones, but for smaller ones at both ends."""
    ends = spacing * np.array(FIRST)
    inner = length - 2.0 * ends[-1]
    if inner < spacing:
        return np.linspace(0.0, length, 2 * round(length / spacing) + 5)
    count = max(1, round(inner / spacing))
    middle = np.linspace(ends[-1], length - ends[-1], count + 1)
    return np.concatenate(([0.0], ends[:-1], middle, (length - ends[:-1])[::-1], [length]))


def blocks(boxes: Iterable[Box], spacing: float) -> Solid:
    """The union of boxes; no two may meet in an edge only."""
    corners = np.array(list(boxes), dtype=float)
    cuts = [np.unique(np.round(corners[:, :, axis], 9)) for axis in range(3)]
    filled = np.zeros([len(c) - 1 for c in cuts], dtype=bool)
    for low, high in corners:
        where = [
            slice(*np.searchsorted(c, np.round((a, b), 9)).tolist())
            for c, a, b in zip(cuts, low, high, strict=True)
        ]
        filled[where[0], where[1], where[2]] = True
    sampled = [_face(cuts, spacing, *face) for face in _open_faces(filled)]
    points, normals, areas = (np.concatenate(part) for part in zip(*sampled, strict=True))
    return Solid(points, normals, areas, spacing, (_mesh(cuts, filled),))


def _open_faces(filled: Array) -> list[tuple[int, int, tuple[int, ...]]]:
    """Axis, sign and cell of the faces that nothing covers."""
    faces = []
    for axis in range(3):
        for sign in (-1, 1):
            padded = np.pad(filled, 1)
            beside = np.roll(padded, -sign, axis)[1:-1, 1:-1, 1:-1]
            faces += [(axis, sign, tuple(c)) for c in np.argwhere(filled & ~beside).tolist()]
    return faces


def _face(
    cuts: Sequence[Array], spacing: float, axis: int, sign: int, cell: tuple[int, ...]
) -> tuple[Array, Array, Array]:
    """Samples of one face of one cell."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    ends = []
    for k in (i, j):
        low, high = cuts[k][cell[k]], cuts[k][cell[k] + 1]
        ends.append(low + graded(high - low, spacing))
    u, v = np.meshgrid(*((e[1:] + e[:-1]) / 2.0 for e in ends), indexing="ij")
    points = np.empty((u.size, 3))
    points[:, axis] = cuts[axis][cell[axis] + (sign > 0)]
    points[:, i], points[:, j] = u.ravel(), v.ravel()
    normals = np.zeros((u.size, 3))
    normals[:, axis] = sign
    return points, normals, np.outer(np.diff(ends[0]), np.diff(ends[1])).ravel()


def _mesh(cuts: Sequence[Array], filled: Array) -> tuple[Array, Array]:
    """Two triangles for each open face of a cell."""
    numbers: dict[tuple[int, ...], int] = {}
    faces = []
    for axis, sign, cell in _open_faces(filled):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        square = []
        for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
            corner = list(cell)
            corner[axis] += sign > 0
            corner[i] += a
            corner[j] += b
            square.append(numbers.setdefault(tuple(corner), len(numbers)))
        if sign < 0:
            square.reverse()
        faces += [(square[0], square[1], square[2]), (square[0], square[2], square[3])]
    vertices = np.array([[c[k] for c, k in zip(cuts, at, strict=True)] for at in numbers])
    return vertices, np.array(faces)
