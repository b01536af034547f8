"""Balls that cover a convex shape and stick out of it by no more than a tolerance.

A ball about an interior point whose radius is the point's depth plus the tolerance sticks out by
the tolerance at most, wherever the point is; what it takes is a choice of such balls that covers
the shape. Capsules take a row along the axis. Boxes and cylinders are cut into cells with straight
edges, of which a ball covers one if it covers the corners; a greedy set cover then picks balls.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    GeometryId,
    Mesh,
    SceneGraphInspector,
    Sphere,
)

from burg_drake.core import Array, InvalidInputError, inverse, transform_points
from burg_drake.geometry import Polytope

CELL = 1.8
"""Size of a cell over the overshoot. Up to 2.7 the ball about the middle of a cube in a corner of a
box covers it: half its diagonal is half its side plus the overshoot."""
MOST_CELLS = 2_000
"""Of a shape; a larger one is cut more coarsely, as time and memory grow with the square."""
COARSER = 1.1
"""Factor by which the overshoot rises until there are few enough."""
DEEPEST = 0.08
"""Radius of the largest balls inside a shape [m]: distances from the scene are not known much
farther out than that."""
ROUNDING = 1e-9
"""Far above the rounding of a distance [m]."""


@dataclass(frozen=True, eq=False)
class Balls:
    """M balls that cover a shape.

    Attributes:
        center: (M, 3) [m].
        outer: (M,) radii with which they cover it [m].
        inner: (M,) radii of the balls about the same centres inside the shape [m].
    """

    center: Array
    outer: Array
    inner: Array

    def moved(self, X_AB: Array) -> Balls:
        """The balls given in B, expressed in A: `X_AB` is (4, 4)."""
        return Balls(transform_points(X_AB, self.center), self.outer, self.inner)

    @classmethod
    def joined(cls, several: list[Balls]) -> Balls:
        """All of them."""
        return cls(
            np.concatenate([balls.center for balls in several]),
            np.concatenate([balls.outer for balls in several]),
            np.concatenate([balls.inner for balls in several]),
        )


def cover_body(
    inspector: SceneGraphInspector, geometries: list[GeometryId], overshoot: float
) -> Balls:
    """Balls that cover the collision geometries of a body, in its frame.

    Args:
        inspector: of the scene graph.
        geometries: of one body.
        overshoot: how far balls should stick out [m]; those of shapes of some decimetres stick out
            farther. Of a convex mesh the box around it is covered.

    Raises:
        InvalidInputError: a geometry is of a shape that cannot be covered.
    """
    balls = Balls(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    by_rows = sorted(geometries, key=lambda g: not isinstance(inspector.GetShape(g), Capsule))
    for geometry in by_rows:
        X_BP = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        more = _cover(inspector, geometry, overshoot, balls.moved(inverse(X_BP)))
        balls = Balls.joined([balls, more.moved(X_BP)])
    return balls


def _cover(
    inspector: SceneGraphInspector, geometry: GeometryId, overshoot: float, given: Balls
) -> Balls:
    shape = inspector.GetShape(geometry)
    match shape:
        case Sphere():
            radius = np.array([shape.radius()])
            return Balls(np.zeros((1, 3)), radius, radius)
        case Capsule():
            return _cover_capsule(shape.radius(), shape.length(), overshoot / 2)
        case Box():
            return _cover_box(np.asarray(shape.size()) / 2, overshoot, given)
        case Cylinder():
            return _cover_cylinder(shape.radius(), shape.length() / 2, overshoot, given)
        case Convex() | Mesh():
            hull = inspector.GetConvexHull(geometry)
            points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
            return _cover_hull(points, overshoot, given)
    raise InvalidInputError(
        f"collision geometry {inspector.GetName(geometry)!r} of the robot is a"
        f" {type(shape).__name__}; supported are boxes, capsules, cylinders, spheres and convex"
        " meshes"
    )


def _cover_capsule(radius: float, length: float, overshoot: float) -> Balls:
    """A row along z; half way between two centres the larger balls meet on the capsule's side."""
    step = 2.0 * np.sqrt((radius + overshoot) ** 2 - radius**2)
    count = int(np.ceil(length / step)) + 1
    z = np.linspace(-length / 2, length / 2, count)
    outer = np.hypot(radius, (z[1] - z[0]) / 2)
    return Balls(np.column_stack([0 * z, 0 * z, z]), np.full(count, outer), np.full(count, radius))


def _affordable(cells: Callable[[float], Array], overshoot: float) -> tuple[Array, float]:
    """(3,) numbers of cells along a shape, and the overshoot that goes with them [m]."""
    while np.prod(count := cells(overshoot)) > MOST_CELLS:
        overshoot *= COARSER
    return count.astype(int), overshoot


def _cover_box(half: Array, overshoot: float, given: Balls) -> Balls:
    count, overshoot = _affordable(lambda s: np.ceil(2.0 * half / (CELL * s)), overshoot)
    ticks = [np.linspace(-h, h, 2 * n + 1) for h, n in zip(half, count, strict=True)]
    lattice = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    centers = _middles_and_inner_corners(lattice)
    depth = (half - np.abs(centers)).min(axis=1)
    return _chosen(centers, depth, lattice[::2, ::2, ::2], overshoot, given)


def _cover_cylinder(radius: float, half_length: float, overshoot: float, given: Balls) -> Balls:
    """Cells are sectors, whose outer corners lie outside, on a polygon about the circle."""
    sides = np.array([2.0 * np.pi * radius, radius, 2.0 * half_length])
    least = np.array([8, 1, 1])  # sectors, rings, layers
    (sectors, rings, layers), overshoot = _affordable(
        lambda s: np.maximum(least, np.ceil(sides / (CELL * s))), overshoot
    )
    angle = np.pi * np.arange(2 * sectors + 1) / sectors
    rho = radius / np.cos(np.pi / sectors) * np.linspace(0.0, 1.0, 2 * rings + 1)
    z = np.linspace(-half_length, half_length, 2 * layers + 1)
    r, a, h = np.meshgrid(rho, angle, z, indexing="ij")
    lattice = np.stack([r * np.cos(a), r * np.sin(a), h], axis=-1)
    centers = _middles_and_inner_corners(lattice)
    axial = half_length - np.abs(centers[:, 2])
    depth = np.minimum(radius - np.hypot(centers[:, 0], centers[:, 1]), axial)
    return _chosen(centers, depth, lattice[::2, ::2, ::2], overshoot, given)


def _cover_hull(points: Array, overshoot: float, given: Balls) -> Balls:
    """The box around it, in whose directions a hull that is a box lies exactly."""
    polytope = Polytope.from_points(points)
    X = np.eye(4)
    if (box := polytope.as_box()) is not None:
        X, half = box
    else:
        X[:3, 3], half = polytope.bounds
    balls = _cover_box(half, overshoot, given.moved(inverse(X))).moved(X)
    depth = (polytope.offsets - balls.center @ polytope.normals.T).min(axis=1)
    return Balls(balls.center, balls.outer, np.minimum(balls.inner, depth))


def _middles_and_inner_corners(lattice: Array) -> Array:
    """(C, 3) of a lattice (2a+1, 2b+1, 2c+1, 3) that halves the cells."""
    middles, corners = lattice[1::2, 1::2, 1::2], lattice[2:-1:2, 2:-1:2, 2:-1:2]
    return np.concatenate([middles.reshape(-1, 3), corners.reshape(-1, 3)])


def _chosen(centers: Array, depth: Array, nodes: Array, overshoot: float, given: Balls) -> Balls:
    """A greedy set cover of cells by balls.

    Args:
        centers: (C, 3) of the balls to choose from [m]; the cells' middles first.
        depth: (C,) of the centres in the shape [m].
        nodes: (a, b, c, 3) corners of the cells [m].
        overshoot: the balls' radii are their depths plus this [m].
        given: balls that are there already.
    """
    cells = _corners(nodes)
    depth = np.minimum(depth, DEEPEST)
    outer = depth + overshoot
    reach = np.linalg.norm(cells - centers[: cells.shape[1]], axis=-1).max(axis=0)
    outer[: len(reach)] = np.maximum(outer[: len(reach)], reach + ROUNDING)
    left = ~_covered(nodes, given.center, given.outer).any(axis=0)
    covers = _covered(nodes, centers, outer)[:, left]
    picked = []
    count = covers.sum(axis=1)
    while covers.shape[1]:
        best = int(count.argmax())
        picked.append(best)
        new = covers[best]
        count = count - covers[:, new].sum(axis=1)
        covers = covers[:, ~new]
    return Balls(centers[picked], outer[picked], depth[picked])


def _corners(nodes: Array) -> Array:
    """(8, cells, 3) corners of the cells between nodes (a, b, c, 3)."""
    ends = (slice(None, -1), slice(1, None))
    corners = [nodes[i, j, k] for i in ends for j in ends for k in ends]
    return np.stack([corner.reshape(-1, 3) for corner in corners])


def _covered(nodes: Array, centers: Array, radii: Array) -> NDArray[np.bool_]:
    """(C, cells) whether balls cover cells."""
    flat = nodes.reshape(-1, 3)
    square = (centers**2).sum(axis=1)[:, None] + (flat**2).sum(axis=1) - 2.0 * centers @ flat.T
    covers = (square <= ((radii - ROUNDING / 2) ** 2)[:, None]).reshape(-1, *nodes.shape[:3])
    for axis in (1, 2, 3):
        covers = np.moveaxis(covers, axis, 0)
        covers = np.moveaxis(covers[:-1] & covers[1:], 0, axis)
    return covers.reshape(len(centers), np.prod(covers.shape[1:]))
