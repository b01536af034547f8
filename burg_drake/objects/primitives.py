"""Boxes, cylinders and spheres fitted to objects, and the corners of their convex hulls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, Pose, cross_matrix, inverse, make_pose, transform_points
from burg_drake.geometry import convex_hull
from burg_drake.objects.library import Fit, ObjectEntry, ObjectLibrary, Primitive
from burg_drake.objects.shape_fit import surface_distance

MAX_STEPS = 12  # Linear programmes for one primitive.
MAX_TURN = 0.15  # Radians in one step.
SEARCH_DIRECTIONS = 600  # Directions whose extreme corners the search uses.


def fit_primitive(surface: trimesh.Trimesh, volume: float) -> tuple[Primitive, Fit] | None:
    """Fits a primitive to a surface.

    Args:
        surface: surface of the object [m].
        volume: volume inside the surface [m^3].

    Returns:
        The primitive with the smallest Hausdorff distance, and its fit; None if none is near
        enough.
    """
    max_distance = 1.5e-3  # Metres, Hausdorff.
    # Hausdorff distance over the object's diagonal; the smaller limit holds.
    max_diagonal_share = 0.02
    limit = min(max_distance, max_diagonal_share * float(np.linalg.norm(surface.extents)))
    best = nearest_primitive(surface, volume)
    return best if best is not None and best[1].hausdorff <= limit else None


def nearest_primitive(surface: trimesh.Trimesh, volume: float) -> tuple[Primitive, Fit] | None:
    """As `fit_primitive`, without a limit on the distance; None if all volumes differ too much."""
    volume_ratios = (0.97, 1.06)  # Volume of the primitive over that of the object.
    max_start_ratio = 1.5  # Volume over the object's, above which turning does not help.
    hull = convex_hull(np.asarray(surface.vertices))
    if hull.volume > volume_ratios[1] * volume:
        return None
    points = hull.points[hull.vertices]
    best: tuple[Primitive, Fit] | None = None
    for primitive in _enclosing_primitives(surface, points, max_start_ratio * volume):
        ratio = primitive_volume(primitive) / volume
        if not volume_ratios[0] <= ratio <= volume_ratios[1]:
            continue
        distance = surface_distance(surface, primitive_mesh(primitive))
        if best is None or distance < best[1].hausdorff:
            best = primitive, Fit(volume_ratio=float(ratio), hausdorff=distance)
    return best


def primitive_volume(primitive: Primitive) -> float:
    """Volume of a primitive [m^3]."""
    if primitive.shape == "sphere":
        return float(4.0 / 3.0 * np.pi * primitive.size[0] ** 3)
    if primitive.shape == "cylinder":
        return float(np.pi * primitive.size[0] ** 2 * primitive.size[1])
    return float(np.prod(primitive.size))


def primitive_mesh(primitive: Primitive, segments: int = 96) -> trimesh.Trimesh:
    """A primitive's surface in the object frame; vertices of round primitives lie on it."""
    if primitive.shape == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=4, radius=primitive.size[0])
    elif primitive.shape == "cylinder":
        radius, length = primitive.size
        mesh = trimesh.creation.cylinder(radius, length, sections=segments)
    else:
        mesh = trimesh.creation.box(primitive.size)
    mesh.apply_transform(primitive.X_OP.matrix())
    return mesh


def _enclosing_primitives(
    surface: trimesh.Trimesh, points: Array, max_volume: float
) -> Iterator[Primitive]:
    """The smallest enclosing primitives of points, from initial ones of volume up to `max_volume`
    [m^3]."""
    corners = points
    if len(points) > SEARCH_DIRECTIONS:
        corners = points[np.unique((points @ _even_directions(SEARCH_DIRECTIONS).T).argmax(axis=0))]
    yield _enclosing_sphere(corners, points)
    axes = _face_normal_axes(surface)
    if np.prod(np.ptp(points @ axes, axis=0)) <= max_volume:
        yield _enclosing_box(corners, points, axes)
    for column in range(3):
        R_OP = np.roll(axes, 2 - column, axis=1)
        extent = np.ptp(points @ R_OP, axis=0)
        if np.pi / 4.0 * extent[:2].max() ** 2 * extent[2] <= max_volume:
            yield _enclosing_cylinder(corners, points, R_OP)


def _face_normal_axes(surface: trimesh.Trimesh) -> Array:
    """(3, 3) orthonormal axes as columns: the most common direction of the face normals, then the
    most common one perpendicular to it."""
    normals = np.asarray(surface.face_normals)
    area = np.asarray(surface.area_faces)
    first = _most_common_direction(normals, area)
    across = normals - np.outer(normals @ first, first)
    length = np.linalg.norm(across, axis=1)
    side = length > 0.5
    if not side.any():
        side = length > 0.0
    second = _most_common_direction(across[side] / length[side, None], area[side])
    second -= (second @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _most_common_direction(directions: Array, weight: Array) -> Array:
    """Mean of the densest cluster, by weight, of unit vectors (N, 3) up to sign."""
    max_candidates = 200  # Largest faces whose normals are compared.
    min_cosine = np.cos(np.deg2rad(5.0))  # Normals within 5 degrees belong to one face of a box.
    some = directions[np.argsort(-weight, kind="stable")[:max_candidates]]
    near = np.abs(some @ directions.T) > min_cosine
    chosen = some[(near @ weight).argmax()]
    along = directions @ chosen
    member = np.abs(along) > min_cosine
    mean = (np.sign(along[member]) * weight[member]) @ directions[member]
    return mean / np.linalg.norm(mean)


def _even_directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly: a Fibonacci lattice."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def _enclosing_sphere(corners: Array, points: Array) -> Primitive:
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    for _ in range(MAX_STEPS):
        offsets = corners - center
        radius = np.linalg.norm(offsets, axis=1)
        step = radius.max()
        # minimise r, with |p| - u . c <= r
        rows = np.hstack([-offsets / radius[:, None], -np.ones((len(corners), 1))])
        moved = _solve_linear_program([0, 0, 0, 1], rows, -radius, [step] * 3)
        center = center + moved[:3]
        if np.linalg.norm(moved[:3]) < 1e-9:
            break
    size = float(np.linalg.norm(points - center, axis=1).max())
    return Primitive(shape="sphere", size=(size,), X_OP=Pose(_as_triple(center)))


def _enclosing_box(corners: Array, points: Array, R_OP: Array) -> Primitive:
    for _ in range(MAX_STEPS):
        p = corners @ R_OP
        extent = np.maximum(np.ptp(p, axis=0), 1e-9)
        # in axes rotated by w, p moves by p x w; columns: w, upper and lower bounds
        turned = cross_matrix(p)
        rows, limits = [], []
        for k in range(3):
            upper, lower = np.zeros((len(p), 6)), np.zeros((len(p), 6))
            upper[:, k], lower[:, 3 + k] = -1.0, 1.0
            rows += [np.hstack([turned[:, k], upper]), np.hstack([-turned[:, k], lower])]
            limits += [-p[:, k], p[:, k]]
        cost = np.concatenate([np.zeros(3), 1.0 / extent, -1.0 / extent])
        w = _solve_linear_program(cost, np.vstack(rows), np.concatenate(limits), [MAX_TURN] * 3)[:3]
        R_new = R_OP @ Rotation.from_rotvec(w).as_matrix()
        shrunk = np.prod(np.ptp(corners @ R_new, axis=0)) / np.prod(extent)
        if shrunk >= 1.0 - 1e-12:
            break
        R_OP = R_new
    p = points @ R_OP
    lower, upper = p.min(axis=0), p.max(axis=0)
    X_OP = make_pose(R_OP, R_OP @ ((lower + upper) / 2))
    return Primitive(
        shape="box", size=_as_triple(upper - lower), X_OP=Pose.from_matrix(X_OP, quaternion=True)
    )


def _enclosing_cylinder(corners: Array, points: Array, R_OP: Array) -> Primitive:
    """The enclosing cylinder found from an initial axis along the last column of `R_OP`."""
    p = corners @ R_OP
    X_OP = make_pose(R_OP, R_OP @ ((p.min(axis=0) + p.max(axis=0)) / 2))
    X_best, best = X_OP, np.inf
    for _ in range(MAX_STEPS):
        p = transform_points(inverse(X_OP), corners)
        volume = float(np.hypot(p[:, 0], p[:, 1]).max() ** 2 * np.ptp(p[:, 2]))
        if volume >= best * (1.0 - 1e-12):
            break
        X_best, best = X_OP, volume
        X_OP = X_OP @ _shrinking_motion(p)
    p = transform_points(inverse(X_best), points)
    lower, upper = float(p[:, 2].min()), float(p[:, 2].max())
    X_OP = X_best @ make_pose(p_AB=(0.0, 0.0, (lower + upper) / 2))
    return Primitive(
        shape="cylinder",
        size=(float(np.hypot(p[:, 0], p[:, 1]).max()), upper - lower),
        X_OP=Pose.from_matrix(X_OP, quaternion=True),
    )


def _shrinking_motion(p: Array) -> Array:
    """The motion (4, 4) that shrinks an enclosing cylinder of points (N, 3) about z."""
    n = len(p)
    radius = np.maximum(np.hypot(p[:, 0], p[:, 1]), 1e-12)
    size, height = float(radius.max()), float(np.ptp(p[:, 2]))
    u = np.column_stack([p[:, :2] / radius[:, None], np.zeros(n)])
    turned = cross_matrix(p)[..., :2]
    # columns: rotation about x and y, shift along x and y, radius, upper, lower
    radial = np.einsum("nk,nkj->nj", u, turned)
    rows = np.zeros((3 * n, 7))
    rows[:n] = np.hstack([radial, -u[:, :2], np.tile([-1.0, 0.0, 0.0], (n, 1))])
    rows[n : 2 * n] = np.hstack([turned[:, 2], np.tile([0.0, 0, 0, -1, 0], (n, 1))])
    rows[2 * n :] = np.hstack([-turned[:, 2], np.tile([0.0, 0, 0, 0, 1], (n, 1))])
    limits = np.concatenate([-radius, -p[:, 2], p[:, 2]])
    cost = np.array([0, 0, 0, 0, 2.0 / size, 1.0 / height, -1.0 / height])
    x = _solve_linear_program(cost, rows, limits, [MAX_TURN, MAX_TURN, size, size])
    return make_pose(Rotation.from_rotvec([x[0], x[1], 0.0]).as_matrix(), (x[2], x[3], 0.0))


def _solve_linear_program(
    cost: Array | list[int], rows: Array, limits: Array, bounds: list[float]
) -> Array:
    """Solution of min cost . x with rows x <= limits; the first variables are within +-bounds."""
    free: list[tuple[float | None, float | None]] = [(None, None)] * (len(cost) - len(bounds))
    result = linprog(
        cost, A_ub=rows, b_ub=limits, bounds=[(-b, b) for b in bounds] + free, method="highs"
    )
    return result.x if result.success else np.zeros(len(cost))


def _as_triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


_CACHED_CORNERS: dict[tuple[tuple[Path, int], ...], Array] = {}
"""Corners by files and their modification times."""


def support_corners(library: ObjectLibrary, entry: ObjectEntry) -> Array:
    """(N, 3) hull corners of an object's primitive, or else of its pieces, in O [m]. Its stable
    poses, feet and fall in simulation follow from them.

    Raises:
        UnknownNameError: a file of the library is missing.
        MeshError: a file of the library is damaged.
    """
    if entry.contact.primitive is not None:
        return np.asarray(primitive_mesh(entry.contact.primitive).vertices)
    return _read_hull_corners(library, entry.pieces)


def hull_corners(library: ObjectLibrary, entry: ObjectEntry) -> Array:
    """(N, 3) corners of the hull of an object's whole contact geometry, in O [m].

    Raises:
        UnknownNameError: a file of the library is missing.
        MeshError: a file of the library is damaged.
    """
    if entry.contact.primitive is not None:
        return np.asarray(primitive_mesh(entry.contact.primitive).vertices)
    own = [entry.contact.mesh] if entry.contact.mesh else []
    return _read_hull_corners(library, [*entry.pieces, *own])


def _read_hull_corners(library: ObjectLibrary, files: Sequence[str]) -> Array:
    max_objects = 1000  # Objects whose corners are kept in memory.
    key = tuple((path, path.stat().st_mtime_ns) for path in map(library.path, files))
    if key not in _CACHED_CORNERS:
        points = np.vstack([library.mesh(file).vertices for file in files])
        _CACHED_CORNERS[key] = points[convex_hull(points).vertices]
    corners = _CACHED_CORNERS[key]
    while len(_CACHED_CORNERS) > max_objects:
        del _CACHED_CORNERS[next(iter(_CACHED_CORNERS))]
    return corners
