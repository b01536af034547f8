"""Toy airplane: fuselage with canopy, low wing, tail, propeller and three wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from .colours import BLUE, BRICK, BROWN, CHARCOAL, IVORY, STEEL
from .curves import Array, ellipse, smooth
from .shape import Shape
from .solids import circles, hull, hulls, tube, union, widened

AXIS = 0.050  # height of the fuselage's centre line at the nose [m]
NOSE = 0.118  # x of the front of the fuselage [m]
WING = AXIS - 0.014  # height of the wing's root [m]
TAIL = AXIS + 0.014  # height of the tail's root [m]
# distance behind the nose, half width, half height, height of the centre above AXIS, all [m]
FUSELAGE = np.array(
    [
        (0.000, 0.0165, 0.0165, 0.000),
        (0.003, 0.0205, 0.0205, 0.000),
        (0.018, 0.0245, 0.0250, 0.000),
        (0.060, 0.0260, 0.0275, 0.001),
        (0.100, 0.0250, 0.0265, 0.002),
        (0.150, 0.0190, 0.0205, 0.006),
        (0.200, 0.0115, 0.0135, 0.011),
        (0.226, 0.0070, 0.0090, 0.014),
        (0.235, 0.0030, 0.0045, 0.015),
    ]
)
# radius, distance before the front of the fuselage [m]
SPINNER = ((0.0125, -0.002), (0.0118, 0.005), (0.0090, 0.011), (0.0045, 0.0145), (0.0, 0.0155))
WHEELS = ((0.008, -0.040), (0.008, 0.040), (0.088, 0.0))  # x, y [m]
WHEEL_RADIUS, WHEEL_WIDTH = 0.013, 0.011  # [m]
CANOPY = ((0.040, 0.0, AXIS + 0.0235), (0.030, 0.0165, 0.0170))  # centre, half axes [m]


@dataclass(frozen=True)
class Fin:
    """A tapered surface: wing, tail, blade or leg.

    Attributes:
        root: x of the middle, y, z, chord along x, and thickness across chord and span [m].
        tip: The same where the taper ends; a rounding of 0.4 chords is added to it.
    """

    root: tuple[float, float, float, float, float]
    tip: tuple[float, float, float, float, float]

    def rings(self, section: Array, turns: ArrayLike) -> Array:
        """(M, N, 3) rings [m].

        Args:
            section: (N, 2) section of unit chord and thickness.
            turns: Where to cut the rounding of the tip, from 0 (its start) to 90 (its end) [deg].
        """
        a, b = np.array(self.root), np.array(self.tip)
        span = (b - a)[1:3] / np.linalg.norm((b - a)[1:3])
        up = np.array([-span[1], span[0]])
        t = np.radians(np.asarray(turns, dtype=float))
        rows = [(a, 0.0, 1.0)]
        rows += [(b, 0.4 * b[3] * np.sin(turn), np.cos(turn)) for turn in t]
        out = []
        for row, beyond, shrink in rows:
            x = row[0] + shrink * row[3] * section[:, 0]
            yz = row[1:3] + beyond * span + shrink * row[4] * section[:, 1:] * up
            out.append(np.column_stack([x, yz]))
        return np.array(out)

    def body(self) -> trimesh.Trimesh:
        """The surface for the mesh; convex."""
        return hull(self.rings(ellipse(0.5, 0.5, 16), (0, 20, 40, 58, 72, 83)))

    def piece(self) -> trimesh.Trimesh:
        """The same with few faces."""
        return hull(self.rings(widened(ellipse(0.5, 0.5, 6)), (0, 42, 74)))


WINGS = tuple(
    Fin((0.042, 0.0, WING, 0.068, 0.0130), (0.036, side * 0.105, WING + 0.016, 0.050, 0.0085))
    for side in (-1.0, 1.0)
)
TAILPLANE = tuple(
    Fin((-0.098, side * 0.001, TAIL, 0.036, 0.0075), (-0.101, side * 0.040, TAIL, 0.026, 0.0060))
    for side in (-1.0, 1.0)
)
RUDDER = Fin((-0.094, 0.0, TAIL, 0.046, 0.0085), (-0.105, 0.0, TAIL + 0.040, 0.028, 0.0060))
BLADES = tuple(
    Fin(
        (NOSE + 0.005, 0.0, AXIS, 0.006, 0.010),
        (NOSE + 0.005, side * 0.029, AXIS + side * 0.0135, 0.0045, 0.014),
    )
    for side in (-1.0, 1.0)
)
LEGS = tuple(
    Fin((x, y, WING + 0.006, 0.014, 0.0065), (x, y, WHEEL_RADIUS, 0.010, 0.0065)) for x, y in WHEELS
)


def fuselage(at: ArrayLike, section: Array) -> Array:
    """(M, N, 3) rings [m] at distances `at` behind the nose, for a section of unit half axes."""
    distance = np.asarray(at, dtype=float)
    w, h, c = smooth(FUSELAGE, distance).T[:, :, None]
    x = np.broadcast_to(NOSE - distance[:, None], (len(distance), len(section)))
    return np.stack([x, w * section[:, 0], AXIS + c + h * section[:, 1]], axis=2)


def spinner(count: int) -> Array:
    """(5, count, 3) rings [m] of the cone before the propeller."""
    return circles(SPINNER, count)[..., [2, 0, 1]] + (NOSE, 0.0, AXIS)


def wheel(x: float, y: float) -> trimesh.Trimesh:
    """A wheel on the ground, its axle along y."""
    r, half = WHEEL_RADIUS, 0.5 * WHEEL_WIDTH
    profile = [(0.78 * r, -half), (r, -0.5 * half), (r, 0.5 * half), (0.78 * r, half)]
    return hull(circles(profile, 28)[..., [0, 2, 1]] + (x, y, r))


def wheel_piece(x: float, y: float) -> trimesh.Trimesh:
    """The same with few faces, one of them flat on the ground: an edge would sink in."""
    r, half = WHEEL_RADIUS / np.cos(np.pi / 12.0), 0.5 * WHEEL_WIDTH
    profile = [(0.78 * r, -half), (r, -0.5 * half), (r, 0.5 * half), (0.78 * r, half)]
    rings = circles(profile, 12)[..., [0, 2, 1]].reshape(-1, 3)
    turn = trimesh.transformations.rotation_matrix(np.pi / 12.0, (0, 1, 0))[:3, :3]
    return hull(rings @ turn.T + (x, y, WHEEL_RADIUS))


def canopy(subdivisions: int) -> trimesh.Trimesh:
    """The cockpit's glass, half sunk into the fuselage."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    centre, half_axes = CANOPY
    return hull(ball.vertices * half_axes + np.array(centre))


def pieces() -> tuple[trimesh.Trimesh, ...]:
    """Convex pieces; the spinner belongs to the front of the fuselage."""
    rings = fuselage(FUSELAGE[:, 0], widened(ellipse(1.0, 1.0, 10)))
    front = hull(np.concatenate([rings[1:4], spinner(10)[[1, 3, 4]]]))
    return (
        front,
        *hulls(rings, (3, 5, 8)),
        canopy(1),
        *(wing.piece() for wing in WINGS),
        hull(np.vstack([fin.piece().vertices for fin in TAILPLANE])),
        RUDDER.piece(),
        hull(np.vstack([blade.piece().vertices for blade in BLADES])),
        *(leg.piece() for leg in LEGS),
        *(wheel_piece(x, y) for x, y in WHEELS),
    )


def make_airplane() -> Shape:
    at = np.unique(np.concatenate([np.linspace(0.0, 0.235, 28), FUSELAGE[:, 0]]))
    mesh = union(
        (tube(fuselage(at, ellipse(1.0, 1.0, 36))), BRICK),
        (canopy(2), BLUE),
        (hull(spinner(24)), IVORY),
        *((fin.body(), IVORY) for fin in (*WINGS, *TAILPLANE, RUDDER)),
        *((blade.body(), BROWN) for blade in BLADES),
        *((leg.body(), STEEL) for leg in LEGS),
        *((wheel(x, y), CHARCOAL) for x, y in WHEELS),
    )
    return Shape(
        name="airplane",
        description="Toy airplane on its wheels, nose towards +x",
        mesh=mesh,
        pieces=pieces(),
        mass=0.570,
        rgba=BRICK,
        notes="like the toy airplane of YCB 072-a, 570 g",
    )
