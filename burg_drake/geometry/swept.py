"""Convex shapes swept along a straight segment: all places that a shape passes, as convex shapes.

What a shape sweeps when it is moved along a segment is the sum of the two, which is convex. So a
whole straight motion is judged by one overlap, and by one distance, without samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from burg_drake.core import Array, make_pose, transform_points
from burg_drake.geometry.body import Body
from burg_drake.geometry.convex import Ball, Cylinder
from burg_drake.geometry.polytope import Polytope
from burg_drake.geometry.shape import Shape

SIDES = 64
"""Sides of the prism about a cylinder that is swept across its axis: it is larger by 0.12 % of the
radius, `1 / cos(pi / SIDES) - 1`."""

ALONG = 1e-9
"""Sine of the angle between a cylinder's axis and the way up to which they are parallel."""


def swept_shape(shape: Shape, shift_B: Array) -> list[Shape]:
    """The shapes whose union is what a shape sweeps.

    Args:
        shape: the shape, in a body's frame B.
        shift_B: (3,) from where it starts to where it ends [m].

    Returns:
        One shape in B, or three for a ball: a cylinder and the balls at its ends. They are exact,
        but for a cylinder that is swept across its axis: see `SIDES`.
    """
    length = float(np.linalg.norm(shift_B))
    if length == 0.0:
        return [shape]
    X_BP = shape.X_BP
    R_BP, middle = X_BP[:3, :3], make_pose(p_AB=shift_B / 2) @ X_BP
    match shape.convex:
        case Ball(radius=radius):
            R_BC = _z_along(shift_B / length)
            tube = Shape.cylinder(make_pose(R_BC, middle[:3, 3]), radius, length / 2)
            return [shape, Shape.ball(make_pose(p_AB=shift_B) @ X_BP, radius), tube]
        case Cylinder(radius=radius, half_length=half_length):
            if np.linalg.norm(np.cross(R_BP[:, 2], shift_B / length)) <= ALONG:
                return [Shape.cylinder(middle, radius, half_length + length / 2)]
            prism = Polytope.prism(radius / np.cos(np.pi / SIDES), half_length, SIDES)
            return [_swept_points(prism.vertices, X_BP, shift_B)]
    assert shape.polytope is not None  # only a ball has none
    return [_swept_points(shape.polytope.vertices, X_BP, shift_B)]


def swept_body(body: Body, shift_W: Array) -> Body:
    """What a body sweeps along `shift_W` (3,) [m], given in the world."""
    X_WB = make_pose(body.X_WB.R, body.X_WB.p)
    placed = [replace(piece, X_BP=X_WB @ piece.X_BP) for piece in body.pieces]
    return Body(np.eye(4), [shape for piece in placed for shape in swept_shape(piece, shift_W)])


def _swept_points(points: Array, X_BP: Array, shift_B: Array) -> Shape:
    """The hull of points (N, 3) in P and of the same at the end of the way."""
    p_B = transform_points(X_BP, points)
    return Shape.hull(np.eye(4), np.concatenate([p_B, p_B + shift_B]))


def _z_along(u: Array) -> Array:
    """(3, 3) some rotation with a unit vector (3,) for its z axis."""
    x = np.cross(u, np.eye(3)[np.abs(u).argmin()])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(u, x), u])
