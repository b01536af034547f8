"""How far bodies among others can be moved along a straight line until they touch something.

What touches already, or overlaps, blocks the way only if that would drive it in deeper: an object
slides on the table that it stands on, and moves away from a neighbour.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    Mesh,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform

from burg_drake.core import Array, Indices, InvalidInputError
from burg_drake.scene.arrangement import ConvexShapes, contact_distances
from burg_drake.station.checks.body_shapes import PosedShapes
from burg_drake.station.checks.collision_world import CollisionWorld

NEAR = 1e-4
"""Shapes that are nearer to each other, or overlap, are looked at more closely [m]; Drake's
distances of cylinders are wrong by up to 3e-5 m."""
CLEAR = 5e-6
"""How far apart what touches or overlaps is thought to be at the start [m]."""
ALONG = 1e-2
"""Cosine of the angle between a motion and a normal of contact up to which things slide along each
other; they may sink in by `CLEAR` then."""
NUDGE = np.array([4.8e-7, 6e-7, 6.4e-7])
"""By this bodies are moved where Drake is asked for normals [m]: it has none at distances that are
rounding."""


class Travel:
    """Ways of the movable bodies of a collision world, whose shapes are read once.

    Args:
        world: the bodies.
    """

    def __init__(self, world: CollisionWorld) -> None:
        self._world = world
        self._fixed = {n: _convex_shapes(shapes) for n, shapes in world.fixed.items() if shapes}
        self._known: dict[str, ConvexShapes] = {}

    def first_contact(
        self, names: Sequence[str], direction: Array, limit: float
    ) -> tuple[float, str]:
        """How far bodies can be moved together, and what they meet there.

        Args:
            names: of movable bodies, at least one.
            direction: (3,) unit vector in the world.
            limit: [m].

        Returns:
            The way [m], at most `limit`, and the name of the body that is met, movable or fixed;
            none ("") where there is none within the limit.
        """
        others = [name for name in self._world.bodies if name not in names]
        moving = ConvexShapes.joined([self._shapes(name) for name in names])
        shapes = [*map(self._shapes, others), *self._fixed.values()]
        still = ConvexShapes.joined(shapes)
        i, j = (index.ravel() for index in np.indices((len(moving), len(still))))
        offsets, against = np.zeros((len(i), 3)), np.zeros(len(i))
        near = np.flatnonzero(_near(moving, still))
        normals = self._normals(names, others, (i[near], j[near]))
        gap = (moving.support(i[near], -normals) - still.support(j[near], normals)) * normals
        lacking = np.maximum(CLEAR - gap.sum(axis=1), 0.0)
        offsets[near] = lacking[:, None] * normals
        against[near] = np.where(lacking > 0.0, -(normals @ direction), 0.0)
        found = contact_distances(moving, still, (i, j), direction, limit, offsets)
        pressing = against > ALONG
        found[pressing & (found <= 2.0 * CLEAR / np.maximum(against, ALONG))] = 0.0
        first = int(found.argmin())
        if not np.isfinite(found[first]):
            return limit, ""
        owners = np.repeat([*others, *self._fixed], [len(s) for s in shapes])
        return float(found[first]), str(owners[j[first]])

    def _shapes(self, name: str) -> ConvexShapes:
        """Those of a movable body, in the world."""
        kind, X_WB = self._world.bodies[name]
        if kind not in self._known:
            self._known[kind] = _convex_shapes(self._world.shapes(name))
        return self._known[kind].moved(X_WB.GetAsMatrix4())

    def _normals(
        self, names: Sequence[str], others: Sequence[str], pairs: tuple[Indices, Indices]
    ) -> Array:
        """Unit vectors (K, 3) along which shapes of moving bodies come clear of others on the
        shortest way."""
        moving = [g for name in names for g in self._world.geometries(name)]
        still = [g for name in others for g in self._world.geometries(name)]
        still += self._world.anchored
        asked = [(moving[i], still[j]) for i, j in zip(*pairs, strict=True)]
        normals = np.full((len(asked), 3), np.nan)
        bodies = self._world.bodies
        for nudge in (NUDGE, -NUDGE):
            here = RigidTransform(nudge)
            nudged = {name: (bodies[name][0], here @ bodies[name][1]) for name in names}
            self._world.place({**bodies, **nudged})
            for k in np.flatnonzero(np.isnan(normals).any(axis=1)):
                normals[k] = self._normal(*asked[k])
        self._world.place(bodies)
        unit: Array = np.nan_to_num(normals)
        return unit

    def _normal(self, a: GeometryId, b: GeometryId) -> Array:
        pair = self._world.query().ComputeSignedDistancePairClosestPoints(a, b)
        return np.asarray(pair.nhat_BA_W if pair.id_A == a else -pair.nhat_BA_W)


def _near(a: ConvexShapes, b: ConvexShapes) -> NDArray[np.bool_]:
    """(A, B) whether boxes around shapes are near each other."""
    (low_a, high_a), (low_b, high_b) = a.boxes(), b.boxes()
    near = (low_a[:, None] <= high_b + NEAR) & (low_b <= high_a[:, None] + NEAR)
    return np.asarray(near.all(axis=2))


def _convex_shapes(posed: PosedShapes) -> ConvexShapes:
    """Drake's shapes, in the frame of their poses."""
    return ConvexShapes.joined(
        [_convex_shape(shape).moved(X_FG.GetAsMatrix4()) for X_FG, shape in posed]
    )


def _convex_shape(shape: Shape) -> ConvexShapes:
    """One of Drake's shapes, in its own frame."""
    middle, flat = np.zeros((1, 3)), np.zeros((3, 3))
    if isinstance(shape, Box):
        corners = np.stack(np.meshgrid(*([-0.5, 0.5],) * 3), axis=-1).reshape(-1, 3)
        return ConvexShapes.of([corners * shape.size()], [flat])
    if isinstance(shape, Sphere):
        return ConvexShapes.of([middle], [shape.radius() * np.eye(3)])
    if isinstance(shape, Ellipsoid):
        return ConvexShapes.of([middle], [np.diag([shape.a(), shape.b(), shape.c()])])
    if isinstance(shape, (Capsule, Cylinder)):
        ends = np.array([[0.0, 0.0, z * shape.length()] for z in (-0.5, 0.5)])
        round_in = [1.0, 1.0, 0.0 if isinstance(shape, Cylinder) else 1.0]
        return ConvexShapes.of([ends], [shape.radius() * np.diag(round_in)])
    if isinstance(shape, (Convex, Mesh)):
        hull = shape.GetConvexHull()
        return ConvexShapes.of(
            [np.array([hull.vertex(i) for i in range(hull.num_vertices())])], [flat]
        )
    raise InvalidInputError(
        f"a shape of kind {type(shape).__name__} cannot be checked for how far it can move"
    )
