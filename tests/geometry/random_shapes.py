"""Random convex shapes, for this package and for Drake."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Box, Convex, Cylinder, Shape as DrakeShape, Sphere
from pydrake.math import RigidTransform

from burg_drake.core import make_pose, rotation_from_rpy
from burg_drake.geometry import Shape

KINDS = ("box", "cylinder", "ball", "hull")


def random_pose(rng: np.random.Generator, spread: float) -> np.ndarray:
    return make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), rng.uniform(-spread, spread, 3))


def random_shape(kind: str, rng: np.random.Generator) -> tuple[Shape, DrakeShape, RigidTransform]:
    """A shape of some centimetres at a random place, for the screen and for Drake."""
    X_BP = random_pose(rng, 0.05)
    half = rng.uniform(0.01, 0.04, 3)
    match kind:
        case "box":
            shape, drake = Shape.box(X_BP, half), Box(*(2 * half))
        case "cylinder":
            shape, drake = Shape.cylinder(X_BP, half[0], half[2]), Cylinder(half[0], 2 * half[2])
        case "ball":
            shape, drake = Shape.ball(X_BP, half[0]), Sphere(half[0])
        case _:
            points = rng.uniform(-1, 1, (12, 3)) * half
            shape, drake = Shape.hull(X_BP, points), Convex(points.T, "hull")
    return shape, drake, RigidTransform(X_BP)
