"""Random and regular grasps for the tests that compare grasps."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, make_pose


def random_grasps(n: int, seed: int, size: float = 0.03) -> Array:
    """(n, 4, 4) poses with any rotation, in a cube of `size` to all sides."""
    rng = np.random.default_rng(seed)
    R = Rotation.random(n, random_state=seed).as_matrix()
    return make_pose(R, rng.uniform(-size, size, (n, 3)))


def crowded_grasps(n: int, seed: int) -> Array:
    """(n, 4, 4) poses a few millimetres and degrees about one, some with swapped fingers."""
    rng = np.random.default_rng(seed)
    turns = rng.normal(scale=np.radians(8.0), size=(n, 3))
    swap = np.outer(rng.integers(2, size=n), (0.0, 0.0, np.pi))
    R = Rotation.from_rotvec(turns) * Rotation.from_rotvec(swap)
    return make_pose(R.as_matrix(), rng.normal(scale=0.008, size=(n, 3)))


def about(axis: str, degrees: float) -> Array:
    """(4, 4) pose turned about an axis of the world."""
    return make_pose(Rotation.from_euler(axis, degrees, degrees=True).as_matrix())


def brute_force(X_OG: Array, X_OF: Array) -> tuple[Array, Array]:
    """(N, M) translations [m] and angles [rad], by another way: norms and scipy's rotations."""
    translation = np.linalg.norm(X_OG[:, None, :3, 3] - X_OF[None, :, :3, 3], axis=-1)
    swap = np.diag([-1.0, -1.0, 1.0])
    angles = []
    for form in (np.eye(3), swap):
        R_GF = np.swapaxes(X_OG[:, None, :3, :3], -1, -2) @ (X_OF[None, :, :3, :3] @ form)
        angles.append(Rotation.from_matrix(R_GF.reshape(-1, 3, 3)).magnitude())
    return translation, np.minimum(*angles).reshape(translation.shape)
