"""The pads' tetrahedral mesh for hydroelastic contact.

The tetrahedra that Drake makes of a box are too few for the torsional friction of a patch and too
many for what they yield. A contact surface has one point of contact per polygon, so that friction
about its normal lacks what lies within the polygons. Here tetrahedra join one inner point, where
the pressure is highest, with the surface. Its front, which looks at the other finger, is divided
into 22 triangles that carry .977 of the torsional friction of a patch that covers it, and .964 in
the mean of patches that cover a part of it (3 x 3 squares .966 and .950, 4 x 4 squares .983 and
.974, but a trial takes a fifth longer), its other faces into as few as there can be.

Pressure grows from 0 at all faces, so that it is too low near the sides of the pad: with the inner
point in the middle, along a border of 1.1 times the depth. Objects that are held at the tip, half a
millimetre deep, would slip too early. With the point near the back, the border is half as wide. The
modulus grows with the depth of the point, so that the front stays as stiff.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import Delaunay

PAD_FILE = "pad.vtk"
INNER_DEPTH = 0.95
"""Depth of the inner point behind the front, over the thickness."""
RING_ON_AXES, RING_ON_DIAGONALS = 0.3, 0.5
"""Where eight points around the middle of the front lie, on its axes and, in both directions, on
its diagonals, from the middle (0) to the edges (1). Over strips, and patches that an edge cuts off,
they carry the most torsional friction that so many triangles can."""


def pad_vtk(size: Sequence[float], thickness: int = 1, front: np.ndarray | None = None) -> str:
    """Text of a VTK file.

    Args:
        size: extents of the pad [m].
        thickness: the axis against which the front looks: 0 for x, 1 for y.
        front: the front's points (n, 2) in [-1, 1], with the square's corners; default `ring()`.
    """
    corners, cells = _cells(ring() if front is None else front)
    if thickness == 1:
        corners = corners[:, (1, 0, 2)]
    p = corners * np.array(size) / 2
    lines = ["# vtk DataFile Version 3.0", "Finger pad", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {len(p)} double")
    lines.extend(" ".join(f"{v:.9g}" for v in point + 0.0) for point in p)
    lines.append(f"CELLS {len(cells)} {5 * len(cells)}")
    lines.extend("4 " + " ".join(str(i) for i in _oriented(p, cell)) for cell in cells)
    lines.append(f"CELL_TYPES {len(cells)}")
    lines.extend(["10"] * len(cells))
    return "\n".join(lines) + "\n"


def squares(n: int) -> np.ndarray:
    """A front of n x n squares."""
    steps = np.linspace(-1.0, 1.0, n + 1)
    return np.array([(u, v) for u in steps for v in steps])


def ring() -> np.ndarray:
    """A front of eight points around its middle, within the corners and middles of its edges."""
    outline = [point for point in squares(2) if point.any()]
    signs = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    axes = RING_ON_AXES * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    return np.concatenate([outline, axes, RING_ON_DIAGONALS * signs])


def _cells(front: np.ndarray) -> tuple[np.ndarray, list[list[int]]]:
    """Points (m, 3) in [-1, 1], first the inner one, then the front at x = -1, then the back's four
    corners; and tetrahedra."""
    n, around = len(front), [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    inner = (2 * INNER_DEPTH - 1, 0, 0)
    points = [inner, *((-1, *point) for point in front), *((1, *corner) for corner in around)]
    faces = [list(triangle + 1) for triangle in Delaunay(front).simplices]
    faces += [[n + 1, n + 2, n + 3], [n + 1, n + 3, n + 4]]
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
        edge, back = _edge(front, np.array(around[i]), np.array(around[j])), (n + 1 + i, n + 1 + j)
        middle = len(edge) // 2
        for k in range(len(edge) - 1):
            faces.append([edge[k], edge[k + 1], back[k >= middle]])
        faces.append([edge[middle], *back])
    return np.array(points, dtype=float), [[0, *face] for face in faces]


def _edge(front: np.ndarray, start: np.ndarray, end: np.ndarray) -> list[int]:
    """The points between two corners of the front, in order."""
    offset, along = front - start, end - start
    on = np.flatnonzero(np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0]) < 1e-9)
    return [int(i) + 1 for i in on[np.argsort(offset[on] @ along)]]


def _oriented(p: np.ndarray, cell: list[int]) -> list[int]:
    a, b, c, d = (p[i] for i in cell)
    if np.dot(np.cross(b - a, c - a), d - a) < 0.0:
        return [cell[0], cell[2], cell[1], cell[3]]
    return cell
