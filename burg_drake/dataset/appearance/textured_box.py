"""A box with a texture in its true size, as a mesh in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from burg_drake.core import Array

MATERIAL = "newmtl surface\nKd 1 1 1\nmap_Kd surface.png\n"


def textured_box(size: Array, extent: float, png: bytes) -> Mesh:
    """A box around the origin. Its faces are laid with squares, each of which shows the texture
    once, as Drake's renderer does not repeat it.

    Args:
        size: (3,) extents [m].
        extent: side of a square [m].
        png: the texture; opposite edges of it fit.
    """
    lines = ["mtllib box.mtl", "usemtl surface"]
    count = 0
    for k, (axis, sign) in enumerate((axis, sign) for axis in range(3) for sign in (-1.0, 1.0)):
        normal = sign * np.eye(3)[axis]
        lines.append(f"vn {_text(normal)}")
        u, v = ((1, 2), (2, 0), (0, 1))[axis]
        for low, high in _squares(size[[u, v]], extent):
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                share = np.where((a, b), high, low) / size[[u, v]]
                p = 0.5 * normal
                p[u], p[v] = sign * (share[0] - 0.5), share[1] - 0.5  # counter-clockwise outside
                lines.append(f"v {_text(p * size)}")
                lines.append(f"vt {_text(np.where((a, b), (high - low) / extent, 0.0))}")
            corners = range(count + 1, count + 5)
            lines.append("f " + " ".join(f"{i}/{i}/{k + 1}" for i in corners))
            count += 4
    contents: Any = png  # which the stub has as text
    return Mesh(
        InMemoryMesh(
            mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", "box.obj"),
            supporting_files={
                "box.mtl": MemoryFile(MATERIAL, ".mtl", "box.mtl"),
                "surface.png": MemoryFile(contents, ".png", "surface.png"),
            },
        )
    )


def _squares(size: Array, extent: float) -> list[tuple[Array, Array]]:
    """Lower and upper corners (2,) of squares that cover a rectangle; the last ones are cut."""
    x, y = (np.append(np.arange(0.0, length - 1e-9, extent), length) for length in size)
    return [
        (np.array([x[i], y[j]]), np.array([x[i + 1], y[j + 1]]))
        for i in range(len(x) - 1)
        for j in range(len(y) - 1)
    ]


def _text(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)
