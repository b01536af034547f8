"""Marble: a glass ball."""

from __future__ import annotations

import trimesh

from .colours import GLASS, painted
from .shape import Shape
from .solids import canonical, hull

RADIUS = 0.015  # [m]
DENSITY = 2500.0  # density of soda-lime glass [kg/m3]


def make_marble() -> Shape:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    ball.apply_translation((0, 0, RADIUS))
    coarse = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
    coarse.apply_scale((ball.volume / coarse.volume) ** (1 / 3))
    coarse.apply_translation((0, 0, RADIUS))
    return Shape(
        name="marble",
        description="Glass marble",
        mesh=canonical(painted(ball, GLASS)),
        pieces=(hull(coarse.vertices),),
        mass=0.035,
        rgba=GLASS,
        notes="like YCB 063 marbles; large enough to be gripped on a table, 35 g as glass is",
    )
