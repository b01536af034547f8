"""Distance between two grasps of a parallel hand, and grouping of grasps by object and instance.

Translation and angle are those between two grasp frames, modulo the swap of the fingers: a
rotation of G by 180 degrees about its z axis is the same grasp. The combined distance adds the two
with a lever. All three are metrics. Every pair is computed elementwise, so that its bits do not
depend on the batch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, GraspSet, Indices, InvalidInputError

DISTANCE_VERSION = 1
"""Raised when the same grasps get other distances."""

DISTANCE_LEVER = 0.001 / math.radians(1.0)
"""Metres per radian: one degree weighs as much as one millimetre (BURG-Toolkit)."""

POSITION_ROW = 9  # Row of the components at which the position of a grasp begins.


def grasp_components(X_OG: ArrayLike) -> Array:
    """(..., 4, 4) -> (12, ...): the axes x, y, z and the position of each grasp, in rows."""
    columns = np.asarray(X_OG, dtype=float)[..., :3, :]
    rows = np.moveaxis(np.swapaxes(columns, -1, -2), (-2, -1), (0, 1))
    return np.ascontiguousarray(rows.reshape(12, *rows.shape[2:]))


def pair_translation(G: Array, F: Array) -> Array:
    """Distances of the origins [m] from `grasp_components` (12, ...), broadcast."""
    x, y, z = (G[POSITION_ROW + k] - F[POSITION_ROW + k] for k in range(3))
    length: Array = np.sqrt(x * x + y * y + z * z)
    return length


def pair_angle(G: Array, F: Array) -> Array:
    """Angles modulo the swap of the fingers [rad] from `grasp_components` (12, ...), broadcast.

    The finger form with the larger trace of the relative rotation is the nearer one. Its angle
    comes from sine and cosine both, which is exact to rounding at 0 and at pi, too.
    """
    x, y, z = 0, 3, 6  # first rows of the axes in the components of a grasp
    xx_yy = _dot(G, x, F, x) + _dot(G, y, F, y)
    sign = np.where(xx_yy < 0.0, -1.0, 1.0)  # of the x and y axes of F
    a = sign * _dot(G, z, F, y) - _dot(G, y, F, z)
    b = _dot(G, x, F, z) - sign * _dot(G, z, F, x)
    c = _dot(G, y, F, x) - _dot(G, x, F, y)
    return np.arctan2(np.sqrt(a * a + b * b + c * c), np.abs(xx_yy) + _dot(G, z, F, z) - 1.0)


def check_lever(lever: float) -> None:
    """Refuses an invalid lever.

    Raises:
        InvalidInputError: it is negative or not finite.
    """
    if not (math.isfinite(lever) and lever >= 0.0):
        raise InvalidInputError(f"lever is {lever}; expected a finite number from 0, in m/rad")


def _dot(G: Array, i: int, F: Array, j: int) -> Array:
    """Scalar products of two axes; elementwise, as BLAS results depend on the batch."""
    product: Array = G[i] * F[j] + G[i + 1] * F[j + 1] + G[i + 2] * F[j + 2]
    return product


INSTANCE_COLUMN = "instance"  # Column with the instance that a grasp is on.


def by_target(grasps: GraspSet) -> list[Indices]:
    """Rising indices of the grasps of each object and instance, one array for each."""
    return [rows for rows, _ in by_shared_target(grasps, grasps)]


def by_shared_target(grasps: GraspSet, others: GraspSet) -> Iterator[tuple[Indices, Indices]]:
    """Yields the indices of the grasps of both sets for each object and instance in both."""
    instances = INSTANCE_COLUMN in grasps.columns and INSTANCE_COLUMN in others.columns
    keys = [_target_keys(grasps, instances), _target_keys(others, instances)]
    _, labels = np.unique(np.concatenate(keys), return_inverse=True)
    mine, theirs = (_group_by_label(part) for part in np.split(labels, [len(grasps)]))
    for label in sorted(mine.keys() & theirs.keys()):
        yield mine[label], theirs[label]


def _target_keys(grasps: GraspSet, instances: bool) -> NDArray[np.str_]:
    if not instances:
        return grasps.object
    pairs = zip(grasps.object, grasps.columns[INSTANCE_COLUMN], strict=True)
    return np.array([f"{object}\n{instance}" for object, instance in pairs], dtype=np.str_)


def _group_by_label(labels: Indices) -> dict[int, Indices]:
    if not len(labels):
        return {}
    order = np.argsort(labels, kind="stable")
    unique, start = np.unique(labels[order], return_index=True)
    return dict(zip(unique.tolist(), np.split(order, start[1:]), strict=True))
