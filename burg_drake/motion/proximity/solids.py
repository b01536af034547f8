"""Convex solids that stand in the world, with bounds of the signed distance to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Single, content_hash
from burg_drake.geometry import Ball, Boxes, Cylinder, Shape

Points = Single | Sequence[Single]
"""(3, ...) points, or their three coordinates in shapes that broadcast, as those of a grid."""


@dataclass(frozen=True, eq=False)
class BoxSolid:
    """A box.

    Attributes:
        X_WB: (4, 4) pose.
        half: (3,) half extents [m].
    """

    X_WB: Array
    half: Array

    @property
    def low(self) -> Array:
        """(3,) lower corner of the box along the world's axes around it."""
        return np.asarray(self.X_WB[:3, 3] - np.abs(self.X_WB[:3, :3]) @ self.half)

    @property
    def high(self) -> Array:
        """(3,) its upper corner."""
        return np.asarray(self.X_WB[:3, 3] + np.abs(self.X_WB[:3, :3]) @ self.half)

    def _beyond(self, p: Points) -> list[Single]:
        """How far points are outside of each pair of faces; negative between them."""
        R = self.X_WB[:3, :3]
        beyond = []
        for axis in range(3):
            offset = np.float32(-R[:, axis] @ self.X_WB[:3, 3])
            along: Single | None = None
            for x, factor in zip(p, R[:, axis], strict=True):
                if abs(factor) > 1e-12:
                    term = x if factor == 1.0 else x * np.float32(factor)
                    along = term if along is None else along + term
            assert along is not None
            value = np.abs(along + offset if offset else along)
            value -= np.float32(self.half[axis])
            beyond.append(value)
        return beyond

    def below(self, p: Single) -> Single:
        """A lower bound, exact in front of a face and inside."""
        x, y, z = self._beyond(p)
        np.maximum(x, y, out=x)
        return np.maximum(x, z, out=x)

    def distance(self, p: Points) -> Single:
        """The signed distance."""
        x, y, z = self._beyond(p)
        inside = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
        x, y, z = (np.maximum(a, 0.0) for a in (x, y, z))
        return np.asarray(inside + np.sqrt(x * x + y * y + z * z))


@dataclass(frozen=True, eq=False)
class BallSolid:
    """A ball.

    Attributes:
        center: (3,) [m].
        radius: [m].
    """

    center: Array
    radius: float

    @property
    def low(self) -> Array:
        """(3,) lower corner of the box along the world's axes around it."""
        return np.asarray(self.center - self.radius)

    @property
    def high(self) -> Array:
        """(3,) its upper corner."""
        return np.asarray(self.center + self.radius)

    def distance(self, p: Points) -> Single:
        """The signed distance at points."""
        x, y, z = (a - np.float32(c) for a, c in zip(p, self.center, strict=True))
        return np.asarray(np.sqrt(x * x + y * y + z * z) - np.float32(self.radius))


@dataclass(frozen=True, eq=False)
class HullSolid:
    """A convex polytope.

    Attributes:
        normals: (F, 3) outward unit normals.
        offsets: (F,) of its faces' planes [m].
        vertices: (V, 3) [m].
        bulge: how far the true shape may stick out of the faces [m].
    """

    normals: Array
    offsets: Array
    vertices: Array
    bulge: float = 0.0

    @property
    def low(self) -> Array:
        """(3,) lower corner of the box along the world's axes around it."""
        return np.asarray(self.vertices.min(axis=0) - self.bulge)

    @property
    def high(self) -> Array:
        """(3,) its upper corner."""
        return np.asarray(self.vertices.max(axis=0) + self.bulge)

    def below_on(self, ticks: list[Array]) -> Single:
        """A lower bound on a grid (a, b, c): the farthest plane. Inside it is exact."""
        x, y, z = (np.asarray(t, dtype=np.float32) for t in ticks)
        normals, offsets = self.normals.astype(np.float32), self.offsets.astype(np.float32)
        farthest = np.full((len(x), len(y), len(z)), -np.inf, dtype=np.float32)
        for normal, offset in zip(normals, offsets, strict=True):
            plane = (normal[0] * x)[:, None] + (normal[1] * y - offset)
            np.maximum(farthest, plane[:, :, None] + normal[2] * z, out=farthest)
        return farthest - np.float32(self.bulge)

    def above(self, p: Array) -> Single:
        """An upper bound at points (K, 3).

        From the foot of the perpendicular on the farthest plane it goes on to the centroid until
        it is inside: along a line the farthest plane's distance is convex.
        """
        heights = p @ self.normals.T - self.offsets
        farthest = heights.max(axis=1)
        foot = p - np.maximum(farthest, 0.0)[:, None] * self.normals[heights.argmax(axis=1)]
        left = np.maximum((foot @ self.normals.T - self.offsets).max(axis=1), 0.0)
        centroid = self.vertices.mean(axis=0)
        depth = (self.offsets - self.normals @ centroid).min()
        offset = left / (left + depth) * np.linalg.norm(foot - centroid, axis=1)
        return np.asarray(np.where(farthest > 0.0, farthest + offset, farthest), dtype=np.float32)


ProximitySolid = BoxSolid | BallSolid | HullSolid


def content_of(solids: list[ProximitySolid]) -> str:
    """Hash of solids."""
    return content_hash([[type(solid).__name__, vars(solid)] for solid in solids])


def solid_of(shape: Shape, X_WB: Array) -> ProximitySolid:
    """A shape of a body at a pose (4, 4) as a solid."""
    X_WP = X_WB @ shape.X_BP
    if isinstance(shape.convex, Boxes):
        return BoxSolid(X_WP, shape.half)
    if isinstance(shape.convex, Ball):
        return BallSolid(X_WP[:3, 3], float(shape.half[0]))
    polytope = shape.polytope
    assert polytope is not None
    moved = polytope.moved(X_WP)
    bulge = 0.0
    if isinstance(shape.convex, Cylinder):
        bulge = float(shape.half[0] * (1.0 - np.cos(np.pi / len(polytope.vertices) * 2)))
    return HullSolid(moved.normals, moved.offsets, moved.vertices, bulge)
