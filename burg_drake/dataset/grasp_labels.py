"""Grasps as training labels: oriented rectangles in the image, or values of voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.cameras import NEAR_DISTANCE, Intrinsics
from burg_drake.core import (
    UNTRIED_OUTCOMES,
    Array,
    Booleans,
    Indices,
    InvalidInputError,
    Outcome,
    Single,
    check_pose,
    inverse,
    quaternion_from_rotation,
    swap_fingers,
)
from burg_drake.dataset.camera_rays import camera_rays
from burg_drake.dataset.sample import LabelledGrasps
from burg_drake.dataset.tsdf import VGN_VOLUME_SIZE, VGN_VOXELS, voxel_size_and_truncation

MAX_APPROACH_ANGLE = float(np.arccos(0.99))
"""Largest angle between approach and optical axis in radians, as in graspnetAPI: 8.1 degrees."""


@dataclass(frozen=True, eq=False)
class GraspRectangles:
    """K oriented grasp rectangles in an image.

    Attributes:
        grasp: (K,) indices of the grasps.
        center: (K, 2) u, v of the origin of G [pixels].
        angle: (K,) angle of the closing direction, from the u axis towards v, in (-pi/2, pi/2]
            [rad]; the same after swapping the fingers.
        opening: (K,) extent along the closing direction [pixels].
        height: (K,) extent of the jaws across the closing direction [pixels].
        depth: (K,) depth of the origin of G along the optical axis [m].
    """

    grasp: Indices
    center: Array
    angle: Array
    opening: Array
    height: Array
    depth: Array

    def __len__(self) -> int:
        return len(self.grasp)

    @property
    def corners(self) -> Array:
        """(K, 4, 2) u, v of the corners in order around the rectangle; the first and the third side
        lie along the closing direction [pixels]."""
        along = np.stack([np.cos(self.angle), np.sin(self.angle)], axis=-1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
        a, b = 0.5 * self.opening[:, None] * along, 0.5 * self.height[:, None] * across
        return np.asarray(self.center[:, None] + np.stack([-a - b, a - b, a + b, b - a], axis=1))


def grasp_rectangles(
    grasps: LabelledGrasps,
    intrinsics: Intrinsics,
    *,
    opening: float | None = None,
    jaw: float = 0.02,
    most_angle: float = MAX_APPROACH_ANGLE,
) -> GraspRectangles:
    """Rectangles of the grasps that approach roughly along the optical axis.

    Opening and angle are those of the line between the projected centres of the pads; the height is
    the distance between the projected middles of the jaws' ends. With square pixels and an approach
    along the optical axis, the rectangle is the image of the pads. Otherwise it deviates, depending
    on the angle and on the ratio of the focal lengths.

    Args:
        grasps: grasps in the camera's frame.
        intrinsics: intrinsics of the camera, with the lens distortion of its images.
        opening: distance between the pads [m]; each grasp's own width if None.
        jaw: size of the jaws along y of G [m].
        most_angle: largest angle between approach and optical axis [rad].

    Returns:
        Rectangles of the grasps within the angle whose centres are in the image.

    Raises:
        InvalidInputError: a length or the angle is not positive, the angle is not below 90 degrees,
            or no opening is given and the width of a grasp in view is unknown.
    """
    for name, value in (("opening", opening), ("jaw", jaw), ("most_angle", most_angle)):
        if value is not None and not 0.0 < value < np.inf:
            raise InvalidInputError(f"{name} of rectangles is {value:g}; give more than 0")
    if most_angle >= np.pi / 2:
        raise InvalidInputError(
            f"most_angle of rectangles is {most_angle:g} rad; give less than pi / 2"
        )
    chosen = np.flatnonzero(_are_in_view(grasps.X_CG, intrinsics, most_angle))
    X_CG = grasps.X_CG[chosen]
    width = grasps.width[chosen] if opening is None else np.full(len(chosen), opening)
    if np.isnan(width).any():
        first = int(chosen[np.isnan(width)][0])
        raise InvalidInputError(
            f"the width of grasp {first} is unknown; give the opening of its rectangle"
        )
    p, closing, across = X_CG[:, :3, 3], X_CG[:, :3, 0], X_CG[:, :3, 1]
    along = _image_span(intrinsics, p, 0.5 * width[:, None] * closing)
    return GraspRectangles(
        grasp=chosen,
        center=intrinsics.project(p),
        angle=_wrap_line_angle(np.arctan2(along[:, 1], along[:, 0])),
        opening=np.linalg.norm(along, axis=1),
        height=np.linalg.norm(_image_span(intrinsics, p, 0.5 * jaw * across), axis=1),
        depth=p[:, 2].copy(),
    )


def _are_in_view(X_CG: Array, intrinsics: Intrinsics, most_angle: float) -> Booleans:
    """(N,) whether the approach is within the angle, and the origin of G in the image."""
    p = X_CG[:, :3, 3]
    chosen: Booleans = (X_CG[:, 2, 2] >= np.cos(most_angle)) & (p[:, 2] >= NEAR_DISTANCE)
    if not intrinsics.is_pinhole:  # a lens model can map points far outside into the image
        chosen &= camera_rays(intrinsics).sees(p)
    pixel = intrinsics.project(p[chosen])
    size = np.array((intrinsics.width, intrinsics.height))
    chosen[chosen] = ((pixel >= -0.5) & (pixel < size - 0.5)).all(axis=1)
    return chosen


def _image_span(intrinsics: Intrinsics, p_CQ: Array, half: Array) -> Array:
    """(K, 2) image vectors from `p_CQ - half` to `p_CQ + half`."""
    return np.asarray(intrinsics.project(p_CQ + half) - intrinsics.project(p_CQ - half))


def _wrap_line_angle(angle: Array) -> Array:
    """Wraps the angles of undirected lines into (-pi/2, pi/2]."""
    return np.asarray(np.pi / 2 - (np.pi / 2 - angle) % np.pi)


@dataclass(frozen=True, eq=False)
class VoxelTargets:
    """Training targets of voxels, from grasps that were tried.

    Attributes:
        quality: (n, n, n) success rate of the grasps in the voxel; nan if none was tried.
        rotation: (n, n, n, 4) quaternion wxyz of the voxel's first successful grasp; nan if none.
        width: (n, n, n) width of the first successful grasp in voxels.
    """

    quality: Single
    rotation: Single
    width: Single


@dataclass(frozen=True, eq=False)
class GraspVolume:
    """K grasps with their voxels.

    Attributes:
        grasp: (K,) indices of the grasps that have a label.
        voxel: (K, 3) indices of the voxels with the origins of G.
        rotation: (K, 2, 4) unit quaternions wxyz of G in the frame V of the volume, and of the same
            grasp with fingers swapped.
        width: (K,) distance between the pads in voxels; nan if unknown.
        success: (K,) whether the grasp held: `Outcome.held`, also if another object was moved
            (`lifted_disturbed`), or it turned or slid beyond the limits (`lifted_turned`).
        untried: (L,) indices of the grasps whose outcome leaves success unknown.
        outside: (M,) indices of grasps with known success whose centres are outside the volume.
        voxels: number of voxels along each edge of the volume.
    """

    grasp: Indices
    voxel: Indices
    rotation: Array
    width: Array
    success: Booleans
    untried: Indices
    outside: Indices
    voxels: int

    def __len__(self) -> int:
        return len(self.grasp)

    def targets(self) -> VoxelTargets:
        """Targets of all voxels, for losses over whole volumes; merges grasps in the same voxel."""
        cube = (self.voxels,) * 3
        flat = np.ravel_multi_index(tuple(self.voxel.T), cube)
        tried = np.bincount(flat, minlength=self.voxels**3)
        held = np.bincount(flat, weights=self.success, minlength=self.voxels**3)
        quality = np.divide(held, tried, out=np.full(len(tried), np.nan), where=tried > 0)
        rotation = np.full((len(tried), 4), np.nan, np.float32)
        width = np.full(len(tried), np.nan, np.float32)
        voxel, first = np.unique(flat[self.success], return_index=True)
        row = np.flatnonzero(self.success)[first]
        rotation[voxel] = self.rotation[row, 0]
        width[voxel] = self.width[row]
        return VoxelTargets(
            quality.reshape(cube).astype(np.float32),
            rotation.reshape(*cube, 4),
            width.reshape(cube),
        )


def volume_grasps(
    grasps: LabelledGrasps, X_CV: Array, *, size: float = VGN_VOLUME_SIZE, voxels: int = VGN_VOXELS
) -> GraspVolume:
    """Assigns grasps to the voxels of a volume.

    A grasp succeeds if its outcome is `Outcome.held`, so also if it disturbed other objects or the
    object turned in the hand. It fails with every other conclusive outcome, also if the arm cannot
    reach it; for labels of the hand alone, judge without an arm.

    Args:
        grasps: grasps in any frame C.
        X_CV: (4, 4) pose of the volume's lower corner in C, `inverse(X_SC) @ X_SV`. Grasps from
            `label_grasps(..., X_SV)` are in V already: pass the identity.
        size: edge of the volume [m].
        voxels: number of voxels along each edge.

    Returns:
        All grasps, in one of three groups: with a label, untried, outside.

    Raises:
        InvalidInputError: a number is out of range, or `X_CV` is no pose.
    """
    voxel, _ = voxel_size_and_truncation(size, voxels, None)
    X_VG = inverse(check_pose(X_CV, "X_CV")) @ grasps.X_CG
    index = np.floor(X_VG[:, :3, 3] / voxel).astype(np.intp)
    inside = ((index >= 0) & (index < voxels)).all(axis=1)
    ended = ~np.isin(grasps.outcome, (*UNTRIED_OUTCOMES, Outcome.SIMULATION_FAILED.value))
    row = np.flatnonzero(ended & inside)
    R_VG = np.stack([X_VG[row], swap_fingers(X_VG[row])], axis=1)[..., :3, :3]
    return GraspVolume(
        grasp=row,
        voxel=index[row],
        rotation=quaternion_from_rotation(R_VG),
        width=grasps.width[row] / voxel,
        success=np.array([Outcome(text).held for text in grasps.outcome[row].tolist()], bool),
        untried=np.flatnonzero(~ended),
        outside=np.flatnonzero(ended & ~inside),
        voxels=voxels,
    )
