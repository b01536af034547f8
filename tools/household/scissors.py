"""Scissors: two crossing halves with ring handles, lying flat and slightly open."""

from __future__ import annotations

import numpy as np
import trimesh

from .colours import CHARCOAL, PLUM, STEEL, Rgba
from .curves import Array, ellipse, equal_area_factor, rounded_rectangle
from .shape import Shape
from .solids import canonical, circles, hull, moved, rings_along, tube, union

HEIGHT = 0.0115  # of the handles [m]
BLADE = 0.0028  # thickness of a blade [m]
OPENING = 11.0  # of each half from the middle [deg]
RING_PIECES = 8
THUMB, FINGERS = (0.0205, 0.0160), (0.0280, 0.0175)  # half axes of the rings' centre lines [m]
GRIP, ROUND = 0.0042, 0.0036  # half width of the rings' section, radius of its corners [m]
CHAMFER = np.sqrt(2.0 - 0.5 * np.pi)  # cut over radius of a corner of equal area

# Outlines (x, y) [m] of one half, the pivot at the origin and the blade along +x.
STEEL_OUTLINE = np.array(
    [
        (-0.012, -0.0065),
        (0.012, -0.0078),
        (0.060, -0.0058),
        (0.093, 0.0032),
        (0.0955, 0.0055),
        (0.010, 0.0068),
        (-0.012, 0.0060),
    ]
)
SHANK_OUTLINE = np.array(
    [
        (-0.052, -0.0145),
        (-0.049, -0.0205),
        (-0.042, -0.0205),
        (-0.012, -0.0080),
        (0.006, -0.0062),
        (0.010, -0.0020),
        (0.008, 0.0030),
        (-0.008, 0.0068),
        (-0.016, 0.0058),
    ]
)


def slab(outline: Array, z0: float, z1: float, bevel: float) -> trimesh.Trimesh:
    """Convex plate over a convex outline (K, 2) [m] between heights z0 and z1, edges bevelled."""
    centre = outline.mean(axis=0)
    reach = np.linalg.norm(outline - centre, axis=1, keepdims=True)
    inner = centre + (outline - centre) * (1.0 - bevel / reach)
    layers = [(inner, z0), (outline, z0 + bevel), (outline, z1 - bevel), (inner, z1)]
    return hull([np.column_stack([p, np.full(len(p), z)]) for p, z in layers])


def loop(axes: tuple[float, float], count: int, section: Array) -> Array:
    """(count, N, 3) rings [m] of a handle along an ellipse in the plane z = HEIGHT / 2."""
    centre = (-0.0485 - axes[0], -0.0145 - 0.25 * axes[1])
    path = np.column_stack([ellipse(*axes, count) + centre, np.full(count, 0.5 * HEIGHT)])
    return rings_along(path, (0, 0, 1), section, closed=True)


def half(axes: tuple[float, float], z0: float) -> tuple[list, list]:
    """Coloured bodies and convex pieces of one half, its blade between z0 and z0 + BLADE."""
    blade = slab(STEEL_OUTLINE, z0, z0 + BLADE, 0.0004)
    shank = slab(SHANK_OUTLINE, z0 - 0.0024, z0 + BLADE + 0.0024, 0.0010)
    fine = tube(loop(axes, 48, rounded_rectangle(GRIP, 0.5 * HEIGHT, ROUND, 3)), closed=True)
    count = 2 * RING_PIECES
    scale = equal_area_factor(count)
    section = rounded_rectangle(GRIP, 0.5 * HEIGHT, CHAMFER * ROUND, 1)
    coarse = loop((scale * axes[0], scale * axes[1]), count, section)
    coarse = np.concatenate([coarse, coarse[:1]])
    pieces = [hull(coarse[k : k + 3]) for k in range(0, count, 2)]
    return [(blade, STEEL), (shank, PLUM), (fine, PLUM)], [blade, shank, *pieces]


def make_scissors() -> Shape:
    middle = 0.5 * HEIGHT
    bodies: list[tuple[trimesh.Trimesh, Rgba]] = []
    pieces: list[trimesh.Trimesh] = []
    for axes, z0, mirror in ((THUMB, middle, 1.0), (FINGERS, middle - BLADE, -1.0)):
        X = trimesh.transformations.rotation_matrix(np.radians(OPENING) * mirror, (0, 0, 1))
        X = X @ np.diag([1.0, mirror, 1.0, 1.0])
        solids, convex = half(axes, z0)
        bodies += [(moved(mesh, X), rgba) for mesh, rgba in solids]
        pieces += [moved(mesh, X) for mesh in convex]
    screw = [(0.0046, 0.0), (0.0046, HEIGHT)]
    bodies.append((hull(circles(screw, 32)), CHARCOAL))
    pieces.append(hull(circles(screw, 10)))
    mesh = union(*bodies)
    shift = np.append(-mesh.bounds[:, :2].mean(axis=0), -mesh.bounds[0, 2])
    X = trimesh.transformations.translation_matrix(shift)
    return Shape(
        name="scissors",
        description="Scissors lying flat, slightly open, blades towards +x",
        mesh=canonical(moved(mesh, X)),
        pieces=tuple(moved(piece, X) for piece in pieces),
        mass=0.082,
        rgba=PLUM,
        notes="like YCB 037 scissors, 82 g",
    )
