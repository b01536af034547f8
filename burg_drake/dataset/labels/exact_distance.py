"""Truncated signed distances of a scene's true surfaces: labels for completion, and what fused ones
are compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from burg_drake.core import Array, Booleans, Indices, check_pose, inverse, transform_points
from burg_drake.dataset.labels.tsdf import SIZE, VOXELS, Tsdf, grid_lengths, voxel_centers
from burg_drake.dataset.rendering import instance_numbers
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station

if TYPE_CHECKING:
    import trimesh

EDGE = 0.01
"""Faces are cut until their edges are no longer than this [m], or all faces around a point would be
candidates for the nearest one."""
MOST_EDGES = 100
"""Along the diagonal of an object: faces of large ones are not cut that small."""
MOST_CUTS = 20
"""Of an edge into halves, more than it takes."""
FIRST = 4
"""Faces that give a first bound of a distance."""
TINY = 1e-300
"""In place of the length of a normal of a face without area [m^2]."""
POINTS = 4096
"""Whose candidates are looked up at a time."""
INSIDE_TEST_DIRECTIONS = ((0.36, 0.48, 0.80), (-0.64, 0.60, 0.48), (0.48, -0.80, -0.36))
"""Directions of rays that ask whether a point is inside. They lie along no face of usual objects;
most of them decide, as a ray may pass through an edge between two faces."""


def exact_tsdf(
    scene: SceneLike,
    X_SV: Array,
    *,
    table: bool = True,
    station: StationLike | None = None,
    size: float = SIZE,
    voxels: int = VOXELS,
    truncation: float | None = None,
) -> Tsdf:
    """Signed distances to the nearest surface of a scene.

    Surfaces are those of all instances, background included, and of a station's obstacles: all that
    depth images show but for the arm and distractors.

    Args:
        scene: has the instances at their places.
        X_SV: (4, 4) lower corner of the cube in the scene frame.
        table: whether all below the board, z < 0 of S, is filled, beyond the table's edges, too.
        station: whose obstacles there are; none if None.
        size, voxels, truncation: as for `fuse_tsdf`.

    Returns:
        The smallest of the signed distances of the bodies: where they overlap, one inside of both
        is that of the deeper one. All weights are 1, as all is known.

    Raises:
        InvalidInputError: a number does not make sense, or `X_SV` is no pose.
        UnknownNameError: a mesh file is missing, or there is no such station.
        MeshError: a mesh file is damaged.
    """
    scene = as_scene(scene)
    voxel, truncation = grid_lengths(size, voxels, truncation)
    p_SQ = transform_points(check_pose(X_SV, "X_SV"), voxel_centers(voxels, voxel))
    distance = p_SQ[:, 2].copy() if table else np.full(len(p_SQ), np.inf)
    for name in instance_numbers(scene):
        mesh = scene.library.surface(scene.instance(name).object)
        p_OQ = transform_points(inverse(scene.X_SO(name)), p_SQ)
        distance = np.minimum(distance, mesh_distance(mesh, p_OQ, truncation))
    for corner, X_SB in () if station is None else _obstacles(as_station(station)):
        p_BQ = transform_points(inverse(X_SB), p_SQ)
        distance = np.minimum(distance, box_distance(corner, p_BQ))
    cut = np.clip(distance, -truncation, truncation).astype(np.float32)
    cube = (voxels, voxels, voxels)
    weight = np.ones(cube, np.float32)
    return Tsdf(np.array(X_SV, dtype=float), voxel, truncation, cut.reshape(cube), weight)


def box_distance(corner: Array, points: Array) -> Array:
    """(N,) signed distances of points (N, 3) from the box between a corner (3,) and its negative,
    below 0 inside [m]."""
    beyond = np.abs(points) - corner
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    distance: Array = outside + np.minimum(beyond.max(axis=1), 0.0)
    return distance


def _obstacles(station: Station) -> list[tuple[Array, Array]]:
    """Half the extents (3,) of each, and poses (4, 4) in the scene frame."""
    X_SW = inverse(station.document.X_WS.matrix())
    boxes = station.document.background.values()
    return [(np.array(box.size) / 2, X_SW @ box.X_WB.matrix()) for box in boxes]


def mesh_distance(mesh: trimesh.Trimesh, points: Array, reach: float) -> Array:
    """Signed distances of points from a surface, below 0 inside.

    Args:
        mesh: closed, wound outward; of an open one the sign is that of the side which is seen by
            most of `INSIDE_TEST_DIRECTIONS`.
        points: (N, 3) in its frame [m].
        reach: distances above are this, and those below its negative are that [m].

    Returns:
        (N,) [m].
    """
    lower, upper = np.asarray(mesh.bounds)
    distance = np.full(len(points), float(reach))
    near = np.flatnonzero(((points > lower - reach) & (points < upper + reach)).all(axis=1))
    if not len(near):
        return distance
    distance[near] = np.minimum(_Faces.of(mesh).distance(points[near], reach), reach)
    within = near[((points[near] > lower) & (points[near] < upper)).all(axis=1)]
    if len(within):
        distance[within[_inside(mesh, points[within])]] *= -1.0
    return distance


@dataclass(frozen=True, eq=False)
class _Faces:
    """The faces of a surface, cut into small ones.

    Attributes:
        triangles: (T, 3, 3) their corners.
        middle: (T, 3) middles.
        radius: (T,) of the disks about the middles that they lie in.
        normal: (T, 3) unit normals; 0 without area.
        tree: of the middles.
    """

    triangles: Array
    middle: Array
    radius: Array
    normal: Array
    tree: Any

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> _Faces:
        """Cuts the faces of a mesh."""
        from scipy.spatial import cKDTree
        from trimesh.remesh import subdivide_to_size

        edge = max(EDGE, float(np.linalg.norm(mesh.extents)) / MOST_EDGES)
        vertices, faces = subdivide_to_size(mesh.vertices, mesh.faces, edge, max_iter=MOST_CUTS)
        triangles = np.asarray(vertices)[np.asarray(faces)]
        middle = triangles.mean(axis=1)
        radius = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), TINY)
        return cls(triangles, middle, radius, normal, cKDTree(middle))

    def distance(self, points: Array, reach: float) -> Array:
        """(N,) distances of points (N, 3) to the nearest face [m]; above `reach` something above
        it.

        Those to the faces of the nearest middles are a bound; all faces are measured whose disks
        are nearer.
        """
        largest = float(self.radius.max())
        bound, first = self.tree.query(points, k=[*range(1, 1 + min(FIRST, len(self.middle)))])
        distance: Array = bound[:, 0].copy()
        close = np.flatnonzero(distance <= reach + largest)
        self._measure(distance, points, np.repeat(close, first.shape[1]), first[close].reshape(-1))
        close = close[distance[close] > 0.0]
        for start in range(0, len(close), POINTS):
            some = close[start : start + POINTS]
            radius = np.minimum(distance[some], reach) + largest
            around = self.tree.query_ball_point(points[some], radius)
            point = np.repeat(some, [len(faces) for faces in around])
            face = np.concatenate([np.asarray(faces, np.intp) for faces in around])
            nearer = self._bound(points[point], face) < distance[point]
            self._measure(distance, points, point[nearer], face[nearer])
        return distance

    def _bound(self, points: Array, face: Indices) -> Array:
        """(M,) distances of points (M, 3) to the disk of one face each [m]."""
        offset = points - self.middle[face]
        height = np.einsum("ij,ij->i", offset, self.normal[face])
        along = np.einsum("ij,ij->i", offset, offset) - height**2
        beside = np.maximum(np.sqrt(np.maximum(along, 0.0)) - self.radius[face], 0.0)
        bound: Array = np.hypot(height, beside)
        return bound

    def _measure(self, distance: Array, points: Array, point: Indices, face: Indices) -> None:
        """Lowers distances of points (N,) to those of some points to one face each."""
        np.minimum.at(distance, point, _to_triangles(points[point], self.triangles[face]))


def _to_triangles(points: Array, triangles: Array) -> Array:
    """(M,) distances of points (M, 3) to one triangle (M, 3, 3) each [m].

    It is that to the plane where the point is above the triangle, else that to the nearest edge.
    (`trimesh.triangles.closest_point` is off by up to 0.1 mm at small triangles.)
    """
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1)
    above = length > 0.0
    nearest = np.full(len(points), np.inf)
    for k in range(3):
        edge, offset = triangles[:, k - 2] - triangles[:, k], points - triangles[:, k]
        above &= np.einsum("ij,ij->i", np.cross(edge, offset), normal) >= 0.0
        square = np.maximum(np.einsum("ij,ij->i", edge, edge), TINY)
        share = np.clip(np.einsum("ij,ij->i", offset, edge) / square, 0.0, 1.0)
        apart = offset - share[:, None] * edge
        nearest = np.minimum(nearest, np.einsum("ij,ij->i", apart, apart))
    offset = points - triangles[:, 0]
    height = np.abs(np.einsum("ij,ij->i", offset, normal)) / np.maximum(length, TINY)
    distance: Array = np.where(above, height, np.sqrt(nearest))
    return distance


def _inside(mesh: trimesh.Trimesh, points: Array) -> Booleans:
    """(N,) whether most rays meet a face from behind first."""
    from burg_drake.geometry import RayCaster

    faces = np.asarray(mesh.faces, np.int64)
    corners = np.asarray(mesh.vertices)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rays = RayCaster(np.asarray(mesh.vertices, float), faces)
    votes = np.zeros(len(points), int)
    for look in np.array(INSIDE_TEST_DIRECTIONS):
        look = look / np.linalg.norm(look)
        face, _ = rays.first_hits(points, np.broadcast_to(look, points.shape))
        votes += (face >= 0) & (normals[face] @ look > 0.0)
    return np.asarray(2 * votes > len(INSIDE_TEST_DIRECTIONS))
