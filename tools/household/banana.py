"""Banana: a rounded pentagon swept along an arc, with stem and tip, lying on its side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .colours import BROWN, YELLOW, painted
from .curves import Array, angles, smooth
from .rest import laid_down
from .shape import Shape
from .solids import canonical, hulls, rings_along, tube, widened

BEND = 0.112  # radius of the centre line [m]
LENGTH = 0.195  # along the centre line [m]
RIDGES = 5
# share of the length, radius of the section [m]
STATIONS = np.array(
    [
        (0.000, 0.0048),
        (0.012, 0.0058),
        (0.030, 0.0054),
        (0.075, 0.0064),
        (0.140, 0.0122),
        (0.250, 0.0166),
        (0.450, 0.0184),
        (0.650, 0.0180),
        (0.820, 0.0150),
        (0.930, 0.0088),
        (0.965, 0.0054),
        (0.985, 0.0047),
        (1.000, 0.0034),
    ]
)
BROWN_ENDS = (0.016, 0.970)  # shares of the length where the stem and the tip turn brown
CUTS = (0.0, 0.09, 0.20, 0.36, 0.58, 0.78, 0.94, 1.0)  # between convex pieces, share of length


def section(at: Array, count: int) -> Array:
    """(M, count, 2) sections [m] at the shares `at` of the length."""
    t = angles(count)
    ridges = 1.0 + 0.045 * smooth(np.array([(0, 0), (0.14, 1), (0.85, 1), (1, 0.0)]), at)
    r = smooth(STATIONS, at) * (1.0 + (ridges - 1.0) * np.cos(RIDGES * t))
    return np.stack([r * np.cos(t), r * np.sin(t)], axis=2)


def along(at: Array, sections: Array) -> Array:
    """(M, N, 3) rings [m] of sections at the shares `at` of the length, centre line in z = 0."""
    turn = (at - 0.5) * LENGTH / BEND
    path = BEND * np.stack([np.sin(turn), 1.0 - np.cos(turn), 0.0 * turn], axis=1)
    return rings_along(path, (0, 0, 1), sections, closed=False)


def brown(p: Array, n: Array) -> NDArray[np.bool_]:
    """Which of the points (F, 3) [m] belong to the stem's cut or to the tip."""
    share = 0.5 + np.arctan2(p[:, 0], BEND - p[:, 1]) * BEND / LENGTH
    return (share < BROWN_ENDS[0]) | (share > BROWN_ENDS[1])


def make_banana() -> Shape:
    at = np.unique(np.concatenate([np.linspace(0.0, 1.0, 57), STATIONS[:, 0], BROWN_ENDS]))
    mesh = painted(tube(along(at, section(at, 30))), YELLOW, (brown, BROWN))
    coarse = np.sort(np.concatenate([CUTS, 0.5 * (np.array(CUTS[1:]) + CUTS[:-1])]))
    rings = along(coarse, widened(section(coarse, 10)))
    mesh, pieces = laid_down(mesh, hulls(rings, range(0, len(coarse), 2)))
    return Shape(
        name="banana",
        description="Banana lying on its side, ends bent towards +y",
        mesh=canonical(mesh),
        pieces=pieces,
        mass=0.066,
        rgba=YELLOW,
        notes="like YCB 011 banana (a plastic fruit), 66 g",
    )
