"""Truncated signed distances on a grid, fused from depth images, as VGN and its heirs train on.

VGN (Breyer, Chung, Ott, Siegwart and Nieto, "Volumetric grasping network", CoRL 2020) has a cube of
0.3 m with 40 voxels along each edge and a truncation of 4 voxels (`TSDFVolume` in
src/vgn/perception.py of github.com/ethz-asl/vgn), and fuses images with Open3D's
`UniformTSDFVolume`. From the source of that:

- A voxel's centre is half a voxel from its lower corner.
- Its depth is compared with that of the nearest pixel; the difference is taken along the ray. What
  is farther behind a surface than the truncation is not seen, what is farther before it counts as
  the truncation.
- The voxel has the mean over all images that see it, each with weight 1 (Curless and Levoy, "A
  volumetric method for building complex models from range images", SIGGRAPH 1996).
- The grid that the network gets has (d + 1) / 2 for a mean d in truncations, in [-0.98, 0.98), and
  0 everywhere else: where nothing was seen, and in free space.

Distances along rays are longer than those to the surface, by one over the cosine of the angle
between ray and normal. Near a surface, where they change sign, both agree; `exact_tsdf` has the
others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.cameras.optics import NEAR, Intrinsics
from burg_drake.core import (
    Array,
    Indices,
    InvalidInputError,
    Single,
    check_pose,
    inverse,
    transform_points,
)
from burg_drake.dataset.labels.clouds import checked_depth, field_of_view

SIZE = 0.3
"""Edge of VGN's cube [m]."""
VOXELS = 40
"""Along each edge of VGN's cube."""
TRUNCATION = 4.0
"""VGN's, in voxels."""
SEEN = 0.98
"""Share of the truncation from which on Open3D leaves voxels out of the grid."""
MOST_VOXELS = 512
"""Along an edge; arrays of more do not fit into the memory of usual machines."""


@dataclass(frozen=True, eq=False)
class Tsdf:
    """Truncated signed distances in the voxels of a cube.

    Attributes:
        X_SV: (4, 4) frame of the cube in the scene frame: the origin is its lower corner, x, y and
            z lie along the first, second and third index.
        voxel: edge of a voxel [m]; the centre of voxel (i, j, k) is at ((i, j, k) + 0.5) voxel.
        truncation: distances are cut off at plus and minus this [m].
        distance: (n, n, n) signed distances, above 0 outside [m]; nan where nothing is known.
        weight: (n, n, n) number of images that the distance is a mean of, 0 where it is nan.
    """

    X_SV: Array
    voxel: float
    truncation: float
    distance: Single
    weight: Single

    @property
    def values(self) -> Single:
        """(n, n, n) what VGN's network gets: from 0.01 inside over 0.5 at a surface to 0.99; 0 in
        free space, and where nothing is known."""
        share = self.distance / np.float32(self.truncation)
        near = (share >= -SEEN) & (share < SEEN)  # nan is neither
        values: Single = np.where(near, 0.5 * (share + 1.0), 0.0).astype(np.float32)
        return values


def fuse_tsdf(
    depths: Sequence[ArrayLike] | ArrayLike,
    intrinsics: Intrinsics | Sequence[Intrinsics],
    X_SC: ArrayLike,
    X_SV: Array,
    *,
    size: float = SIZE,
    voxels: int = VOXELS,
    truncation: float | None = None,
) -> Tsdf:
    """Fuses depth images; see the module.

    Args:
        depths: K images (H, W) [m]; 0 where there is none.
        intrinsics: of the camera, or K of them; with lens distortion if they have some.
        X_SC: (K, 4, 4) camera's optical frames in the scene frame.
        X_SV: (4, 4) lower corner of the cube in the scene frame.
        size: its edge [m].
        voxels: along each edge.
        truncation: [m]; `TRUNCATION` voxels if None.

    Raises:
        InvalidInputError: there is no image, images, poses and intrinsics are not as many or do
            not fit, or a number does not make sense.
    """
    images = list(np.asarray(depths) if isinstance(depths, np.ndarray) else depths)  # type: ignore[arg-type]
    poses = check_pose(X_SC, "X_SC").reshape(-1, 4, 4)
    cameras = [intrinsics] * len(images) if isinstance(intrinsics, Intrinsics) else [*intrinsics]
    if not images or not len(images) == len(poses) == len(cameras):
        raise InvalidInputError(
            f"{len(images)} depth images, {len(poses)} poses and {len(cameras)} intrinsics are"
            " given; give the same number of each, at least one"
        )
    voxel, truncation = grid_lengths(size, voxels, truncation)
    p_SQ = transform_points(check_pose(X_SV, "X_SV"), voxel_centers(voxels, voxel))
    total, count = np.zeros(len(p_SQ)), np.zeros(len(p_SQ))
    for k, (image, camera, X_SK) in enumerate(zip(images, cameras, poses, strict=True)):
        depth = checked_depth(image, camera, f"depth image {k}")
        seen, along = _ahead_of_surface(depth, camera, transform_points(inverse(X_SK), p_SQ))
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


def grid_lengths(size: float, voxels: int, truncation: float | None) -> tuple[float, float]:
    """Edge of a voxel and truncation [m].

    Raises:
        InvalidInputError: a number does not make sense.
    """
    if not 0.0 < size < np.inf:
        raise InvalidInputError(f"the size of a volume is {size:g} m; give more than 0")
    if not 1 <= voxels <= MOST_VOXELS:
        raise InvalidInputError(f"a volume has {voxels} voxels per edge; give 1 to {MOST_VOXELS}")
    voxel = size / voxels
    if truncation is None:
        return voxel, TRUNCATION * voxel
    if not 0.0 < truncation < np.inf:
        raise InvalidInputError(f"truncation of a volume is {truncation:g} m; give more than 0")
    return voxel, truncation


def voxel_centers(voxels: int, voxel: float) -> Array:
    """(n^3, 3) centres of the voxels in V [m], the last index first."""
    axis = (np.arange(voxels) + 0.5) * voxel
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def _ahead_of_surface(depth: Single, camera: Intrinsics, p_CQ: Array) -> tuple[Indices, Array]:
    """How far points lie before the surface that their pixels show.

    Args:
        depth: (H, W) [m].
        camera: that took it.
        p_CQ: (N, 3) points in its frame [m].

    Returns:
        (M,) points whose pixels show something, and (M,) distances along the ray [m].
    """
    if camera.is_pinhole:
        seen = np.flatnonzero(p_CQ[:, 2] >= NEAR)
    else:  # far outside, a lens model leads back into the image
        seen = np.flatnonzero(field_of_view(camera).sees(p_CQ))
    column, row = np.rint(camera.project(p_CQ[seen])).T
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    seen = seen[inside]
    shown = depth[row[inside].astype(np.intp), column[inside].astype(np.intp)].astype(float)
    there = (shown > 0.0) & (shown < np.inf)
    seen, shown = seen[there], shown[there]
    z = p_CQ[seen, 2]
    return seen, (shown - z) * np.linalg.norm(p_CQ[seen], axis=1) / z
