"""Bottle: a squeeze bottle, oval below and round from the neck up, with a nozzle cap."""

from __future__ import annotations

import numpy as np

from .colours import BRICK, IVORY, painted
from .curves import Array, equal_area_factor, rounded
from .shape import Shape
from .solids import canonical, ellipses, hulls, tube

SEGMENTS, PIECE_SEGMENTS = 60, 20
CAP = 0.144  # height of the lower edge of the cap [m]
# half axes along x and y, height, and corner radius [m]
BODY = (
    (0.0000, 0.0000, 0.000, 0.0),
    (0.0430, 0.0275, 0.000, 0.007),
    (0.0440, 0.0290, 0.112, 0.020),
    (0.0150, 0.0150, 0.139, 0.005),
    (0.0150, 0.0150, CAP, 0.0),
)
NOZZLE = (
    (0.0150, 0.0150, CAP, 0.0),
    (0.0190, 0.0190, CAP, 0.0008),
    (0.0175, 0.0175, 0.158, 0.002),
    (0.0090, 0.0090, 0.160, 0.003),
    (0.0048, 0.0048, 0.190, 0.0015),
    (0.0000, 0.0000, 0.190, 0.0),
)


def profile(rows: tuple[tuple[float, ...], ...], steps: int) -> Array:
    """(K, 3) half axes along x and y and height [m] of a table above, corners rounded."""
    table = np.array(rows)
    return rounded(table[:, :3], table[1:-1, 3], steps)


def make_bottle() -> Shape:
    line = np.vstack([profile(BODY, 5), profile(NOZZLE, 4)[1:]])
    mesh = painted(
        tube(ellipses(line, SEGMENTS)), BRICK, (lambda p, n: p[:, 2] > CAP - 1e-6, IVORY)
    )
    k = equal_area_factor(PIECE_SEGMENTS)
    # A face, and no ridge, is where the bottle rests when it lies.
    body, nozzle = (
        ellipses(profile(rows, 2) * (k, k, 1.0), PIECE_SEGMENTS, first=0.5)
        for rows in (BODY, NOZZLE)
    )
    # Each rounded corner has three rings here: cut after the shoulder's, within the neck's, and
    # where the nozzle leaves the cap.
    return Shape(
        name="bottle",
        description="Squeeze bottle with a nozzle cap; its narrow side is along y",
        mesh=canonical(mesh),
        pieces=(*hulls(body, (1, 6, 8, 10)), *hulls(nozzle, (1, 8, 12))),
        mass=0.603,
        rgba=BRICK,
        notes="like YCB 006 mustard bottle, 603 g",
    )
