"""Screwdriver: a fluted handle and a flat-bladed shaft, lying along x."""

from __future__ import annotations

import numpy as np

from .colours import CHARCOAL, ORANGE, STEEL, painted
from .curves import Array, angles, smooth
from .rest import laid_down
from .shape import Shape
from .solids import canonical, hulls, tube, widened

LENGTH = 0.210  # [m]
FLUTES = 6
SEGMENTS, PIECE_SEGMENTS = 48, 12
# distance from the end of the handle, half axes along y and z, depth of the flutes, all [m]
HANDLE = np.array(
    [
        (0.0000, 0.0060, 0.0060, 0.0),
        (0.0012, 0.0095, 0.0095, 0.0),
        (0.0050, 0.0125, 0.0125, 0.0),
        (0.0120, 0.0147, 0.0147, 0.0012),
        (0.0250, 0.0156, 0.0156, 0.0020),
        (0.0450, 0.0152, 0.0152, 0.0020),
        (0.0680, 0.0140, 0.0140, 0.0016),
        (0.0790, 0.0114, 0.0114, 0.0003),
        (0.0850, 0.0104, 0.0104, 0.0),
        (0.0930, 0.0120, 0.0120, 0.0),
        (0.1000, 0.0106, 0.0106, 0.0),
        (0.1040, 0.0070, 0.0070, 0.0),
    ]
)
SHAFT = np.array(
    [
        (0.1040, 0.0033, 0.0033, 0.0),
        (0.1930, 0.0033, 0.0033, 0.0),
        (0.1990, 0.0044, 0.0027, 0.0),
        (0.2085, 0.0041, 0.0007, 0.0),
        (0.2100, 0.0039, 0.0006, 0.0),
    ]
)
PIECE_ROWS = [0, 2, 3, 4, 6, 8, 9, 10, 11]  # of the handle, that the convex pieces keep
COLLAR = 0.085  # where the handle's dark collar begins [m]


def sections(table: Array, count: int) -> Array:
    """(M, count, 2) outlines [m] across the axis, for rows of the tables above."""
    t = angles(count)
    depth = table[:, 3:4] * (0.5 - 0.5 * np.cos(FLUTES * t))
    return np.stack(
        [(table[:, 1:2] - depth) * np.cos(t), (table[:, 2:3] - depth) * np.sin(t)], axis=2
    )


def rings(table: Array, outlines: Array) -> Array:
    """(M, N, 3) rings [m] of outlines across x, the middle of the screwdriver at the origin."""
    x = np.broadcast_to(table[:, :1] - 0.5 * LENGTH, outlines.shape[:2])
    return np.concatenate([x[..., None], outlines], axis=2)


def make_screwdriver() -> Shape:
    at = np.unique(np.concatenate([np.linspace(0.0, 0.104, 37), HANDLE[:4, 0], [COLLAR]]))
    fine = np.vstack([np.column_stack([at, smooth(HANDLE, at)]), SHAFT])
    mesh = painted(
        tube(rings(fine, sections(fine, SEGMENTS))),
        ORANGE,
        (lambda p, n: p[:, 0] > COLLAR - 0.5 * LENGTH, CHARCOAL),
        (lambda p, n: p[:, 0] > SHAFT[0, 0] - 0.5 * LENGTH - 1e-6, STEEL),
    )
    handle, shaft = (
        rings(table, widened(sections(table, PIECE_SEGMENTS)))
        for table in (HANDLE[PIECE_ROWS], SHAFT)
    )
    pieces = (*hulls(handle, (0, 3, 4, 5, 8)), *hulls(shaft, (0, 1, 4)))
    mesh, pieces = laid_down(mesh, pieces)
    return Shape(
        name="screwdriver",
        description="Flat screwdriver lying along x, blade towards +x",
        mesh=canonical(mesh),
        pieces=pieces,
        mass=0.098,
        rgba=ORANGE,
        notes="like YCB 044 flat screwdriver, 98 g",
    )
