"""Looks of links 5 to 7: forearm and wrist."""

from __future__ import annotations

import numpy as np

from tools.panda_model.limb_look import CELL, RADIUS, SEAM
from tools.robot_model.fields import (
    box,
    cylinder,
    domed,
    half_space,
    join,
    meet,
    prism,
    sphere,
)
from tools.robot_model.obj import Part
from tools.robot_model.solids import plate, rod
from tools.robot_model.surface import Piece, part, pieces, turned

WRIST = 0.088
"""Offset of joint 7 from joint 6 [m]."""


def forearm_parts() -> list[Part]:
    """Link 5: a tube from z = -0.259, a flat bar beside the axis, a drum about y."""
    tube = cylinder((0, 0, 0), (0, 0, 1), RADIUS, -0.32, -0.10)
    tube = meet(tube, half_space((0.0, -0.42, 0.9), -0.152), 0.045)
    lean = np.arctan2(0.032, 0.2)
    c, s = np.cos(lean), np.sin(lean)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    bar = box((0.0, 0.088, -0.085), (0.032, 0.0195, 0.115), 0.017, turn)
    head = cylinder((0, 0, 0), (0, 1, 0), 0.0495, 0.0, 0.14)
    head = domed(head, (0, 0.131, 0), (0, 1, 0), 0.066, 0.022)
    shell = join(join(tube, bar, 0.055), head, 0.034)
    bounds = ((-0.07, -0.075, -0.34), (0.07, 0.15, 0.07))
    face = 0.0165
    plan = [
        Piece(
            "shell",
            [((0, 0, 1), -0.259 + SEAM), ((0, -1, 0), -0.112 + SEAM)],
            remove=[rod((0, face, 0), (0, -1, 0), 0.058, 0.2)],
        ),
        Piece("dark", [((0, 0, 1), -0.259), ((0, 0, -1), 0.255)], depth=SEAM),
        Piece("dark", [((0, -1, 0), -0.112), ((0, 1, 0), 0.112 - SEAM - 0.002)], depth=SEAM),
        Piece("cap", [((0, 1, 0), 0.112)]),
    ]
    return pieces(shell, bounds, CELL, plan)


def wrist_parts() -> list[Part]:
    """Link 6: a drum about z at joint 6, a barrel about y at joint 7."""
    drum = cylinder((0, 0, 0), (0, 0, 1), 0.048, -0.0155, 0.07)
    drum = meet(drum, sphere((0.02, 0, -0.045), 0.1005), 0.020)
    barrel = cylinder((WRIST, 0, 0), (0, 1, 0), 0.0435, -0.09, 0.09)
    barrel = domed(barrel, (WRIST, 0.081, 0), (0, 1, 0), 0.080, 0.026)
    bridge = box((0.043, 0.006, 0.010), (0.040, 0.032, 0.024), 0.02)
    shell = join(join(drum, bridge, 0.020), barrel, 0.028)
    bounds = ((-0.06, -0.11, -0.06), (0.145, 0.095, 0.075))
    end, cap, face = 0.0512, 0.066, 0.0148
    outer, inner = (rod((0.002, 0, 0.03), (0, 0, 1), radius, 0.1) for radius in (0.0300, 0.0288))
    plan = [
        Piece(
            "shell",
            [((0, 1, 0), -end + SEAM), ((0, -1, 0), -cap + SEAM)],
            remove=[rod((0, 0, -face), (0, 0, -1), 0.050, 0.1)],
        ),
        Piece("dark", [((0, 1, 0), -end), ((0, -1, 0), end - 0.004)], depth=SEAM),
        Piece("dark", [((0, -1, 0), -cap), ((0, 1, 0), cap - SEAM - 0.002)], depth=SEAM),
        Piece("cap", [((0, 1, 0), cap)]),
        Piece("dark", within=[outer], remove=[inner], depth=-0.0006),
        Piece("cap", within=[inner], depth=-0.0006),
    ]
    ring = part(rod((0, 0, 0.0), (0, 0, -1), RADIUS - 0.009, 0.0165), "dark")
    return [*pieces(shell, bounds, CELL, plan), ring]


def flange_parts() -> list[Part]:
    """Link 7: a short drum about z with the flange, and the lug with the guiding buttons."""
    body = cylinder((0, 0, 0), (0, 0, 1), 0.044, 0.03, 0.12)
    side = [(0.0, 0.056), (0.052, 0.060), (0.112, 0.071), (0.1145, 0.090), (0.104, 0.0960)]
    lug = prism([*side, (0.0, 0.0965)], (0, 2), -0.0295, 0.0295, corner=0.005, rim=0.006)
    lug = meet(lug, sphere((0.0, 0.0, 0.082), 0.113), 0.008)
    button = plate(
        [(0.062, 0.071), (0.098, 0.077), (0.098, 0.088), (0.062, 0.088)],
        (0, 2),
        -0.04,
        0.04,
        corner=0.004,
    )
    start = 0.0512
    parts = pieces(
        join(body, lug, 0.006),
        ((-0.05, -0.05, 0.02), (0.125, 0.05, 0.13)),
        0.0042,
        [
            Piece("shell", [((0, 0, 1), start + SEAM), ((0, 0, -1), -0.0978)]),
            Piece("dark", [((0, 0, 1), start), ((0, 0, -1), -start - 0.004)], depth=SEAM),
            Piece("dark", within=[button], depth=-0.0005),
        ],
        tolerance=1.0e-4,
    )
    half = np.sqrt(0.5)
    turn = np.array([[half, -half, 0.0], [half, half, 0.0], [0.0, 0.0, 1.0]])
    metal = part(rod((0, 0, 0.095), (0, 0, 1), 0.0315, 0.012, bevel=0.001), "metal")
    return [*turned(parts, turn, (0.0, 0.0, 0.0)), metal]
