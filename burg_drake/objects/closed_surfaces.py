"""Closed surfaces: union of overlapping bodies, and reduction of the number of faces."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator

import manifold3d
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from burg_drake.core import Array
from burg_drake.geometry import triangle_distances
from burg_drake.objects.mesh_repair import connected_bodies, encloses, signed_volume

Point = tuple[float, float, float]
Quadric = list[float]
"""Sum over planes n.x + d = 0 of xx, xy, xz, yy, yz, zz, xd, yd, zd, dd, and their number."""


def collapse_edges(
    vertices: Array, faces: NDArray[np.int64], max_distance: float, min_faces: int, ratio: float
) -> Iterator[tuple[Array, NDArray[np.int64]]]:
    """Yields ever coarser surfaces, made by edge collapses.

    Args:
        vertices: (N, 3) vertices [m].
        faces: (F, 3) triangles of a closed manifold.
        max_distance: largest root mean square distance of a vertex from the planes of the faces
            that were merged into it [m].
        min_faces: smallest number of faces.
        ratio: number of faces of a surface over that of the previous one.

    Yields:
        Vertices and faces, of the same topology.
    """
    surface = _CollapsingSurface(vertices, faces, max_distance)
    wanted = ratio * len(faces)
    while surface.count > min_faces and surface.collapse():
        if surface.count <= wanted:
            wanted = ratio * surface.count
            yield surface.arrays()


class _CollapsingSurface:
    """A surface whose edges are collapsed one after another."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64], max_distance: float) -> None:
        self.max_distance = max_distance
        self.points: list[Point] = [tuple(p) for p in vertices.tolist()]
        self.faces: list[tuple[int, int, int] | None] = [tuple(f) for f in faces.tolist()]
        self.count = len(faces)
        self.around: list[set[int]] = [set() for _ in self.points]
        for k, face in enumerate(faces.tolist()):
            for i in face:
                self.around[i].add(k)
        self.quadrics: list[Quadric] = _vertex_quadrics(vertices, faces).tolist()
        self.version = [0] * len(self.points)
        self.heap: list[tuple[float, int, int, int, int, Point]] = []
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        for i, j in np.unique(edges, axis=0).tolist():
            self._queue_edge(i, j)

    def collapse(self) -> bool:
        """Collapses the cheapest admissible edge; False if none is within `max_distance`."""
        while self.heap:
            cost, i, j, version_i, version_j, point = heapq.heappop(self.heap)
            if (version_i, version_j) != (self.version[i], self.version[j]):
                continue
            if cost > self.max_distance**2:
                return False
            if self._can_merge(i, j, point):
                self._merge_vertices(i, j, point)
                return True
        return False

    def arrays(self) -> tuple[Array, NDArray[np.int64]]:
        """Remaining vertices and faces."""
        left = np.array([face for face in self.faces if face is not None])
        used, place = np.unique(left, return_inverse=True)
        return np.array(self.points)[used], place.reshape(-1, 3)

    def _queue_edge(self, i: int, j: int) -> None:
        q = [a + b for a, b in zip(self.quadrics[i], self.quadrics[j], strict=True)]
        point, cost = _cheapest_point(q, self.points[i], self.points[j])
        entry = (cost, i, j, self.version[i], self.version[j], point)
        heapq.heappush(self.heap, entry)

    def _neighbours(self, i: int) -> set[int]:
        found = {k for face in self.around[i] for k in self.faces[face] or ()}
        found.discard(i)
        return found

    def _can_merge(self, i: int, j: int, point: Point) -> bool:
        """Whether the collapse keeps the surface a manifold without flipped or sliver faces."""
        shared = self.around[i] & self.around[j]
        common = self._neighbours(i) & self._neighbours(j)
        if len(shared) != 2 or len(common) != 2:
            return False
        if any(len(self.around[k]) <= 3 for k in common):
            return False
        for face in self.around[i] ^ self.around[j]:
            corners = self.faces[face] or (i, i, i)
            before = [self.points[k] for k in corners]
            after = [point if k in (i, j) else self.points[k] for k in corners]
            if not _is_valid_face_change(before, after, self.max_distance):
                return False
        return True

    def _merge_vertices(self, i: int, j: int, point: Point) -> None:
        for face in self.around[i] & self.around[j]:
            for k in self.faces[face] or ():
                self.around[k].discard(face)
            self.faces[face] = None
            self.count -= 1
        for face in self.around[j]:
            a, b, c = (i if k == j else k for k in self.faces[face] or ())
            self.faces[face] = (a, b, c)
            self.around[i].add(face)
        self.around[j] = set()
        self.points[i] = point
        self.quadrics[i] = [a + b for a, b in zip(self.quadrics[i], self.quadrics[j], strict=True)]
        self.version[i] += 1
        self.version[j] += 1
        for k in sorted(self._neighbours(i)):
            self._queue_edge(min(i, k), max(i, k))


def _vertex_quadrics(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """(N, 11) quadrics of the vertices."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    n = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
    d = -(n * a).sum(axis=1)
    x, y, z = n.T
    one = np.ones(len(faces))
    planes = [x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d, one]
    rows = np.stack(planes, axis=1)
    found = np.zeros((len(vertices), 11))
    for k in range(3):
        np.add.at(found, faces[:, k], rows)
    return found


def _cheapest_point(q: Quadric, a: Point, b: Point) -> tuple[Point, float]:
    """The point near an edge with the smallest mean squared distance to a quadric's planes, and
    that distance [m^2]."""
    # Share of the trace below which the cost is flat; the point stays at the middle.
    flat_share = 1e-6
    xx, xy, xz, yy, yz, zz, xd, yd, zd, _, planes = q
    x, y, z = (a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0, (a[2] + b[2]) / 2.0
    gx = xx * x + xy * y + xz * z + xd
    gy = xy * x + yy * y + yz * z + yd
    gz = xz * x + yz * y + zz * z + zd
    slack = flat_share * (xx + yy + zz)
    sx, sy, sz = xx + slack, yy + slack, zz + slack
    cx, cy, cz = sy * sz - yz * yz, yz * xz - xy * sz, xy * yz - sy * xz
    det = sx * cx + xy * cy + xz * cz
    if det > 0.0:
        x -= (cx * gx + cy * gy + cz * gz) / det
        y -= (cy * gx + (sx * sz - xz * xz) * gy + (xy * xz - sx * yz) * gz) / det
        z -= (cz * gx + (xy * xz - sx * yz) * gy + (sx * sy - xy * xy) * gz) / det
    return (x, y, z), max(0.0, _quadric_cost(q, x, y, z)) / max(planes, 1.0)


def _quadric_cost(q: Quadric, x: float, y: float, z: float) -> float:
    xx, xy, xz, yy, yz, zz, xd, yd, zd, dd, _ = q
    return (
        x * (xx * x + 2.0 * (xy * y + xz * z + xd))
        + y * (yy * y + 2.0 * (yz * z + yd))
        + z * (zz * z + 2.0 * zd)
        + dd
    )


def _is_valid_face_change(before: list[Point], after: list[Point], max_distance: float) -> bool:
    """Whether a face turns and moves little and becomes no sliver lower than it was."""
    min_turn_cosine = 0.5  # Cosine of the largest turn of a face in one collapse.
    min_height = 2e-5  # Metres; smallest height of a face after a collapse.
    old, old_height = _face_normal_and_height(before)
    new, height = _face_normal_and_height(after)
    if height < min_height and height < old_height:
        return False
    moved = [q[k] - p[k] for p, q in zip(before, after, strict=True) if p != q for k in range(3)]
    away = old[0] * moved[0] + old[1] * moved[1] + old[2] * moved[2]
    if away * away > max_distance**2 * sum(v * v for v in old):
        return False
    turned = old[0] * new[0] + old[1] * new[1] + old[2] * new[2]
    lengths = math.sqrt(sum(v * v for v in old) * sum(v * v for v in new))
    return turned > min_turn_cosine * lengths


def _face_normal_and_height(corners: list[Point]) -> tuple[Point, float]:
    """Twice the area along a face's normal, and its height over the longest edge [m]."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    wx, wy, wz = cx - bx, cy - by, cz - bz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
    longest = max(longest, wx * wx + wy * wy + wz * wz, 1e-300)
    return (nx, ny, nz), math.sqrt((nx * nx + ny * ny + nz * nz) / longest)


DEVIATION_RESOLUTION = 1e-6
"""Metres; smaller deviations count as zero."""


def is_closed(surface: trimesh.Trimesh) -> bool:
    """Whether a surface is watertight with consistent winding."""
    return bool(len(surface.faces) and surface.is_watertight and surface.is_winding_consistent)


def unite_bodies(surface: trimesh.Trimesh) -> tuple[trimesh.Trimesh, list[str]]:
    """Unites overlapping bodies, so that their overlap counts once. Cavities, separate bodies and
    bodies that touch without a common face stay as they are.

    Args:
        surface: closed surface, wound outward, cavities inward.

    Returns:
        The surface, and a sentence if it changed.
    """
    min_overlap_share = 1e-4  # Share of the summed volumes; below it bodies only touch.
    max_bodies = 400  # Bodies that are compared for cavities and overlaps.
    groups = connected_bodies(surface)
    if not 1 < len(groups) <= max_bodies:
        return surface, []
    parts = [surface.submesh([g], append=True, repair=False) for g in groups]
    volumes = [signed_volume(p) for p in parts]
    solid = [i for i, v in enumerate(volumes) if v > 0.0]
    if not _bounding_boxes_overlap([parts[i] for i in solid]):
        return surface, []
    members = {i: [parts[i]] for i in solid}
    for i, volume in enumerate(volumes):
        hosts = [k for k in solid if volume <= 0.0 and encloses(parts[k], parts[i])]
        if hosts:
            members[min(hosts, key=lambda k: volumes[k])].append(parts[i])
    found = [_to_manifold(trimesh.util.concatenate(m)) for m in members.values()]
    manifolds = [m for m in found if m is not None]
    if len(manifolds) < len(found):
        return surface, []
    union = manifold3d.Manifold.batch_boolean(manifolds, manifold3d.OpType.Add)
    twice = 1.0 - union.volume() / sum(m.volume() for m in manifolds)
    result = from_manifold(union)
    if twice < min_overlap_share:
        glued = not is_closed(_with_merged_vertices(surface)) and is_closed(
            _with_merged_vertices(result)
        )
        return (result, [f"united {len(solid)} bodies that touch"]) if glued else (surface, [])
    if not is_closed(result):
        return surface, []
    return result, [
        f"united {len(solid)} bodies that overlap (they share {100.0 * twice:.2g} % of"
        " their volume, which now counts once)"
    ]


def split_bodies(surface: trimesh.Trimesh) -> trimesh.Trimesh | None:
    """Doubles the edges along which bodies touch, so that the surface counts as closed; None if
    that does not close it."""
    manifold = _to_manifold(surface)
    result = None if manifold is None else from_manifold(manifold)
    return result if result is not None and is_closed(result) else None


def decimate(surface: trimesh.Trimesh, max_faces: int) -> tuple[trimesh.Trimesh, list[str]]:
    """Reduces a surface to `max_faces` faces, or to as few as the largest tolerance allows.

    Args:
        surface: closed surface, wound outward.
        max_faces: surfaces with no more faces than this stay as they are.

    Returns:
        The surface, and a sentence if it changed.
    """
    # Shares of the diagonal, tried in turn: 0.02 to 0.4 mm on a mug.
    tolerances = (1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3)
    max_face_share = 0.5  # Share of the faces; more remain only on rough surfaces.
    max_points = 10_000  # Points that are measured.
    count = len(surface.faces)
    if count <= max_faces:
        return surface, []
    diagonal = float(np.linalg.norm(surface.extents))
    manifold, best = _to_manifold(surface), surface
    for tolerance in tolerances:
        if manifold is None:
            break
        manifold = manifold.simplify(tolerance * diagonal)
        merged = _with_merged_vertices(from_manifold(manifold))
        if not is_closed(merged) or signed_volume(merged) <= 0.0:
            break
        best = merged
        if len(best.faces) <= max_faces:
            break
    if len(best.faces) > max(max_faces, max_face_share * count):
        return surface, [f"kept all {count} faces, as the surface is too rough to reduce"]
    step = max(1, len(surface.vertices) // max_points)
    away = one_sided_hausdorff(surface.vertices[::step], best)
    return best, [
        f"reduced from {count} to {len(best.faces)} faces, at most "
        f"{1e3 * max(away, DEVIATION_RESOLUTION):.2g} mm off"
    ]


def coarser_surfaces(surface: trimesh.Trimesh, max_distance: float) -> list[trimesh.Trimesh]:
    """The surface and ever coarser versions of it, each made from the previous one.

    Args:
        surface: closed surface, wound outward.
        max_distance: approximate mean distance of the coarsest version from the surface [m].

    Returns:
        Closed surfaces, finest first, each with about 0.9 times the faces of the previous one.
    """
    # Metres; Manifold is fast and removes most faces before edges collapse.
    tolerances = (1e-6, 1e-5, 2e-5, 4e-5, 8e-5, 1.2e-4)
    enough_faces = 20_000  # Faces that edge collapse handles quickly.
    max_faces = 100_000  # More would take longer than 20 s.
    min_faces = 20  # Faces of the coarsest surface.
    face_ratio = 0.9  # Faces of each surface over those of the previous one.
    found, manifold = [surface], _to_manifold(surface)
    for tolerance in tolerances:
        if manifold is None or len(found[-1].faces) <= enough_faces:
            break
        manifold = manifold.simplify(tolerance)
        _append_if_closed(found, _with_merged_vertices(from_manifold(manifold)))
    finest = found[-1]
    if len(finest.faces) > max_faces:
        return found
    rungs = collapse_edges(
        np.asarray(finest.vertices), finest.faces, max_distance, min_faces, face_ratio
    )
    for vertices, faces in rungs:
        _append_if_closed(found, trimesh.Trimesh(vertices, faces, process=False))
    return found


def _append_if_closed(found: list[trimesh.Trimesh], mesh: trimesh.Trimesh) -> None:
    if is_closed(mesh) and signed_volume(mesh) > 0.0:
        found.append(mesh)


def one_sided_hausdorff(points: Array, surface: trimesh.Trimesh) -> float:
    """Largest distance of points (N, 3) from a surface [m], exact above `DEVIATION_RESOLUTION`.

    The distance to the faces of the nearest samples is an upper bound. The points are measured
    against all nearer faces, largest bound first, until the bound is below the largest distance
    found.
    """
    sample_count = 50_000  # Samples on the surface.
    candidates = 8  # Faces compared for each point.
    triangles, middles = np.asarray(surface.triangles), surface.triangles_center
    samples, face = trimesh.sample.sample_surface(surface, sample_count, seed=0)
    face = np.concatenate([face, np.arange(len(triangles))])
    _, near = cKDTree(np.vstack([samples, middles])).query(points, min(candidates, len(face)))
    bound = triangle_distances(points[:, None], triangles[face[near]]).min(axis=1)
    radius = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1)
    largest = 0.0
    for i in np.argsort(-bound):
        if bound[i] <= max(largest, DEVIATION_RESOLUTION):
            break
        possible = np.linalg.norm(middles - points[i], axis=1) - radius <= bound[i]
        exact = triangle_distances(points[i][None], triangles[possible])
        largest = max(largest, float(exact.min()))
    return largest


def _bounding_boxes_overlap(parts: list[trimesh.Trimesh]) -> bool:
    low, high = (np.array([p.bounds[i] for p in parts]) for i in (0, 1))
    for i in range(len(parts) - 1):
        if ((low[i] <= high[i + 1 :]) & (high[i] >= low[i + 1 :])).all(axis=1).any():
            return True
    return False


def _to_manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold | None:
    """Manifold solid of a mesh; None if Manifold does not accept the mesh as closed."""
    # Copies, as Manifold refuses arrays that cannot be written to, such as its own results.
    vertices = np.array(mesh.vertices, dtype=float, order="C")
    faces = np.array(mesh.faces, dtype=np.uint64, order="C")
    manifold = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces))
    sound = manifold.status() == manifold3d.Error.NoError and not manifold.is_empty()
    return manifold if sound else None


def _with_merged_vertices(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    merged.merge_vertices()
    return merged


def from_manifold(manifold: manifold3d.Manifold) -> trimesh.Trimesh:
    """Surface mesh of a Manifold solid."""
    mesh = manifold.to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    return trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], faces, process=False)
