"""Box: a carton with slightly rounded edges and a printed band."""

from __future__ import annotations

import numpy as np

from .colours import IVORY, OCHRE, painted
from .curves import Array, rounded, rounded_rectangle
from .shape import Shape
from .solids import canonical, hull, tube

SIZE = (0.060, 0.158, 0.210)  # along x, y, z [m]
EDGE = 0.002  # edge radius [m]
BAND = (0.120, 0.165)  # heights of the lower and upper edge of the band [m]


def rings(steps: int, heights: Array) -> Array:
    """(M, N, 3) rounded rectangles [m] from bottom to top.

    Args:
        steps: Straight segments per quarter turn of an edge.
        heights: (K,) further rings [m] between the rounded edges of the bottom and of the top.
    """
    top = SIZE[2]
    corners = [(EDGE, 0.0), (0.0, 0.0), *((0.0, z) for z in heights), (0.0, top), (EDGE, top)]
    side = rounded(corners, [EDGE, *(0.0 for _ in heights), EDGE], steps)
    out = []
    for inset, z in side:
        a, b = 0.5 * SIZE[0] - inset, 0.5 * SIZE[1] - inset
        outline = rounded_rectangle(a, b, EDGE - inset, steps)
        out.append(np.column_stack([outline, np.full(len(outline), z)]))
    return np.array(out)


def make_box() -> Shape:
    mesh = tube(rings(5, np.linspace(0.015, 0.195, 13)))
    painted(mesh, OCHRE, (lambda p, n: (p[:, 2] > BAND[0]) & (p[:, 2] < BAND[1]), IVORY))
    return Shape(
        name="box",
        description="Carton; its narrow side is along x",
        mesh=canonical(mesh),
        pieces=(hull(rings(1, np.array([]))),),
        mass=0.411,
        rgba=OCHRE,
        notes="like YCB 003 cracker box, 411 g",
    )
