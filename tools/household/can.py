"""Can: a cylinder with rolled rims, recessed lids and a paper label."""

from __future__ import annotations

import numpy as np
import trimesh

from .colours import IVORY, STEEL, TEAL, painted
from .curves import equal_area_factor, rounded
from .shape import Shape
from .solids import canonical, circles, hull, tube

RADIUS, HEIGHT = 0.034, 0.102  # at the rims [m]
BODY_RADIUS = 0.0335  # between the rims [m]
RIM, RIM_WIDTH, RECESS = 0.003, 0.002, 0.0012  # rim height and width, depth of the lids [m]
BAND = (0.056, 0.072)  # heights of the lower and upper edge of the label's bright band [m]
SEGMENTS, PIECE_SEGMENTS = 64, 24


def corners() -> tuple[list[tuple[float, float]], list[float]]:
    """Radius and height of the profile's corners, bottom lid to top lid, and their radii [m]."""
    lid, b = RADIUS - RIM_WIDTH, BODY_RADIUS
    end = [(0.0, RECESS), (lid, RECESS), (lid, 0.0), (RADIUS, 0.0), (RADIUS, RIM), (b, RIM)]
    radii = [0.0005, 0.0006, 0.0008, 0.0004, 0.0]
    points = [*end, *((b, z) for z in BAND), *((r, HEIGHT - z) for r, z in end[::-1])]
    return points, [*radii, 0.0, 0.0, *radii[::-1]]


def drum(radius: float, z0: float, z1: float) -> trimesh.Trimesh:
    """Convex piece: a cylinder [m] of equal volume with few sides."""
    r = radius * equal_area_factor(PIECE_SEGMENTS)
    return hull(circles([(r, z0), (r, z1)], PIECE_SEGMENTS))


def make_can() -> Shape:
    mesh = tube(circles(rounded(*corners(), steps=3), SEGMENTS))
    painted(
        mesh,
        STEEL,
        (lambda p, n: np.abs(p[:, 2] - 0.5 * HEIGHT) < 0.5 * HEIGHT - RIM, TEAL),
        (lambda p, n: (p[:, 2] > BAND[0]) & (p[:, 2] < BAND[1]), IVORY),
    )
    return Shape(
        name="can",
        description="Food can with rolled rims",
        mesh=canonical(mesh),
        pieces=(
            drum(RADIUS, 0.0, RIM),
            drum(BODY_RADIUS, RIM, HEIGHT - RIM),
            drum(RADIUS, HEIGHT - RIM, HEIGHT),
        ),
        mass=0.349,
        rgba=TEAL,
        notes="like YCB 005 tomato soup can, 349 g",
    )
