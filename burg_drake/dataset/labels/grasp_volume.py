"""Grasps as labels of voxels, as VGN and its heirs train on: quality, rotation and width.

VGN trains on single grasps: each has a label at the voxel of its centre (`Dataset` in
src/vgn/dataset.py of github.com/ethz-asl/vgn), width in voxels, and the loss of a rotation is the
smaller one of those to the grasp and to the same with fingers swapped. So does this, but for three
things that a reader of VGN's has to know. The centre is that of G, midway between the pads, where
VGN's is at the root of the fingers. Rotations are those of G, quaternions wxyz, x closing; VGN's
are xyzw, y closing. The voxel is the one that holds the centre; VGN rounds the coordinates, which
is half a voxel more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import (
    Array,
    Booleans,
    Indices,
    Single,
    check_pose,
    inverse,
    quaternion_from_rotation,
    swap_fingers,
)
from burg_drake.core.grasps import UNTRIED, Outcome
from burg_drake.dataset.labels.labelled_grasps import LabelledGrasps
from burg_drake.dataset.labels.tsdf import SIZE, VOXELS, grid_lengths

UNKNOWN_END = (*UNTRIED, Outcome.SIMULATION_FAILED.value)
"""Outcomes that do not tell whether a grasp holds."""


@dataclass(frozen=True, eq=False)
class VoxelTargets:
    """One value a voxel, where grasps were tried.

    Attributes:
        quality: (n, n, n) share of the grasps in the voxel that held; nan where none was tried.
        rotation: (n, n, n, 4) quaternion wxyz of the first of them that held; nan where none did.
        width: (n, n, n) its width in voxels.
    """

    quality: Single
    rotation: Single
    width: Single


@dataclass(frozen=True, eq=False)
class GraspVolume:
    """K grasps with their voxels.

    Attributes:
        grasp: (K,) rows of the grasps that have a label.
        voxel: (K, 3) indices of the voxels that hold the origins of G.
        rotation: (K, 2, 4) unit quaternions wxyz of G in the frame V of the volume, and of the same
            grasp with fingers swapped.
        width: (K,) distance of the pads in voxels; nan if not known.
        success: (K,) whether the grasp held: `Outcome.held`, also if another object was moved
            (`lifted_disturbed`), or it turned or slid beyond the limits (`lifted_turned`).
        untried: (L,) rows of grasps whose outcome does not tell: `UNKNOWN_END`.
        outside: (M,) rows of the others whose centre is not in the volume.
        voxels: along each edge of the volume.
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
        """One value a voxel, for losses over whole volumes; those that share one count together."""
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
    grasps: LabelledGrasps, X_CV: Array, *, size: float = SIZE, voxels: int = VOXELS
) -> GraspVolume:
    """Labels of voxels.

    A grasp succeeds if its outcome is `Outcome.held`, so also if it disturbed others or the object
    turned in the hand, and fails with every other outcome that tells, those of an arm that does not
    get there among them; for labels of the hand alone, judge without an arm.

    Args:
        grasps: in any frame C.
        X_CV: (4, 4) lower corner of the volume in C, `inverse(X_SC) @ X_SV`. Grasps from
            `label_grasps(..., X_SV)` are in V already: give the identity.
        size: edge of the volume [m].
        voxels: along each edge.

    Returns:
        All grasps, in one of three groups: with a label, untried, outside.

    Raises:
        InvalidInputError: a number does not make sense, or `X_CV` is no pose.
    """
    voxel, _ = grid_lengths(size, voxels, None)
    X_VG = inverse(check_pose(X_CV, "X_CV")) @ grasps.X_CG
    index = np.floor(X_VG[:, :3, 3] / voxel).astype(np.intp)
    inside = ((index >= 0) & (index < voxels)).all(axis=1)
    ended = ~np.isin(grasps.outcome, UNKNOWN_END)
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
