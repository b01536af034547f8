"""Poses of other projects' files: checked, and single precision made orthonormal again."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array, InvalidInputError, make_pose
from burg_drake.core.files import short_message

ROUNDING = 1e-3
"""Largest deviation of `R' R` from the identity that is taken for rounding. Single precision leaves
some 1e-7, products of such matrices 1e-6, files with three to four decimals 1e-3."""

NOTED = 1e-6
"""A larger deviation is worth a note."""


def nearest_rigid(X: ArrayLike, where: str) -> tuple[Array, tuple[str, ...]]:
    """Poses of a file with rotations that are orthonormal to double precision.

    Args:
        X: (N, 4, 4) numbers.
        where: file and key, such as `mug.h5: grasps/transforms`.

    Returns:
        (N, 4, 4) poses, each with the rotation nearest to what was given (Kabsch 1976, by singular
        values), and a note if they were further off than rounding of single precision.

    Raises:
        InvalidInputError: wrong shape, not finite, not rigid; the message names the first one.
    """
    try:
        poses = np.asarray(X, dtype=float)
    except (TypeError, ValueError) as error:
        what = f"must hold (N, 4, 4) numbers: {short_message(error)}"
        raise InvalidInputError(f"{where} {what}") from error
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise InvalidInputError(f"{where} has shape {poses.shape}; expected (N, 4, 4)")
    _refuse(~np.isfinite(poses).all(axis=(1, 2)), where, "has NaN or infinite numbers")
    last = np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1, initial=0.0)
    _refuse(last > NOTED, where, "has a last row that is not 0 0 0 1")
    R = poses[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of any size
        off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
        mirrored = np.linalg.det(R) < 0.0
    off = np.where(np.isnan(off), np.inf, off)
    _refuse(mirrored, where, "is a reflection, not a rotation")
    _refuse(off > ROUNDING, where, "is not a rotation: it is off from orthonormal by", off)
    U, _, Vt = np.linalg.svd(R)
    notes: tuple[str, ...] = ()
    if (off > NOTED).any():
        notes = (
            f"{where}: {int((off > NOTED).sum())} rotations were off from orthonormal by"
            f" up to {off.max():.1g}; the nearest rotations were used",
        )
    return make_pose(U @ Vt, poses[:, :3, 3]), notes


def _refuse(bad: np.ndarray, where: str, what: str, amount: Array | None = None) -> None:
    if bad.any():
        i = int(np.argmax(bad))
        more = "" if amount is None else f" {amount[i]:.2g}"
        others = f" (and {int(bad.sum()) - 1} others)" if bad.sum() > 1 else ""
        raise InvalidInputError(f"{where}[{i}] {what}{more}{others}")
