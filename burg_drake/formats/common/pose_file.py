"""Poses from files: numpy's `.npy`, as GraspNet-1Billion keeps those of its cameras, or YAML.

GraspNet-1Billion has two files for each scene and camera: `camera_poses.npy` (256, 4, 4), poses of
the camera in the frame of its first picture, and `cam0_wrt_table.npy` (4, 4), that frame on the
table. Their product, `cam0_wrt_table.npy camera_poses.npy:12`, is the camera on the table
(`generate_scene_model` in graspnetAPI/utils/utils.py of github.com/graspnet/graspnetAPI).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

from burg_drake.core import Array, InvalidInputError, make_pose
from burg_drake.core.documents import Pose, Reader, load_nodes
from burg_drake.core.files import open_npy
from burg_drake.formats.common.rigid import nearest_rigid


def read_poses(references: Sequence[str]) -> Array:
    """The product of poses in files, from left to right.

    Args:
        references: each a file with one pose, or `FILE:INDEX` for one of several.

    Returns:
        (4, 4) pose.

    Raises:
        InvalidInputError: a file holds no pose, several without an index, or none of that index.
        DocumentError: a YAML file that is no pose.
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
        return cast(Pose, Reader(str(path)).read(load_nodes(path), Pose, "")).matrix()
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
    checked, _ = nearest_rigid(poses[index : index + 1], f"{path}: pose {index}")
    X: Array = checked[0]
    return X
