"""Fit of convex pieces, a primitive or another mesh to the object's surface.

Also measures how deep the surfaces of two objects overlap.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from burg_drake.core import Array, MeshError
from burg_drake.geometry import RayCaster, triangle_distances
from burg_drake.objects.closed_surfaces import from_manifold
from burg_drake.objects.library import Decomposition, Fit
from burg_drake.objects.symmetry import sample_surface, spread_samples

FIT_SAMPLES = 8000
"""Points on each surface whose distance to the other is measured, beside the vertices."""


UNION_GROWTH = 1e-6
"""Metres by which parts grow before their union, to close slits from rounding."""


RAY_DIRECTIONS = np.array(
    [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0.6, 0.64, 0.48)]
)
"""(7, 3) unit vectors of rays that leave a surface; the last passes beside aligned edges."""


def measure_fit(surface: trimesh.Trimesh, parts: Sequence[trimesh.Trimesh], volume: float) -> Fit:
    """Measures the fit of convex parts to a surface.

    Args:
        surface: surface of the object [m].
        parts: convex closed meshes, wound outward; they may touch and overlap.
        volume: volume inside the surface [m^3].

    Raises:
        MeshError: a part is not closed.
    """
    union = union_mesh(parts)
    surface_to_union = _max_distance(_sample_points(surface)[0], union)
    points, normals = _sample_points(union)
    union_to_surface = _max_distance(
        points[_reachable_from_outside(points, normals, parts)], surface
    )
    return Fit(
        volume_ratio=float(union.volume / volume), hausdorff=max(surface_to_union, union_to_surface)
    )


def relative_deviation(fit: Fit | None, surface: trimesh.Trimesh | float) -> float:
    """Coarseness of convex pieces. Above 1, grasps are evaluated on a shape unlike the object's.

    Args:
        fit: fit of the pieces; None (the surface is not closed) gives 0.
        surface: surface of the object, or the diagonal of its bounding box [m].
    """
    max_volume_ratio = 1.25  # Volume of the pieces over that of the surface.
    max_hausdorff_share = 0.05  # Hausdorff distance over the object's diagonal.
    if fit is None:
        return 0.0
    diagonal = surface if isinstance(surface, float) else float(np.linalg.norm(surface.extents))
    return max(
        fit.volume_ratio / max_volume_ratio, fit.hausdorff / (max_hausdorff_share * diagonal)
    )


def deviation_warning(fit: Fit | None, diagonal: float, threshold: float | None) -> str:
    """Warning about coarse convex pieces; empty if they fit well.

    Args:
        fit: fit of the pieces, if known.
        diagonal: diagonal of the object [m].
        threshold: concavity threshold of the decomposition; None for pieces that came with the
            object.
    """
    if fit is None or relative_deviation(fit, diagonal) <= 1.0:
        return ""
    mend = "give finer convex pieces of your own (pieces in an objects.yaml) if that matters"
    if threshold is not None and threshold > Decomposition().threshold:
        mend = "lower decomposition.threshold for finer pieces"
    return f"the convex pieces do not fit well: {describe_fit(fit)}; {mend}"


def describe_fit(fit: Fit) -> str:
    """The fit in words."""
    return f"{fit.volume_ratio:.2f} times the volume, up to {1e3 * fit.hausdorff:.1f} mm off"


def union_mesh(parts: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """The boundary of the union of closed parts.

    Raises:
        MeshError: there are no parts, or one is not a closed manifold.
    """
    if not parts:
        raise MeshError("there are no parts to take the union of; give at least one")
    solids = []
    for i, part in enumerate(parts):
        grown = np.asarray(part.vertices) + UNION_GROWTH * np.asarray(part.vertex_normals)
        solid = Manifold(Mesh64(np.ascontiguousarray(grown), part.faces.astype(np.uint64)))
        if solid.status() != Error.NoError:
            raise MeshError(f"part {i} is not a closed surface ({solid.status().name})")
        solids.append(solid)
    return from_manifold(Manifold.batch_boolean(solids, OpType.Add))


def surface_distance(
    one: trimesh.Trimesh, other: trimesh.Trimesh, stop_above: float = np.inf
) -> float:
    """Symmetric Hausdorff distance of two surfaces [m], from vertices and dense samples.

    If it exceeds `stop_above`, the search stops at any distance above `stop_above`.
    """
    points = _sample_points(other)[0]
    largest = _max_distance(points[:: max(1, len(points) // FIT_SAMPLES)], one, stop_above)
    for some, surface in ((points, one), (_sample_points(one)[0], other)):
        if largest <= stop_above:
            largest = max(largest, _max_distance(some, surface, stop_above))
    return largest


def surface_overlap(one: trimesh.Trimesh, other: trimesh.Trimesh, floor: float) -> float:
    """Penetration depth of two surfaces: depth of the deepest point of one inside the other [m].

    It is a lower bound of the translation that separates them. Points are sampled on the faces and
    edges of both, at most 2 mm apart.

    Args:
        one, other: surfaces in one frame, wound outward. Nothing is inside a surface that is not
            closed.
        floor: smaller depths are not measured [m].

    Returns:
        The depth; 0 if it is not above the floor.
    """
    return max(_depth_inside(one, other, floor), _depth_inside(other, one, floor))


def _depth_inside(surface: trimesh.Trimesh, solid: trimesh.Trimesh, floor: float) -> float:
    """Depth of the deepest point of a surface inside a closed one [m], 0 if not above the floor."""
    if not solid.is_watertight:
        return 0.0
    low, high = solid.bounds
    points = _points_in_box(surface, np.array([low + floor, high - floor]))
    if not len(points):
        return 0.0
    rays, normals = RayCaster(np.asarray(solid.vertices), solid.faces), solid.face_normals
    for direction in RAY_DIRECTIONS:
        face, distance = rays.first_hits(points, np.broadcast_to(direction, points.shape))
        leaves = (face >= 0) & (normals[face] @ direction > 0.0)
        points = points[leaves & (distance > floor)]
    depth = _max_distance(points, solid) if len(points) else 0.0
    return depth if depth > floor else 0.0


def _points_in_box(surface: trimesh.Trimesh, box: Array) -> Array:
    """Points (N, 3) of a surface within a box (2, 3): vertices and edge midpoints of triangles that
    are halved until no edge is longer than 2 mm."""
    max_spacing = 2e-3  # Metres between neighbouring points of the surface.
    found = [np.asarray(surface.vertices)]
    triangles = np.asarray(surface.triangles)
    while len(triangles):
        meets = (triangles.max(axis=1) > box[0]) & (triangles.min(axis=1) < box[1])
        triangles = triangles[meets.all(axis=1)]
        edges = np.roll(triangles, -1, axis=1) - triangles
        squared = np.einsum("fij,fij->fi", edges, edges)
        large = squared.max(axis=1) > max_spacing**2
        triangles, longest = triangles[large], squared[large].argmax(axis=1)
        rows = np.arange(len(triangles))
        a, b, c = (triangles[rows, (longest + i) % 3] for i in range(3))
        middle = (a + b) / 2.0
        found.append(middle)
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    points = np.concatenate(found)
    return np.asarray(points[((points > box[0]) & (points < box[1])).all(axis=1)])


def _sample_points(surface: trimesh.Trimesh) -> tuple[Array, Array]:
    """Vertices and samples (N, 3) of a surface, and their normals."""
    points, normals = sample_surface(surface, FIT_SAMPLES)
    used = np.unique(surface.faces)
    return (
        np.vstack([surface.vertices[used], points]),
        np.vstack([surface.vertex_normals[used], normals]),
    )


def _reachable_from_outside(
    points: Array, normals: Array, parts: Sequence[trimesh.Trimesh]
) -> NDArray[np.bool_]:
    """Whether a ball that touches the union from outside at points (N, 3) is clear of all parts."""
    ball_radius = 1e-3  # Metres; a ball enters no gap that reduced parts leave between them.
    centers = points + ball_radius * normals
    clear = np.ones(len(points), dtype=bool)
    owners = np.zeros(len(points), dtype=int)
    for part in parts:
        lower, upper = part.bounds
        near = ((centers > lower - 2 * ball_radius) & (centers < upper + 2 * ball_radius)).all(
            axis=1
        )
        near = np.flatnonzero(clear & near)
        planes = np.asarray(part.face_normals)
        offset = (planes * part.triangles[:, 0]).sum(axis=1)
        own = (points[near] @ planes.T - offset).max(axis=1) <= 10.0 * UNION_GROWTH
        # above a corner of its own part the ball's centre is lower than its radius over the
        # faces, but a point on two parts may be where a gap between them ends
        lenient = own & (owners[near] == 0)
        owners[near] += own
        height = (centers[near] @ planes.T - offset).max(axis=1)
        clear[near] = height > np.where(lenient, 0.0, ball_radius - 10.0 * UNION_GROWTH)
    return clear


def _max_distance(points: Array, surface: trimesh.Trimesh, stop_above: float = np.inf) -> float:
    """Largest distance of points (N, 3) to a surface [m].

    The distance to the nearest sample bounds the distance to the surface from above; the distance
    to the triangles of the nearest samples is a tighter bound, mostly exact. Points are measured in
    the order of these bounds, until the bounds are below the largest distance found, or this is
    above `stop_above`.
    """
    candidates = 12  # Samples around a point whose triangles are measured exactly.
    resolution = 1e-7  # Metres below which distances are equal.
    batch_size = 256  # Points measured exactly at a time, the most distant first.
    samples, faces = _dense_samples(surface)
    tree = cKDTree(samples)
    bound, _ = tree.query(points)
    order = np.argsort(-bound, kind="stable")
    triangles = np.asarray(surface.triangles)
    middle = triangles.mean(axis=1)
    reach = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
    largest = 0.0
    for start in range(0, len(order), batch_size):
        some = points[order[start : start + batch_size]]
        if bound[order[start]] <= largest + resolution or largest > stop_above:
            break
        _, near = tree.query(some, k=min(candidates, len(samples)))
        nearer = triangle_distances(some[:, None], triangles[faces[near]]).min(axis=1)
        for i in np.argsort(-nearer, kind="stable"):
            if nearer[i] <= largest + resolution or largest > stop_above:
                break
            possible = np.linalg.norm(middle - some[i], axis=1) - reach <= nearer[i] + 1e-12
            exact = triangle_distances(some[i][None], triangles[possible])
            largest = max(largest, float(exact.min()))
    return largest


def _dense_samples(surface: trimesh.Trimesh) -> tuple[Array, Array]:
    """Samples (T, 3) over a surface, including each triangle's centre, and their faces (T,)."""
    sample_count = 20000  # Points by which the triangles near a point are found.
    points, face = spread_samples(surface, sample_count)
    middle = np.asarray(surface.triangles).mean(axis=1)
    return np.vstack([points, middle]), np.concatenate([face, np.arange(len(middle))])
