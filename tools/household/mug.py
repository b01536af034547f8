"""Mug: a hollow lathe body with a swept D handle."""

from __future__ import annotations

import numpy as np

from .colours import BLUE, IVORY, painted
from .curves import Array, ellipse, resampled, rounded
from .shape import Shape
from .solids import circles, hull, hulls, rings_along, sectors, tube, union, widened

RADIUS, HEIGHT, WALL, FLOOR = 0.0405, 0.081, 0.004, 0.006  # [m]
INNER = RADIUS - WALL  # [m]
SECTORS, HANDLE_PIECES = 18, 6
SEGMENTS = 4 * SECTORS
HANDLE_RINGS = 4 * HANDLE_PIECES + 1


def profile(steps: int) -> Array:
    """(K, 2) radius and height [m]: up the outside, over the lip, down to the inner floor."""
    corners = [(0, 0), (RADIUS, 0), (RADIUS, HEIGHT), (INNER, HEIGHT), (INNER, FLOOR), (0, FLOOR)]
    return rounded(corners, [0.003, 0.0018, 0.0018, 0.0015], steps)


def handle(section: Array) -> Array:
    """(HANDLE_RINGS, N, 3) rings [m]; the first and last lie inside the wall."""
    x0 = RADIUS - 0.5 * WALL
    corners = [(x0, 0, 0.0665), (0.0745, 0, 0.0685), (0.0715, 0, 0.0265), (x0, 0, 0.0165)]
    path = resampled(rounded(corners, [0.015, 0.018], 24), HANDLE_RINGS)
    return rings_along(path, (0, 1, 0), section, closed=False)


def make_mug() -> Shape:
    body = tube(circles(profile(5), SEGMENTS))
    mesh = union((body, BLUE), (tube(handle(ellipse(0.0038, 0.0062, 16))), BLUE))
    painted(
        mesh, None, (lambda p, n: (np.hypot(*p[:, :2].T) < INNER) & (p[:, 2] > 0.5 * FLOOR), IVORY)
    )
    coarse = profile(1)
    wall = np.vstack([coarse[coarse[:, 0] > INNER - 1e-6], [(INNER, 0.0)]])
    floor = hull(circles([(INNER, 0.0), (INNER, FLOOR)], SECTORS))
    grip = handle(widened(ellipse(0.0038, 0.0062, 8)))[::2]
    return Shape(
        name="mug",
        description="Mug, hollow, with a handle on its +x side",
        mesh=mesh,
        pieces=(*sectors(wall, SECTORS), floor, *hulls(grip, range(0, len(grip), 2))),
        mass=0.118,
        rgba=BLUE,
        notes="like YCB 025 mug, 118 g",
    )
