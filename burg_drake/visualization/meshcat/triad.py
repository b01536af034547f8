"""A frame as three arrows: x red, y green, z blue."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform

from burg_drake.core import Array, make_pose

AXIS_COLORS = (Rgba(0.84, 0.15, 0.12), Rgba(0.13, 0.60, 0.20), Rgba(0.12, 0.32, 0.80))
"""Of x, y and z."""
ORIGIN_COLOR = Rgba(0.2, 0.2, 0.2)
R_FA = (
    np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    np.eye(3),
)
"""Frames A whose z axis is x, y and z of F."""
HEAD_WIDTH = 2.4
ORIGIN_WIDTH = 1.6
"""Radii of arrow heads and of the ball at the origin, compared with that of an axis."""


@dataclass(frozen=True)
class TriadStyle:
    """How a frame is drawn.

    Attributes:
        length: of an axis, with its head [m].
        radius: of an axis [m].
        head: length of its arrow head [m].
    """

    length: float
    radius: float
    head: float


def draw_triad(meshcat: Meshcat, path: str, X_WF: Array, style: TriadStyle) -> None:
    """Draws a frame.

    Args:
        meshcat: where to draw.
        path: gets the frame's pose; below it are `x`, `y`, `z`, each with `shaft` and `head`, whose
            own frame is at the tip, and `origin`.
        X_WF: (4, 4) the frame.
        style: sizes.
    """
    shaft = style.length - style.head
    radius = HEAD_WIDTH * style.radius
    X_AH = make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, style.length))
    meshcat.SetTransform(path, RigidTransform(X_WF))
    for name, R, color in zip("xyz", R_FA, AXIS_COLORS, strict=True):
        axis = f"{path}/{name}"
        meshcat.SetTransform(axis, RigidTransform(make_pose(R)))
        meshcat.SetObject(f"{axis}/shaft", Cylinder(style.radius, shaft), color)
        meshcat.SetTransform(f"{axis}/shaft", RigidTransform([0.0, 0.0, shaft / 2.0]))
        meshcat.SetObject(f"{axis}/head", MeshcatCone(style.head, radius, radius), color)
        meshcat.SetTransform(f"{axis}/head", RigidTransform(X_AH))
    meshcat.SetObject(f"{path}/origin", Sphere(ORIGIN_WIDTH * style.radius), ORIGIN_COLOR)
