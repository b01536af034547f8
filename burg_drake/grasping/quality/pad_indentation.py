"""How far two springy pads are pressed in by an object between them.

Both pads bear the same force. Where their pressures do not face each other, the object turns until
they do: a thin wall comes to lie flat between the pads, and so does a box that was grasped askew.
Friction does not hold it back, which is what happens where there is little of it; with more, the
object may stay askew, held by friction. Angles are small, and there is no turning about the closing
axis.
"""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array

RESISTANCE = 1e-3
"""Stiffness with which the object resists turning, over that of a pad whose springs all bear. It
makes the angle unique where nothing else does, as of a ball."""

ITERATIONS = 10
"""Newton steps for the angles; with more, fewer than one grasp in a thousand changes."""

LARGEST_ANGLE = 0.35
"""Largest angle about each of the two axes [rad]; small angles are 6 % off there."""


def indentation(gap: Array, yz: Array, total: float) -> tuple[Array, Array]:
    """Presses both pads in.

    The object's angles minimise the energy of the springs, which is convex in them.

    Args:
        gap: (N, 2, K) distance of each spring from the object where its pad just touches [m].
        yz: (2, K, 2) places of the springs on the pads' faces [m].
        total: sum of the indentations of a pad [m].

    Returns:
        (N, 2, K) indentations, from 0 [m], and (N, 2) how far the object moves along x for each
        metre along y and z: its angles about -z and y [rad].
    """
    y, z = (np.ascontiguousarray(np.stack([yz[0], -yz[1]])[..., c]) for c in (0, 1))
    resistance = RESISTANCE * float((yz[0] ** 2).sum())
    angle, share = np.zeros((len(gap), 2)), np.ones(len(gap))
    best, depth = _press(gap, total)
    least = _energy(best, depth, total)
    for _ in range(ITERATIONS):
        step = share[:, None] * _newton_step(best, y, z, angle, resistance)
        trial = np.clip(angle + step, -LARGEST_ANGLE, LARGEST_ANGLE)
        pressed, depth = _press(gap - _lift(trial, y, z), total)
        energy = _energy(pressed, depth, total) + 0.5 * resistance * (trial**2).sum(axis=1)
        better = energy < least
        least = np.where(better, energy, least)
        angle = np.where(better[:, None], trial, angle)
        best = np.where(better[:, None, None], pressed, best)
        share = np.where(better, np.minimum(1.0, 2.0 * share), 0.25 * share)
    return best, angle


def _press(gap: Array, total: float) -> tuple[Array, Array]:
    """Indentations (N, 2, K) that add up to `total`, and how far the pads come (N, 2) [m]."""
    order = np.sort(gap, axis=-1)
    depth = (total + np.cumsum(order, axis=-1)) / np.arange(1, gap.shape[-1] + 1)
    bearing = (depth > order).sum(axis=-1, keepdims=True)  # true up to the last spring that bears
    depth = np.take_along_axis(depth, bearing - 1, axis=-1)
    return np.maximum(depth - gap, 0.0), depth[..., 0]


def _lift(angle: Array, y: Array, z: Array) -> Array:
    """(N, 2, K) how far the object comes towards each spring when it turns."""
    a, b = (angle[:, c, None, None] for c in (0, 1))
    return np.asarray(a * y + b * z)


def _energy(pressed: Array, depth: Array, total: float) -> Array:
    """(N,) potential energy of springs of unit stiffness and of the forces on the pads."""
    return np.asarray(0.5 * _sum(pressed * pressed) - total * (depth[:, 0] + depth[:, 1]))


def _newton_step(pressed: Array, y: Array, z: Array, angle: Array, resistance: float) -> Array:
    """(N, 2) step towards the least energy, with the pads following the object."""
    bears = (pressed > 0.0).astype(float)
    count = bears.sum(axis=2)
    my, mz = (bears * y).sum(axis=2), (bears * z).sum(axis=2)

    def spread(product: Array, one: Array, other: Array) -> Array:
        return _sum(bears * product) - (one * other / count).sum(axis=1)

    a = spread(y * y, my, my) + resistance
    b = spread(y * z, my, mz)
    d = spread(z * z, mz, mz) + resistance
    p, q = (_sum(pressed * v) + resistance * angle[:, c] for c, v in enumerate((y, z)))
    return np.asarray(np.stack([b * q - d * p, b * p - a * q], axis=1) / (a * d - b * b)[:, None])


def _sum(values: Array) -> Array:
    """(N,) sums over (N, 2, K); one row after another, so that batches do not matter."""
    one, two = values[:, 0].sum(axis=1), values[:, 1].sum(axis=1)
    return np.asarray(one + two)
