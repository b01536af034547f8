"""Looks of link 0: the base with its foot plate."""

from __future__ import annotations

from manifold3d import Manifold

from tools.panda_model.limb_look import CELL, SEAM
from tools.robot_model.fields import cylinder, half_space, join, meet, prism
from tools.robot_model.obj import Part
from tools.robot_model.solids import plate, rod
from tools.robot_model.surface import Piece, part, pieces

TOP = 0.140
"""Joint 1 begins here [m]."""


def base_parts() -> list[Part]:
    """Parts of link 0."""
    column = cylinder((0, 0, 0), (0, 0, 1), 0.069, -0.03, 0.17, taper=-0.014 / TOP)
    outline = [(-0.134, 0.052), (0.018, 0.072), (0.05, 0.02), (0.05, -0.02), (0.018, -0.072)]
    body = prism([*outline, (-0.134, -0.052)], (0, 1), -0.03, 0.125, corner=0.014, rim=0.006)
    body = meet(body, half_space((-0.96, 0.0, 0.281), 0.1335), 0.012)
    body = meet(body, half_space((-0.586, 0.0, 0.810), 0.1254), 0.030)
    for side in (1.0, -1.0):
        body = meet(body, half_space((0.0, side * 0.50, 0.866), 0.1145), 0.015)
    window = plate(
        [(-0.116, 0.016), (-0.112, 0.040), (-0.030, 0.078), (-0.014, 0.078), (-0.014, 0.016)],
        (0, 2),
        -0.1,
        0.1,
        corner=0.004,
    )
    shell = pieces(
        join(column, body, 0.022),
        ((-0.16, -0.10, -0.04), (0.09, 0.10, 0.18)),
        CELL,
        [
            Piece("shell", [((0, 0, 1), 0.0), ((0, 0, -1), -TOP + SEAM)]),
            Piece("dark", [((0, 0, 1), TOP - 0.004), ((0, 0, -1), -TOP)], depth=SEAM),
            Piece("dark", within=[window], depth=-0.0006),
        ],
    )
    return [*shell, part(_foot(), "shell"), *(part(c, "metal") for c in _connectors())]


def _foot() -> Manifold:
    outline = [(-0.155, 0.050), (-0.140, 0.068), (0.0, 0.0946), (0.022, 0.075), (0.055, 0.045)]
    outline += [(x, -y) for x, y in reversed(outline)]
    return plate(outline, (0, 1), -0.002, 0.0095, corner=0.012, bevel=0.0015).trim_by_plane(
        (0, 0, 1), 0.0
    )


def _connectors() -> list[Manifold]:
    """Sockets on both panels."""
    spots = [(-0.066, 0.042, 0.009), (-0.036, 0.052, 0.006), (-0.036, 0.030, 0.006)]
    return [
        rod((x, 0.0, z), (0.0, side, 0.0), radius, 0.0655 + 0.13 * (x + 0.066), bevel=0.001)
        for x, z, radius in spots
        for side in (1.0, -1.0)
    ]
