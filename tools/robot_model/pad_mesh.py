"""The pads' tetrahedral mesh for hydroelastic contact.

The tetrahedra that Drake makes of a box are too few for the torsional friction of a patch and too
many for what they yield. Here a star of tetrahedra joins the centre, where the pressure is highest,
with the surface, whose front and back are divided into 2 x 2 squares. The mesh is its own image
when turned by 180 degrees about z, as the one finger is of the other one.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

PAD_FILE = "pad.vtk"


def pad_vtk(size: Sequence[float], thickness: int = 1) -> str:
    """Text of a VTK file.

    Args:
        size: extents of the pad [m].
        thickness: the axis across front and back: 0 for x, 1 for y.
    """
    half = np.array(size) / 2
    points: list[tuple[int, int, int]] = [(0, 0, 0)]
    cells = []
    for triangle in _triangles():
        for corner in triangle:
            if corner not in points:
                points.append(corner)
        cells.append([0, *(points.index(corner) for corner in triangle)])
    corners = np.array(points)
    if thickness == 0:
        corners = corners[:, (1, 0, 2)]
    p = corners * half
    lines = ["# vtk DataFile Version 3.0", "Finger pad", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {len(p)} double")
    lines.extend(" ".join(f"{v:.9g}" for v in point + 0.0) for point in p)
    lines.append(f"CELLS {len(cells)} {5 * len(cells)}")
    lines.extend("4 " + " ".join(str(i) for i in _oriented(p, cell)) for cell in cells)
    lines.append(f"CELL_TYPES {len(cells)}")
    lines.extend(["10"] * len(cells))
    return "\n".join(lines) + "\n"


Corner = tuple[int, int, int]


def _triangles() -> list[tuple[Corner, Corner, Corner]]:
    """The surface of the cube from -1 to 1; all corners are at -1, 0 or 1."""
    found: list[tuple[Corner, Corner, Corner]] = []
    for y in (-1, 1):  # front and back: eight triangles around the middle
        rim = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
        for (x1, z1), (x2, z2) in itertools.pairwise([*rim, rim[0]]):
            found.append(((0, y, 0), (x1, y, z1), (x2, y, z2)))
    for s in (-1, 1):  # sides, divided where front and back are
        for t in (-1, 0):
            a, b = t, t + 1
            found.append(((s, -s, a), (s, -s, b), (s, s, b)))
            found.append(((s, -s, a), (s, s, b), (s, s, a)))
            found.append(((a, -1, s), (b, -1, s), (b, 1, s)))
            found.append(((a, -1, s), (b, 1, s), (a, 1, s)))
    return found


def _oriented(p: np.ndarray, cell: list[int]) -> list[int]:
    a, b, c, d = (p[i] for i in cell)
    if np.dot(np.cross(b - a, c - a), d - a) < 0.0:
        return [cell[0], cell[2], cell[1], cell[3]]
    return cell
