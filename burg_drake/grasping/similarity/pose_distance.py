"""How far apart two grasps of a parallel hand are.

Translation and angle between two grasp frames, modulo the swap of the fingers: turning G by 180
degrees about its z axis is the same physical grasp. The combined distance adds the two with a
lever. All three are metrics on physical grasps: symmetric, zero only for the same grasp, and with
the triangle inequality. Every pair is computed elementwise, so that it has the same bits alone and
in any batch, and in either finger form. `coverage` compares whole sets.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array, InvalidInputError

DISTANCE_VERSION = 1
"""Of the distances here and of what is computed from them; changes when a figure would."""

LEVER = 0.001 / math.radians(1.0)
"""Metres per radian of the combined distance, 57.3 mm: one degree weighs as much as one millimetre,
as in BURG-Toolkit (`combined_distances` in its `metrics.py`, which tells the fingers apart)."""

X, Y, Z, P = 0, 3, 6, 9
"""Where the axes and the position of a grasp begin in its components."""


def components(X_OG: ArrayLike) -> Array:
    """(..., 4, 4) -> (12, ...): the axes x, y, z and the position of each grasp, in rows."""
    columns = np.asarray(X_OG, dtype=float)[..., :3, :]
    rows = np.moveaxis(np.swapaxes(columns, -1, -2), (-2, -1), (0, 1))
    return np.ascontiguousarray(rows.reshape(12, *rows.shape[2:]))


def pair_translation(G: Array, F: Array) -> Array:
    """Distances of the origins [m] from `components`, (12, ...) each, which broadcast."""
    x, y, z = (G[P + k] - F[P + k] for k in range(3))
    length: Array = np.sqrt(x * x + y * y + z * z)
    return length


def pair_angle(G: Array, F: Array) -> Array:
    """Angles modulo the swap of the fingers [rad] from `components`, which broadcast.

    The finger form with the larger trace of the relative rotation is the nearer one. Its angle
    comes from sine and cosine both, which is exact to rounding at 0 and at pi, too.
    """
    xx_yy = _dot(G, X, F, X) + _dot(G, Y, F, Y)
    sign = np.where(xx_yy < 0.0, -1.0, 1.0)  # of the x and y axes of F
    a = sign * _dot(G, Z, F, Y) - _dot(G, Y, F, Z)
    b = _dot(G, X, F, Z) - sign * _dot(G, Z, F, X)
    c = _dot(G, Y, F, X) - _dot(G, X, F, Y)
    return np.arctan2(np.sqrt(a * a + b * b + c * c), np.abs(xx_yy) + _dot(G, Z, F, Z) - 1.0)


def check_lever(lever: float) -> None:
    """Refuses a lever that makes no distance.

    Raises:
        InvalidInputError: it is negative or not finite.
    """
    if not (math.isfinite(lever) and lever >= 0.0):
        raise InvalidInputError(f"lever is {lever}; expected a finite number from 0, in m/rad")


def _dot(G: Array, i: int, F: Array, j: int) -> Array:
    """Scalar products of two axes; elementwise, a BLAS product would depend on the batch."""
    product: Array = G[i] * F[j] + G[i + 1] * F[j + 1] + G[i + 2] * F[j + 2]
    return product
