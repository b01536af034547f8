"""Looks of links 1 to 4: shoulder and elbow, each made of the same part twice."""

from __future__ import annotations

import numpy as np

from tools.robot_model.fields import (
    Field,
    Vector,
    capsule,
    cylinder,
    domed,
    half_space,
    join,
    meet,
)
from tools.robot_model.obj import Part
from tools.robot_model.solids import rod
from tools.robot_model.surface import Piece, part, pieces, turned

RADIUS = 0.055
"""Of the tubes and drums of the arm [m]."""
SEAM = 0.0012
"""Width and depth of the dark seams between the parts [m]."""
CELL = 0.0072
"""Sampling grid of the shells [m]."""
ELBOW = 0.0825
"""Offset of the elbow axis from the tube [m]."""

RX_MINUS_90 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Link 1 to link 2."""
RX_90 = RX_MINUS_90.T
"""Link 3 to link 4."""


def shoulder_parts() -> tuple[list[Part], list[Part]]:
    """Parts of link 1 and link 2."""
    return _shoulder(0.192), turned(_shoulder(0.194), RX_MINUS_90, (0.0, 0.0, 0.0))


def elbow_parts() -> tuple[list[Part], list[Part]]:
    """Parts of link 3 and link 4."""
    return _elbow(0.121), turned(_elbow(0.124), RX_90, (-ELBOW, 0.0, 0.0))


def _shoulder(end: float) -> list[Part]:
    """Link 1: a tube that comes up from z = -end and bends into a drum about -y."""
    drum = cylinder((0, 0, 0), (0, -1, 0), RADIUS, -0.03, 0.14)
    drum = domed(drum, (0, -0.129, 0), (0, -1, 0), 0.063, 0.024)
    tube = cylinder((0, 0, 0), (0, 0, 1), RADIUS, -end - 0.05, -0.02)
    tube = meet(tube, half_space((0.0, 0.55, 0.835), -0.053), 0.030)

    def fillet(p: np.ndarray) -> np.ndarray:
        """Wide on the outer side of the bend, narrow below the joint."""
        t = np.clip((0.005 - p[:, 1]) / 0.070, 0.0, 1.0)
        return 0.014 + 0.076 * t * t * (3.0 - 2.0 * t)

    bounds = ((-0.07, -0.15, -end - 0.07), (0.07, 0.075, 0.07))
    plan = _plan(end, cap=0.104, outward=(0.0, -1.0, 0.0), centre=(0.0, 0.0, 0.0))
    disc = part(rod((0, 0, 0), (0, -1, 0), RADIUS - SEAM, 0.004), "dark")
    return [*pieces(_slim(join(tube, drum, fillet)), bounds, CELL, plan), disc]


def _elbow(end: float) -> list[Part]:
    """Link 3: a tube from z = -end, a web, and a drum about y at x = ELBOW."""
    centre = (ELBOW, 0.0, 0.0)
    drum = cylinder(centre, (0, 1, 0), RADIUS, -0.012, 0.125)
    drum = domed(drum, (ELBOW, 0.111, 0), (0, 1, 0), 0.063, 0.024)
    tube = cylinder((0, 0, 0), (0, 0, 1), RADIUS, -end - 0.05, 0.02)
    tube = domed(tube, (0, 0, -0.014), (0, 0, 1), 0.062, 0.030)
    web = capsule((0.0, 0.010, -0.062), (0.075, 0.020, -0.006), 0.036)
    bounds = ((-0.07, -0.075, -end - 0.07), (0.155, 0.13, 0.075))
    plan = _plan(end, cap=0.070, outward=(0.0, 1.0, 0.0), centre=centre)
    disc = part(rod(centre, (0, 1, 0), RADIUS - SEAM, 0.004), "dark")
    shell = join(join(tube, web, 0.020), drum, 0.045)
    return [*pieces(shell, bounds, CELL, plan), disc]


def _slim(shell: Field) -> Field:
    """Without the bulge that a wide fillet raises where two cylinders cross."""
    for side in (1.0, -1.0):
        shell = meet(shell, half_space((side, 0.0, 0.0), RADIUS + 0.002), 0.014)
    return shell


def _plan(end: float, cap: float, outward: Vector, centre: Vector) -> list[Piece]:
    """Shell, cap and seams of a limb.

    Args:
        end: the tube ends at z = -end [m].
        cap: the cap begins here along the drum [m].
        outward: axis of the drum (3,), away from the joint.
        centre: where the drum meets the drum of the neighbouring link (3,) [m].
    """
    inward = (-outward[0], -outward[1], -outward[2])
    room = rod(np.add(centre, np.multiply(outward, SEAM / 2)), inward, RADIUS + 0.003, 0.2)
    return [
        Piece("shell", [((0, 0, 1), -end + SEAM), (inward, -cap + SEAM)], remove=[room]),
        Piece("dark", [((0, 0, 1), -end), ((0, 0, -1), end - 0.004)], depth=SEAM),
        Piece("dark", [(inward, -cap), (outward, cap - SEAM - 0.002)], depth=SEAM),
        Piece("cap", [(outward, cap)]),
    ]
