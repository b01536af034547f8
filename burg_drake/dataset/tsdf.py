"""Truncated signed distances on a grid, fused from depth images or computed from the true surfaces.

VGN and its successors train on fused distances. Exact ones are labels for shape completion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.cameras import NEAR_DISTANCE, Intrinsics
from burg_drake.core import (
    Array,
    Booleans,
    Indices,
    InvalidInputError,
    Single,
    check_pose,
    inverse,
    transform_points,
)
from burg_drake.dataset.camera_rays import camera_rays
from burg_drake.dataset.point_clouds import checked_depth
from burg_drake.dataset.sample import instance_numbers
from burg_drake.geometry import RayCaster, triangle_distances
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station

if TYPE_CHECKING:
    import trimesh

VGN_VOLUME_SIZE = 0.3
"""Edge of VGN's cube in metres."""
VGN_VOXELS = 40
"""Voxels along each edge of VGN's cube."""


@dataclass(frozen=True, eq=False)
class Tsdf:
    """Truncated signed distances in the voxels of a cube.

    Attributes:
        X_SV: (4, 4) frame of the cube in the scene frame: the origin is its lower corner, x, y and
            z lie along the first, second and third index.
        voxel: edge of a voxel [m]; the centre of voxel (i, j, k) is at ((i, j, k) + 0.5) voxel.
        truncation: distances are clipped to plus and minus this value [m].
        distance: (n, n, n) signed distances, positive outside [m]; nan in unobserved voxels.
        weight: (n, n, n) number of images averaged in the distance, 0 where it is nan.
    """

    X_SV: Array
    voxel: float
    truncation: float
    distance: Single
    weight: Single

    @property
    def values(self) -> Single:
        """(n, n, n) input of VGN's network: from 0.01 inside through 0.5 at a surface to 0.99; 0 in
        free space and in unobserved voxels."""
        share = self.distance / np.float32(self.truncation)
        near = (share >= -0.98) & (share < 0.98)  # as in Open3D; nan is neither
        return np.asarray(np.where(near, 0.5 * (share + 1.0), 0.0).astype(np.float32))


def fuse_tsdf(
    depths: Sequence[ArrayLike] | ArrayLike,
    intrinsics: Intrinsics | Sequence[Intrinsics],
    X_SC: ArrayLike,
    X_SV: Array,
    *,
    size: float = VGN_VOLUME_SIZE,
    voxels: int = VGN_VOXELS,
    truncation: float | None = None,
) -> Tsdf:
    """Fuses depth images into a grid of truncated signed distances.

    Args:
        depths: K depth images (H, W) [m]; 0 for no measurement.
        intrinsics: intrinsics of the camera, or of each image (K). Lens distortion is modelled.
        X_SC: (K, 4, 4) poses of the camera's optical frame in the scene frame.
        X_SV: (4, 4) pose of the cube's lower corner in the scene frame.
        size: edge of the cube [m].
        voxels: number of voxels along each edge.
        truncation: truncation distance [m]; 4 voxels if None.

    Raises:
        InvalidInputError: there is no image, the numbers or sizes of images, poses and intrinsics
            differ, or a number is out of range.
    """
    images = list(np.asarray(depths) if isinstance(depths, np.ndarray) else depths)  # type: ignore[arg-type]
    poses = check_pose(X_SC, "X_SC").reshape(-1, 4, 4)
    cameras = [intrinsics] * len(images) if isinstance(intrinsics, Intrinsics) else [*intrinsics]
    if not images or not len(images) == len(poses) == len(cameras):
        raise InvalidInputError(
            f"{len(images)} depth images, {len(poses)} poses and {len(cameras)} intrinsics are"
            " given; give the same number of each, at least one"
        )
    voxel, truncation = voxel_size_and_truncation(size, voxels, truncation)
    p_SQ = transform_points(check_pose(X_SV, "X_SV"), voxel_centers(voxels, voxel))
    total, count = np.zeros(len(p_SQ)), np.zeros(len(p_SQ))
    for k, (image, camera, X_SK) in enumerate(zip(images, cameras, poses, strict=True)):
        depth = checked_depth(image, camera, f"depth image {k}")
        seen, along = _distances_before_surface(
            depth, camera, transform_points(inverse(X_SK), p_SQ)
        )
        kept = along > -truncation
        total[seen[kept]] += np.minimum(along[kept], truncation)
        count[seen[kept]] += 1.0
    distance = np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0.0)
    cube = (voxels, voxels, voxels)
    return Tsdf(
        np.array(X_SV, dtype=float),
        voxel,
        truncation,
        distance.reshape(cube).astype(np.float32),
        count.reshape(cube).astype(np.float32),
    )


def voxel_size_and_truncation(
    size: float, voxels: int, truncation: float | None
) -> tuple[float, float]:
    """Edge of a voxel and truncation distance [m].

    Raises:
        InvalidInputError: a number is out of range.
    """
    max_voxels = 512  # Along an edge; larger grids do not fit into usual memory.
    if not 0.0 < size < np.inf:
        raise InvalidInputError(f"the size of a volume is {size:g} m; give more than 0")
    if not 1 <= voxels <= max_voxels:
        raise InvalidInputError(f"a volume has {voxels} voxels per edge; give 1 to {max_voxels}")
    voxel = size / voxels
    if truncation is None:
        return voxel, 4.0 * voxel  # as in VGN
    if not 0.0 < truncation < np.inf:
        raise InvalidInputError(f"truncation of a volume is {truncation:g} m; give more than 0")
    return voxel, truncation


def voxel_centers(voxels: int, voxel: float) -> Array:
    """(n^3, 3) centres of the voxels in V [m]; the last index varies fastest."""
    axis = (np.arange(voxels) + 0.5) * voxel
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def _distances_before_surface(
    depth: Single, camera: Intrinsics, p_CQ: Array
) -> tuple[Indices, Array]:
    """Distances of points in front of the surface in a depth image.

    Args:
        depth: (H, W) depth image [m].
        camera: intrinsics of its camera.
        p_CQ: (N, 3) points in the camera's frame [m].

    Returns:
        (M,) indices of points whose pixels have a depth, and (M,) distances along the ray [m].
    """
    if camera.is_pinhole:
        seen = np.flatnonzero(p_CQ[:, 2] >= NEAR_DISTANCE)
    else:  # far outside, a lens model leads back into the image
        seen = np.flatnonzero(camera_rays(camera).sees(p_CQ))
    column, row = np.rint(camera.project(p_CQ[seen])).T
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    seen = seen[inside]
    surface_depth = depth[row[inside].astype(np.intp), column[inside].astype(np.intp)].astype(float)
    measured = (surface_depth > 0.0) & (surface_depth < np.inf)
    seen, surface_depth = seen[measured], surface_depth[measured]
    z = p_CQ[seen, 2]
    return seen, (surface_depth - z) * np.linalg.norm(p_CQ[seen], axis=1) / z


def exact_tsdf(
    scene: SceneLike,
    X_SV: Array,
    *,
    table: bool = True,
    station: StationLike | None = None,
    size: float = VGN_VOLUME_SIZE,
    voxels: int = VGN_VOXELS,
    truncation: float | None = None,
) -> Tsdf:
    """Signed distances to the nearest surface of a scene.

    Surfaces are those of all instances, background included, and of a station's obstacles: all that
    depth images show, except the arm and distractors.

    Args:
        scene: the scene with its placed instances.
        X_SV: (4, 4) pose of the cube's lower corner in the scene frame.
        table: whether the half space below the board (z < 0 in S) is solid.
        station: station whose obstacles to include; no obstacles if None.
        size, voxels, truncation: as for `fuse_tsdf`.

    Returns:
        The minimum of the bodies' signed distances; in an overlap that of the deeper body. All
        weights are 1.

    Raises:
        InvalidInputError: a number is out of range, or `X_SV` is no pose.
        UnknownNameError: a mesh file is missing, or there is no such station.
        MeshError: a mesh file is damaged.
    """
    scene = as_scene(scene)
    voxel, truncation = voxel_size_and_truncation(size, voxels, truncation)
    p_SQ = transform_points(check_pose(X_SV, "X_SV"), voxel_centers(voxels, voxel))
    distance = p_SQ[:, 2].copy() if table else np.full(len(p_SQ), np.inf)
    for name in instance_numbers(scene):
        mesh = scene.library.surface(scene.instance(name).object)
        p_OQ = transform_points(inverse(scene.X_SO(name)), p_SQ)
        distance = np.minimum(distance, mesh_distance(mesh, p_OQ, truncation))
    for corner, X_SB in () if station is None else _station_boxes(as_station(station)):
        p_BQ = transform_points(inverse(X_SB), p_SQ)
        distance = np.minimum(distance, box_distance(corner, p_BQ))
    cut = np.clip(distance, -truncation, truncation).astype(np.float32)
    cube = (voxels, voxels, voxels)
    weight = np.ones(cube, np.float32)
    return Tsdf(np.array(X_SV, dtype=float), voxel, truncation, cut.reshape(cube), weight)


def box_distance(corner: Array, points: Array) -> Array:
    """(N,) signed distances of points (N, 3) from the box between a corner (3,) and its negative,
    negative inside [m]."""
    beyond = np.abs(points) - corner
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))


def _station_boxes(station: Station) -> list[tuple[Array, Array]]:
    """Half extents (3,) and poses (4, 4) in the scene frame of a station's obstacles."""
    X_SW = inverse(station.document.X_WS.matrix())
    boxes = station.document.background.values()
    return [(np.array(box.size) / 2, X_SW @ box.X_WB.matrix()) for box in boxes]


def mesh_distance(mesh: trimesh.Trimesh, points: Array, reach: float) -> Array:
    """Signed distances of points from a surface, negative inside.

    Args:
        mesh: closed, with outward faces. For an open mesh, a majority vote of three rays decides
            the sign.
        points: (N, 3) points in the frame of the mesh [m].
        reach: distances are clipped to plus and minus this value [m].

    Returns:
        (N,) [m].
    """
    lower, upper = np.asarray(mesh.bounds)
    distance = np.full(len(points), float(reach))
    near = np.flatnonzero(((points > lower - reach) & (points < upper + reach)).all(axis=1))
    if not len(near):
        return distance
    distance[near] = np.minimum(_FaceIndex(mesh).distance(points[near], reach), reach)
    within = near[((points[near] > lower) & (points[near] < upper)).all(axis=1)]
    if len(within):
        distance[within[_are_inside(mesh, points[within])]] *= -1.0
    return distance


class _FaceIndex:
    """Spatial index of a surface's faces, subdivided into small triangles.

    Attributes:
        triangles: (T, 3, 3) corners of the triangles.
        middle: (T, 3) centroids.
        radius: (T,) radii of the disks around the centroids that contain the triangles.
        normal: (T, 3) unit normals; 0 for a triangle without area.
        tree: k-d tree of the centroids.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        from scipy.spatial import cKDTree
        from trimesh.remesh import subdivide_to_size

        # Shorter edges leave fewer candidates for the nearest face. Large objects get longer edges.
        edge = max(0.01, float(np.linalg.norm(mesh.extents)) / 100)
        vertices, faces = subdivide_to_size(mesh.vertices, mesh.faces, edge, max_iter=20)
        triangles = self.triangles = np.asarray(vertices)[np.asarray(faces)]
        middle = self.middle = triangles.mean(axis=1)
        self.radius = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        self.normal, self.tree = normal, cKDTree(middle)

    def distance(self, points: Array, reach: float) -> Array:
        """(N,) distances of points (N, 3) to the nearest face [m]; beyond `reach` only an upper
        bound.

        Faces with the nearest centroids give a first bound. Then the distance to every face whose
        disk is nearer than the bound is computed.
        """
        batch_points = 4096  # Points whose candidate faces are looked up at a time.
        largest = float(self.radius.max())
        nearest = [*range(1, 1 + min(4, len(self.middle)))]  # faces for the first bound
        bound, first = self.tree.query(points, k=nearest)
        distance: Array = bound[:, 0].copy()
        close = np.flatnonzero(distance <= reach + largest)
        first_points = np.repeat(close, first.shape[1])
        self._lower_distances(distance, points, first_points, first[close].reshape(-1))
        close = close[distance[close] > 0.0]
        for start in range(0, len(close), batch_points):
            batch = close[start : start + batch_points]
            radius = np.minimum(distance[batch], reach) + largest
            candidates = self.tree.query_ball_point(points[batch], radius)
            point = np.repeat(batch, [len(faces) for faces in candidates])
            face = np.concatenate([np.asarray(faces, np.intp) for faces in candidates])
            nearer = self._disk_distances(points[point], face) < distance[point]
            self._lower_distances(distance, points, point[nearer], face[nearer])
        return distance

    def _disk_distances(self, points: Array, face: Indices) -> Array:
        """(M,) distances of points (M, 3) from the disk of one face each [m]."""
        offset = points - self.middle[face]
        height = np.einsum("ij,ij->i", offset, self.normal[face])
        along = np.einsum("ij,ij->i", offset, offset) - height**2
        beside = np.maximum(np.sqrt(np.maximum(along, 0.0)) - self.radius[face], 0.0)
        return np.asarray(np.hypot(height, beside))

    def _lower_distances(
        self, distance: Array, points: Array, point: Indices, face: Indices
    ) -> None:
        """Lowers `distance` (N,) where the face `face[i]` is nearer to the point `point[i]`."""
        np.minimum.at(distance, point, triangle_distances(points[point], self.triangles[face]))


def _are_inside(mesh: trimesh.Trimesh, points: Array) -> Booleans:
    """(N,) whether most rays from a point hit a face from behind first."""
    # Not parallel to faces of usual objects.
    ray_directions = ((0.36, 0.48, 0.80), (-0.64, 0.60, 0.48), (0.48, -0.80, -0.36))
    faces = np.asarray(mesh.faces, np.int64)
    corners = np.asarray(mesh.vertices)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rays = RayCaster(np.asarray(mesh.vertices, float), faces)
    votes = np.zeros(len(points), int)
    for direction in np.array(ray_directions):
        direction = direction / np.linalg.norm(direction)
        face, _ = rays.first_hits(points, np.broadcast_to(direction, points.shape))
        votes += (face >= 0) & (normals[face] @ direction > 0.0)
    return np.asarray(2 * votes > len(ray_directions))
