"""Rigid transforms in batches, and the frames of a grasp.

A pose `X_AB` is a 4x4 homogeneous matrix, the pose of frame B measured and expressed in frame A;
a batch has shape (..., 4, 4). Composition is `X_AB @ X_BC`. Quaternions are ordered wxyz.

The grasp frame G is midway between the finger pads (the tool centre point); +z is the approach
direction and +x the closing direction. A rotation of G by 180 degrees about its z axis swaps the
fingers and is the same physical grasp.

scipy loads its rotations on first use, which halves the start-up time of worker processes that
do not need them.
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from burg_drake.core.arrays import Array
from burg_drake.core.errors import InvalidInputError

MAX_POSE_COORDINATE = 1e6
"""Largest coordinate of a pose, metres. Squares of larger ones might overflow."""


def make_pose(R_AB: ArrayLike | None = None, p_AB: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Poses from rotations and positions.

    Args:
        R_AB: (..., 3, 3) rotation matrices; identity if None.
        p_AB: (..., 3) positions [m]; leading shapes broadcast.

    Returns:
        (..., 4, 4) poses.
    """
    rotation = np.eye(3) if R_AB is None else np.asarray(R_AB, dtype=float)
    position = np.asarray(p_AB, dtype=float)
    shape = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1])
    X_AB = np.zeros((*shape, 4, 4))
    X_AB[..., :3, :3] = rotation
    X_AB[..., :3, 3] = position
    X_AB[..., 3, 3] = 1.0
    return X_AB


def inverse(X_AB: ArrayLike) -> Array:
    """`X_BA` from `X_AB`, (..., 4, 4)."""
    X = np.asarray(X_AB, dtype=float)
    R_BA = np.swapaxes(X[..., :3, :3], -1, -2)
    return make_pose(R_BA, -(R_BA @ X[..., :3, 3:])[..., 0])


def transform_points(X_AB: ArrayLike, p_BQ: ArrayLike) -> Array:
    """Points (..., N, 3) given in B, expressed in A, for poses `X_AB` (..., 4, 4)."""
    X = np.asarray(X_AB, dtype=float)
    p_AQ: Array = (
        np.asarray(p_BQ, dtype=float) @ np.swapaxes(X[..., :3, :3], -1, -2) + X[..., None, :3, 3]
    )
    return p_AQ


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """(..., 3) roll, pitch, yaw [rad] about fixed x, y, z axes -> (..., 3, 3) `Rz Ry Rx`."""
    return _convert_vectors(
        rpy, 3, lambda v: scipy.spatial.transform.Rotation.from_euler("xyz", v).as_matrix(), (3, 3)
    )


def rpy_from_rotation(R_AB: ArrayLike) -> Array:
    """(..., 3, 3) -> (..., 3) roll, pitch, yaw [rad], pitch in [-pi/2, pi/2]."""
    with warnings.catch_warnings():  # at gimbal lock yaw 0 is valid, so suppress the warning
        warnings.simplefilter("ignore", UserWarning)
        return _convert_rotations(R_AB, lambda R: R.as_euler("xyz"), 3)


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """(..., 4) wxyz quaternions, normalised here -> (..., 3, 3)."""
    return _convert_vectors(
        quaternion,
        4,
        lambda v: scipy.spatial.transform.Rotation.from_quat(v, scalar_first=True).as_matrix(),
        (3, 3),
    )


def quaternion_from_rotation(R_AB: ArrayLike) -> Array:
    """(..., 3, 3) -> (..., 4) wxyz unit quaternions with w >= 0."""
    return _convert_rotations(R_AB, lambda R: R.as_quat(canonical=True, scalar_first=True), 4)


def cross_matrix(p: ArrayLike) -> Array:
    """(..., 3) -> (..., 3, 3) matrices M with M v = p x v."""
    p = np.asarray(p, dtype=float)
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    M = np.zeros((*p.shape, 3))
    M[..., 0, 1], M[..., 0, 2] = -z, y
    M[..., 1, 0], M[..., 1, 2] = z, -x
    M[..., 2, 0], M[..., 2, 1] = -y, x
    return M


def rotation_angle(R_AB: ArrayLike) -> Array:
    """(..., 3, 3) -> (...,) angle of the rotation [rad], in [0, pi].

    Uses sine and cosine (skew part and trace), and so is accurate for small angles, too.
    """
    R = np.asarray(R_AB, dtype=float)
    skew = R - np.swapaxes(R, -1, -2)
    x, y, z = skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]
    trace = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    angle: Array = np.arctan2(np.sqrt(x * x + y * y + z * z), trace - 1.0)
    return angle


def rot_z(angle: float) -> Array:
    """Rotation matrix (3, 3) by `angle` [rad] about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def wrap_to_pi(angle: ArrayLike) -> Array:
    """Wraps angles (...,) to [-pi, pi) [rad]."""
    return np.asarray(np.remainder(np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi)


def check_pose(X_AB: ArrayLike, name: str) -> Array:
    """Validates poses from outside.

    Args:
        X_AB: (..., 4, 4) poses.
        name: name for the message, such as `X_SO of 'mug'`.

    Returns:
        The poses as float array.

    Raises:
        InvalidInputError: wrong shape, not finite, beyond `MAX_POSE_COORDINATE`, not a right-handed
            rotation, or bad last row.
    """
    X = np.asarray(X_AB, dtype=float)
    if X.shape[-2:] != (4, 4):
        raise InvalidInputError(f"{name} has shape {X.shape}; expected (..., 4, 4)")
    if X.ndim == 2:
        _require_rigid(X, name)
    step = 1 << 16  # Poses that are checked at a time, for memory.
    for begin in range(0, len(X) if X.ndim > 2 else 0, step):
        _require_rigid(X[begin : begin + step], name, begin)
    return X


def _require_rigid(X: Array, name: str, first: int = 0) -> None:
    """Refuses poses (..., 4, 4) that are not rigid; `first` is the index of the first one."""
    tolerance = 1e-6  # Largest deviation from orthonormality.

    def refuse(bad: NDArray[np.bool_] | np.bool_, what: str) -> None:
        if bad.any():
            index = np.argwhere(bad)[0]
            index[:1] += first
            where = ", ".join(str(i) for i in index)
            raise InvalidInputError(f"{name}{f'[{where}]' if where else ''} {what}")

    refuse(
        ~np.isfinite(X).all(axis=(-2, -1)),
        "has NaN or infinite numbers; give finite metres and angles",
    )
    refuse(
        (np.abs(X[..., :3, 3]) > MAX_POSE_COORDINATE).any(axis=-1),
        f"is more than {MAX_POSE_COORDINATE:g} m from the origin; give metres",
    )
    R = X[..., :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of any size
        off = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-2, -1))
        mirrored = np.linalg.det(R) < 0.0
    off = np.where(np.isnan(off), np.inf, off)
    worst = f"{off.max(initial=0.0):.2g}"
    refuse(
        off > tolerance,
        f"is not a rigid transform: its rotation part is off by {worst} from orthonormal",
    )
    refuse(mirrored, "is not a rigid transform: its rotation part is a reflection (determinant -1)")
    last = np.abs(X[..., 3, :] - (0.0, 0.0, 0.0, 1.0)).max(axis=-1)
    refuse(last > tolerance, "has a last row that is not 0 0 0 1")


def swap_fingers(X_AG: ArrayLike) -> Array:
    """The same grasps (..., 4, 4) with the fingers swapped."""
    return np.asarray(X_AG, dtype=float) @ make_pose(np.diag([-1.0, -1.0, 1.0]))


def canonical_fingers(X_AG: ArrayLike) -> Array:
    """Grasps (..., 4, 4) with fingers swapped where needed so that the largest component of the
    closing axis (the first of equals) is positive: equal for a grasp and its `swap_fingers`."""
    X = np.asarray(X_AG, dtype=float)
    x = X[..., :3, 0]
    largest = np.abs(x).argmax(axis=-1)[..., None]
    turned = np.take_along_axis(x, largest, axis=-1) < 0.0
    return np.where(turned[..., None], swap_fingers(X), X) + 0.0


def pregrasp(X_AG: ArrayLike, standoff: float) -> Array:
    """Pregrasps `X_AP` (..., 4, 4): back along the approach axis by `standoff` [m]."""
    return np.asarray(X_AG, dtype=float) @ make_pose(p_AB=(0.0, 0.0, -standoff))


def grasp_from_axes(closing: ArrayLike, approach: ArrayLike, p_AG: ArrayLike) -> Array:
    """Grasp poses from directions.

    Args:
        closing: (..., 3) closing directions, need not be unit length.
        approach: (..., 3) approach directions of any length; the part along `closing` is removed.
        p_AG: (..., 3) positions of the tool centre point [m].

    Returns:
        `X_AG` (..., 4, 4).

    Raises:
        InvalidInputError: closing and approach are parallel, or one of them is zero.
    """
    x = np.asarray(closing, dtype=float)
    z = np.asarray(approach, dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        x = x / np.linalg.norm(x, axis=-1, keepdims=True)
        z = z / np.linalg.norm(z, axis=-1, keepdims=True)
        z = z - (z * x).sum(-1, keepdims=True) * x
        length = np.linalg.norm(z, axis=-1, keepdims=True)
        z = z / length
    if not (length > 1e-9).all():
        raise InvalidInputError(
            "closing and approach directions must not be zero or parallel to each other"
        )
    x, z = np.broadcast_arrays(x, z)
    return make_pose(np.stack([x, np.cross(z, x), z], axis=-1), p_AG)


def _convert_vectors(values: ArrayLike, size: int, convert, shape: tuple[int, ...]) -> Array:  # type: ignore[no-untyped-def]
    v = np.asarray(values, dtype=float)
    return np.asarray(convert(v.reshape(-1, size))).reshape(*v.shape[:-1], *shape)


def _convert_rotations(R_AB: ArrayLike, convert, size: int) -> Array:  # type: ignore[no-untyped-def]
    R = np.asarray(R_AB, dtype=float)
    rotations = scipy.spatial.transform.Rotation.from_matrix(R.reshape(-1, 3, 3))
    return np.asarray(convert(rotations)).reshape(*R.shape[:-2], size)


def perpendicular_axes(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors (..., 3) that make a right-handed frame with the unit vectors `axis`.

    Without branches and singularities (Duff et al., "Building an orthonormal basis, revisited",
    JCGT 2017).
    """
    x, y, z = np.moveaxis(axis, -1, 0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    u = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    v = np.stack([b, sign + y * y * a, -y], axis=-1)
    return u, v
