"""Convex collision geometry for the screen: boxes, cylinders, balls and convex hulls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, inverse
from burg_drake.geometry.convex import Ball, Boxes, Convex, Cylinder, Hull
from burg_drake.geometry.polytope import Polytope


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex shape at a place.

    Attributes:
        X_BP: (4, 4) pose of the shape's frame P in a body's; its origin is the middle of the
            shape's bounding box.
        half: (3,) half extents of that box along the axes of P [m].
        convex: the shape as a partner of a polytope, in P.
        polytope: the shape as a polytope, in P; None for a ball.
        curved: whether it is a cylinder or ball; `polytope` is the prism within the cylinder then.
    """

    X_BP: Array
    half: Array
    convex: Convex
    polytope: Polytope | None
    curved: bool = False

    @classmethod
    def box(cls, X_BP: Array, half: Array) -> Shape:
        """A box."""
        return cls(X_BP, half, Boxes(half[None]), Polytope.box(half))

    @classmethod
    def hull(cls, X_BO: Array, points: Array) -> Shape:
        """The convex hull of points (N, 3) given in O."""
        polytope = Polytope.from_points(points)
        if (box := polytope.as_box()) is not None:
            return cls.box(X_BO @ box[0], box[1])
        X_OP = np.eye(4)
        X_OP[:3, 3], half = polytope.bounds
        centred = polytope.moved(inverse(X_OP))
        return cls(X_BO @ X_OP, half, Hull(centred), centred)

    @classmethod
    def ball(cls, X_BP: Array, radius: float) -> Shape:
        """A ball."""
        return cls(X_BP, np.full(3, radius), Ball(radius), None, curved=True)

    @classmethod
    def cylinder(cls, X_BP: Array, radius: float, half_length: float) -> Shape:
        """A cylinder about z."""
        half = np.array([radius, radius, half_length])
        prism = Polytope.prism(radius, half_length)
        return cls(X_BP, half, Cylinder(radius, half_length), prism, curved=True)
