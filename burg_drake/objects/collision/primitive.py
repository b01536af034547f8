"""Box, cylinder or sphere in place of an object that has that shape.

The primitive is the smallest one around the object, so that the object rests and is gripped where
it really is, and what the primitive has too much are rounded edges, recesses and the like. Each is
found by sequential linear programming: the corners of the hull, seen from a slightly moved and
turned primitive, are linear in that motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, inverse, make_pose, transform_points
from burg_drake.core.documents import Pose
from burg_drake.geometry import convex_hull
from burg_drake.objects.collision.fit import surface_distance
from burg_drake.objects.library import Fit, Primitive

MAX_DISTANCE = 1.5e-3
"""Largest Hausdorff distance of a primitive that is taken for an object [m]."""

MAX_SHARE = 0.02
"""The same as a share of the object's diagonal; the smaller of the two holds."""

VOLUME_RATIO = (0.97, 1.06)
"""Volumes of a primitive that is taken for an object, over that of the object."""

SHAPES: tuple[Literal["box", "cylinder", "sphere"], ...] = ("sphere", "cylinder", "box")

SEGMENTS = 96
"""Sides of the prism that stands for a cylinder when it is measured."""

STEPS = 12
"""Most linear programmes for one primitive."""

TURN = 0.15
"""Largest turn of one step [rad]."""

DIRECTIONS = 600
"""Directions whose farthest corners of the hull a primitive is laid around in the search for its
pose; its size is then that around all corners."""

TOO_FAR = 1.5
"""A box or cylinder whose volume is this many times the object's as the normals of the faces lay it
does not become the object by turning."""

CANDIDATES = 200
"""Largest faces whose normals may be the commonest."""

ALIKE = np.cos(np.deg2rad(5.0))
"""Normals within 5 degrees of each other are of one face of a box."""


def fit_primitive(surface: trimesh.Trimesh, volume: float) -> tuple[Primitive, Fit] | None:
    """The primitive that stands for a surface.

    Args:
        surface: of the object [m].
        volume: inside it [m^3].

    Returns:
        The one with the smallest Hausdorff distance, and its fit; None if none is near enough.
    """
    limit = min(MAX_DISTANCE, MAX_SHARE * float(np.linalg.norm(surface.extents)))
    best = nearest_primitive(surface, volume)
    return best if best is not None and best[1].hausdorff <= limit else None


def nearest_primitive(surface: trimesh.Trimesh, volume: float) -> tuple[Primitive, Fit] | None:
    """As `fit_primitive`, however far it is; None if the volumes of all are too different."""
    hull = convex_hull(np.asarray(surface.vertices))
    if hull.volume > VOLUME_RATIO[1] * volume:
        return None
    points = hull.points[hull.vertices]
    best: tuple[Primitive, Fit] | None = None
    for primitive in _around(surface, points, TOO_FAR * volume):
        ratio = primitive_volume(primitive) / volume
        if not VOLUME_RATIO[0] <= ratio <= VOLUME_RATIO[1]:
            continue
        distance = surface_distance(surface, primitive_mesh(primitive))
        if best is None or distance < best[1].hausdorff:
            best = primitive, Fit(volume_ratio=float(ratio), hausdorff=distance)
    return best


def primitive_volume(primitive: Primitive) -> float:
    """Volume [m^3]."""
    if primitive.shape == "sphere":
        return float(4.0 / 3.0 * np.pi * primitive.size[0] ** 3)
    if primitive.shape == "cylinder":
        return float(np.pi * primitive.size[0] ** 2 * primitive.size[1])
    return float(np.prod(primitive.size))


def primitive_mesh(primitive: Primitive, segments: int = SEGMENTS) -> trimesh.Trimesh:
    """A primitive's surface in the object frame; corners of a round one lie on it."""
    if primitive.shape == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=4, radius=primitive.size[0])
    elif primitive.shape == "cylinder":
        radius, length = primitive.size
        mesh = trimesh.creation.cylinder(radius, length, sections=segments)
    else:
        mesh = trimesh.creation.box(primitive.size)
    mesh.apply_transform(primitive.X_OP.matrix())
    return mesh


def _around(surface: trimesh.Trimesh, points: Array, most: float) -> Iterator[Primitive]:
    """The smallest primitives around points, from starts with at most that volume [m^3]."""
    corners = points
    if len(points) > DIRECTIONS:
        corners = points[np.unique((points @ _evenly(DIRECTIONS).T).argmax(axis=0))]
    yield _sphere(corners, points)
    axes = _axes(surface)
    if np.prod(np.ptp(points @ axes, axis=0)) <= most:
        yield _box(corners, points, axes)
    for column in range(3):
        R_OP = np.roll(axes, 2 - column, axis=1)
        extent = np.ptp(points @ R_OP, axis=0)
        if np.pi / 4.0 * extent[:2].max() ** 2 * extent[2] <= most:
            yield _cylinder(corners, points, R_OP)


def _axes(surface: trimesh.Trimesh) -> Array:
    """(3, 3) orthonormal axes as columns: the commonest direction of the faces' normals, then the
    commonest across it."""
    normals = np.asarray(surface.face_normals)
    area = np.asarray(surface.area_faces)
    first = _commonest(normals, area)
    across = normals - np.outer(normals @ first, first)
    length = np.linalg.norm(across, axis=1)
    side = length > 0.5
    if not side.any():
        side = length > 0.0
    second = _commonest(across[side] / length[side, None], area[side])
    second -= (second @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _commonest(directions: Array, weight: Array) -> Array:
    """Of unit vectors (N, 3), up to sign, the one that most weight is close to; then the mean."""
    some = directions[np.argsort(-weight, kind="stable")[:CANDIDATES]]
    near = np.abs(some @ directions.T) > ALIKE
    chosen = some[(near @ weight).argmax()]
    along = directions @ chosen
    member = np.abs(along) > ALIKE
    mean = (np.sign(along[member]) * weight[member]) @ directions[member]
    return mean / np.linalg.norm(mean)


def _evenly(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly: a Fibonacci lattice."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def _sphere(corners: Array, points: Array) -> Primitive:
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    for _ in range(STEPS):
        apart = corners - center
        radius = np.linalg.norm(apart, axis=1)
        step = radius.max()
        # minimise r, with |p| - u . c <= r
        rows = np.hstack([-apart / radius[:, None], -np.ones((len(corners), 1))])
        moved = _minimum([0, 0, 0, 1], rows, -radius, [step] * 3)
        center = center + moved[:3]
        if np.linalg.norm(moved[:3]) < 1e-9:
            break
    size = float(np.linalg.norm(points - center, axis=1).max())
    return Primitive(shape="sphere", size=(size,), X_OP=Pose(_triple(center)))


def _box(corners: Array, points: Array, R_OP: Array) -> Primitive:
    for _ in range(STEPS):
        p = corners @ R_OP
        extent = np.maximum(np.ptp(p, axis=0), 1e-9)
        # seen from axes turned by w, p moves by p x w: columns are w, upper and lower bounds
        turned = _cross_matrix(p)
        rows, limits = [], []
        for k in range(3):
            upper, lower = np.zeros((len(p), 6)), np.zeros((len(p), 6))
            upper[:, k], lower[:, 3 + k] = -1.0, 1.0
            rows += [np.hstack([turned[:, k], upper]), np.hstack([-turned[:, k], lower])]
            limits += [-p[:, k], p[:, k]]
        cost = np.concatenate([np.zeros(3), 1.0 / extent, -1.0 / extent])
        w = _minimum(cost, np.vstack(rows), np.concatenate(limits), [TURN] * 3)[:3]
        R_new = R_OP @ Rotation.from_rotvec(w).as_matrix()
        shrunk = np.prod(np.ptp(corners @ R_new, axis=0)) / np.prod(extent)
        if shrunk >= 1.0 - 1e-12:
            break
        R_OP = R_new
    p = points @ R_OP
    lower, upper = p.min(axis=0), p.max(axis=0)
    X_OP = make_pose(R_OP, R_OP @ ((lower + upper) / 2))
    return Primitive(
        shape="box",
        size=_triple(upper - lower),
        X_OP=Pose.from_matrix(X_OP, quaternion=True),
    )


def _cylinder(corners: Array, points: Array, R_OP: Array) -> Primitive:
    """The cylinder whose axis starts out along the last column of `R_OP`."""
    p = corners @ R_OP
    X_OP = make_pose(R_OP, R_OP @ ((p.min(axis=0) + p.max(axis=0)) / 2))
    X_best, best = X_OP, np.inf
    for _ in range(STEPS):
        p = transform_points(inverse(X_OP), corners)
        volume = float(np.hypot(p[:, 0], p[:, 1]).max() ** 2 * np.ptp(p[:, 2]))
        if volume >= best * (1.0 - 1e-12):
            break
        X_best, best = X_OP, volume
        X_OP = X_OP @ _nearer_cylinder(p)
    p = transform_points(inverse(X_best), points)
    lower, upper = float(p[:, 2].min()), float(p[:, 2].max())
    X_OP = X_best @ make_pose(p_AB=(0.0, 0.0, (lower + upper) / 2))
    return Primitive(
        shape="cylinder",
        size=(float(np.hypot(p[:, 0], p[:, 1]).max()), upper - lower),
        X_OP=Pose.from_matrix(X_OP, quaternion=True),
    )


def _nearer_cylinder(p: Array) -> Array:
    """The motion (4, 4) of a cylinder about z that makes it smaller around points (N, 3)."""
    n = len(p)
    radius = np.maximum(np.hypot(p[:, 0], p[:, 1]), 1e-12)
    size, height = float(radius.max()), float(np.ptp(p[:, 2]))
    u = np.column_stack([p[:, :2] / radius[:, None], np.zeros(n)])
    turned = _cross_matrix(p)[..., :2]
    # columns are the turn about x and y, the shift along x and y, radius, upper, lower
    radial = np.einsum("nk,nkj->nj", u, turned)
    rows = np.zeros((3 * n, 7))
    rows[:n] = np.hstack([radial, -u[:, :2], np.tile([-1.0, 0.0, 0.0], (n, 1))])
    rows[n : 2 * n] = np.hstack([turned[:, 2], np.tile([0.0, 0, 0, -1, 0], (n, 1))])
    rows[2 * n :] = np.hstack([-turned[:, 2], np.tile([0.0, 0, 0, 0, 1], (n, 1))])
    limits = np.concatenate([-radius, -p[:, 2], p[:, 2]])
    cost = np.array([0, 0, 0, 0, 2.0 / size, 1.0 / height, -1.0 / height])
    x = _minimum(cost, rows, limits, [TURN, TURN, size, size])
    return make_pose(Rotation.from_rotvec([x[0], x[1], 0.0]).as_matrix(), (x[2], x[3], 0.0))


def _minimum(cost: Array | list[int], rows: Array, limits: Array, bounds: list[float]) -> Array:
    """Solution of min cost . x with rows x <= limits; the first variables are within +-bounds."""
    free: list[tuple[float | None, float | None]] = [(None, None)] * (len(cost) - len(bounds))
    result = linprog(
        cost, A_ub=rows, b_ub=limits, bounds=[(-b, b) for b in bounds] + free, method="highs"
    )
    return result.x if result.success else np.zeros(len(cost))


def _cross_matrix(p: Array) -> Array:
    """(N, 3, 3) matrices M with M w = p x w for points p (N, 3)."""
    zero = np.zeros(len(p))
    x, y, z = p.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
