"""Bowl: a thin hollow lathe shape with a flat foot."""

from __future__ import annotations

import numpy as np

from .colours import IVORY, SAGE, painted
from .curves import Array
from .shape import Shape
from .solids import canonical, circles, hull, sectors, tube

RADIUS, HEIGHT, WALL = 0.080, 0.055, 0.0042  # outer rim radius, height, thickness [m]
FOOT = 0.030  # radius of the flat foot [m]
# sectors of the bands of the wall from the foot to the rim, and straight segments per sector
BANDS = ((9, 4), (14, 3), (24, 2))
SEGMENTS = 64


def middle(count: int) -> tuple[Array, Array]:
    """Mid surface of the wall from foot to rim: (M, 2) points [m] and (M, 2) inward normals."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    rim = np.array([RADIUS - 0.5 * WALL, HEIGHT - 0.5 * WALL])
    p0, p3 = np.array([FOOT, 0.5 * WALL]), rim
    p1, p2 = p0 + np.array([0.022, 0.0]), rim - np.array([0.0085, 0.026])
    s = 1.0 - t
    points = s**3 * p0 + 3 * s**2 * t * p1 + 3 * s * t**2 * p2 + t**3 * p3
    tangent = 3 * s**2 * (p1 - p0) + 6 * s * t * (p2 - p1) + 3 * t**2 * (p3 - p2)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return points, np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def rim(steps: int) -> Array:
    """(steps + 1, 2) points [m] of the round lip, from the outside to the inside."""
    points, normals = middle(2)
    turn = np.linspace(0.0, np.pi, steps + 1)[:, None]
    along = np.array([normals[-1, 1], -normals[-1, 0]])
    half = 0.5 * WALL
    return points[-1] + half * (np.sin(turn) * along - np.cos(turn) * normals[-1])


def make_bowl() -> Shape:
    points, normals = middle(19)
    half = 0.5 * WALL
    outer, inner = points - half * normals, points + half * normals
    line = np.vstack([(0, 0), outer[:-1], rim(6), inner[-2::-1], (0, WALL)])
    mesh = tube(circles(line, SEGMENTS))
    painted(mesh, SAGE, (lambda p, n: (n[:, 2] > 0.2) & (p[:, 2] > 0.5 * WALL), IVORY))
    pieces = [hull(circles([(FOOT, 0.0), (FOOT, WALL)], 18))]
    cuts = (0, 6, 12, 18)
    for (count, arcs), i, j in zip(BANDS, cuts[:-1], cuts[1:], strict=True):
        ends = [i, (i + j) // 2, j]
        cell = np.vstack([outer[ends], inner[[i, j]]])
        cell = np.vstack([cell, rim(2)[1:2]]) if j == cuts[-1] else cell
        pieces += sectors(cell, count, arcs)
    return Shape(
        name="bowl",
        description="Bowl, hollow, with a flat foot",
        mesh=canonical(mesh),
        pieces=tuple(pieces),
        mass=0.147,
        rgba=SAGE,
        notes="like YCB 024 bowl, 147 g",
    )
