"""Poses from files of other projects: reading, checks, and rotations made orthonormal again.

Poses are `.npy` files, as GraspNet-1Billion has those of its cameras, or YAML.
GraspNet-1Billion has two files for each scene and camera: `camera_poses.npy` (256, 4, 4), poses of
the camera in the frame of its first picture, and `cam0_wrt_table.npy` (4, 4), that frame on the
table. Their product, `cam0_wrt_table.npy camera_poses.npy:12`, is the camera on the table
(`generate_scene_model` in graspnetAPI/utils/utils.py of github.com/graspnet/graspnetAPI).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    Reader,
    load_yaml_node,
    make_pose,
    open_npy,
    short_message,
)


def nearest_rigid(X: ArrayLike, where: str) -> tuple[Array, tuple[str, ...]]:
    """Orthonormalises the rotations of poses from a file to double precision.

    Args:
        X: (N, 4, 4) numbers.
        where: file and key, such as `mug.h5: grasps/transforms`.

    Returns:
        (N, 4, 4) poses, each with the rotation nearest to the given one (Kabsch 1976, by singular
        values), and a note if the correction exceeds rounding of single precision.

    Raises:
        InvalidInputError: wrong shape, not finite, not rigid; the message names the first such
            pose.
    """
    max_rounding = 1e-3  # of R' R from identity, as of files with 3 to 4 decimals
    note_threshold = 1e-6
    try:
        poses = np.asarray(X, dtype=float)
    except (TypeError, ValueError) as error:
        message = f"{where} must hold (N, 4, 4) numbers: {short_message(error)}"
        raise InvalidInputError(message) from error
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise InvalidInputError(f"{where} has shape {poses.shape}; expected (N, 4, 4)")
    _reject_poses(~np.isfinite(poses).all(axis=(1, 2)), where, "has NaN or infinite numbers")
    last = np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1, initial=0.0)
    _reject_poses(last > note_threshold, where, "has a last row that is not 0 0 0 1")
    R = poses[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of any size
        deviation = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
        mirrored = np.linalg.det(R) < 0.0
    deviation = np.where(np.isnan(deviation), np.inf, deviation)
    _reject_poses(mirrored, where, "is a reflection, not a rotation")
    _reject_poses(
        deviation > max_rounding,
        where,
        "is not a rotation: it is off from orthonormal by",
        deviation,
    )
    U, _, Vt = np.linalg.svd(R)
    notes: tuple[str, ...] = ()
    if (deviation > note_threshold).any():
        notes = (
            f"{where}: {int((deviation > note_threshold).sum())} rotations were off from"
            f" orthonormal by up to {deviation.max():.1g}; the nearest rotations were used",
        )
    return make_pose(U @ Vt, poses[:, :3, 3]), notes


def _reject_poses(bad: np.ndarray, where: str, what: str, amount: Array | None = None) -> None:
    if bad.any():
        i = int(np.argmax(bad))
        more = "" if amount is None else f" {amount[i]:.2g}"
        others = f" (and {int(bad.sum()) - 1} others)" if bad.sum() > 1 else ""
        raise InvalidInputError(f"{where}[{i}] {what}{more}{others}")


def read_poses(references: Sequence[str]) -> Array:
    """The product of poses in files, from left to right.

    Args:
        references: each a file with one pose, or `FILE:INDEX` for one of several.

    Returns:
        (4, 4) pose.

    Raises:
        InvalidInputError: a file holds no pose, several poses without an index given, or no pose of
            the given index.
        DocumentError: a YAML file is not a pose.
    """
    X = make_pose()
    for reference in references:
        X = X @ _read_pose(reference)
    return X


def _read_pose(reference: str) -> Array:
    """The pose (4, 4) of one file; `.npy` holds (4, 4) or (N, 4, 4), anything else is YAML with
    `translation` and `rpy_deg` or `quaternion_wxyz`."""
    path, index = Path(reference), None
    name, colon, number = reference.rpartition(":")
    if colon and number.isdecimal() and not path.exists():
        path, index = Path(name), int(number)
    if path.suffix.lower() != ".npy":
        if index is not None:
            raise InvalidInputError(f"{path} holds one pose; leave out ':{index}'")
        return cast(Pose, Reader(str(path)).read(load_yaml_node(path), Pose, "")).matrix()
    with open_npy(path) as stored:
        if stored.shape[-2:] != (4, 4) or len(stored.shape) > 3:
            raise InvalidInputError(
                f"{path} has shape {stored.shape}; expected (4, 4) or (N, 4, 4)"
            )
        poses = stored.read("fiu").astype(float)
    if index is None:
        if poses.ndim == 3 and len(poses) != 1:
            raise InvalidInputError(
                f"{path} has {len(poses)} poses; say which one, such as {path}:0"
            )
        index = 0
    poses = poses.reshape(-1, 4, 4)
    if index >= len(poses):
        raise InvalidInputError(f"{path} has poses 0 to {len(poses) - 1}; there is no {index}")
    (X,), _ = nearest_rigid(poses[index : index + 1], f"{path}: pose {index}")
    return np.asarray(X)
