"""The points on which an object stands on a plane: few of the corners of its hull, and those that
matter.

In Drake each of them costs a microsecond a step even where it touches nothing, so that not all
corners of a hull can be one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

FLAT = 1.5e-4
"""Corners that are no higher than this over the lowest one of a pose carry the object in it [m]."""
MOST_CARRYING = 12
"""Of the corners that carry an object, so many count: those that reach farthest in as many
directions. They keep 0.96 of a circle at least."""
WITHIN = 5e-4
"""How far within its polygon a centre of mass is over it, so that the object stands [m]."""
ANYWHERE = 4e-3
"""In any other direction the hull is kept to this [m]: nothing comes to rest there."""
ROUND = 3e-4
"""About the axis that an object rolls on it is kept to this [m]."""
DIRECTIONS = 600
"""In which the hull is looked at; 7 degrees apart."""
LINE = 0.5
"""Of what touches the plane, the width over the length from which on it is no line to roll on."""
AROUND = 180
"""Directions about an axis; 2 degrees apart."""


def support_feet(
    corners: Array,
    ups: Sequence[Array],
    rolling: Sequence[Array] = (),
    carrying: Sequence[int] | NDArray[np.intp] = (),
) -> NDArray[np.intp]:
    """Chooses the feet of an object among the corners of its hull.

    The choice is the object's own: which way it is turned about the vertical does not enter.

    Args:
        corners: (N, 3) corners of the hull that rests on a plane, in O [m].
        ups: (3,) the plane's normals in O, in poses in which the object rests: it is carried in
            them as by all its corners.
        rolling: (3,) those of poses from which it can roll on.
        carrying: corners that carry it in the first of `ups`; by default the lowest ones.

    Returns:
        Indices of corners, in their order.
    """
    chosen: list[int] = []
    for k, up in enumerate(ups):
        low = np.asarray(carrying) if k == 0 and len(carrying) else _lowest(corners, up)
        reach = np.round(corners[low] @ (_circle(MOST_CARRYING) @ _plane(up)).T, 9)
        chosen += low[reach.argmax(axis=0)].tolist()
    for up in rolling:
        directions = _around(corners, up)
        chosen += _missed(corners, directions, ROUND, chosen)
    chosen += _missed(corners, _sphere(DIRECTIONS), ANYWHERE, chosen)
    return np.unique(np.array(chosen, dtype=np.intp))


def carrying_corners(
    corners: Array, up: Array, center_of_mass: Array, most: float
) -> NDArray[np.intp]:
    """The lowest corners that carry an object which rests on a plane.

    Corners count from the lowest one on until the centre of mass is over their polygon: what came
    to rest on something soft may stand on fewer when nothing yields.

    Args:
        corners: (N, 3) corners of the hull in O [m].
        up: (3,) normal of the plane in O.
        center_of_mass: (3,) of O [m].
        most: height over the lowest corner up to which others may count [m].

    Returns:
        Indices of corners; where that is no support, of those within `FLAT` of the lowest one.
    """
    heights = np.round(corners @ up, 9)
    order = np.argsort(heights, kind="stable")
    order = order[heights[order] <= heights.min() + most]
    directions = _circle(AROUND) @ _plane(up)
    beyond = np.maximum.accumulate((corners[order] - center_of_mass) @ directions.T, axis=0)
    stands = np.flatnonzero(beyond.min(axis=1) >= WITHIN)
    flat = heights[order] <= heights.min() + FLAT
    if len(stands):
        flat |= heights[order] <= heights[order[stands[0]]]
    found: NDArray[np.intp] = order[flat]
    return found


def _missed(
    corners: Array, directions: Array, tolerance: float, chosen: Sequence[int]
) -> list[int]:
    """Which of the corners (N, 3) are missing among those that are chosen, so that these reach as
    far as all of them, to a tolerance [m], in directions (D, 3); the worst missed comes first."""
    reach = np.round(corners @ directions.T, 9)  # what is as far is as far, however it is turned
    full = reach.max(axis=0)
    now = reach[list(chosen)].max(axis=0, initial=-np.inf)
    added: list[int] = []
    while (missing := full - now).max() > tolerance:
        worst = int(np.argmax(missing))
        added.append(int(np.argmax(reach[:, worst])))
        now = np.maximum(now, reach[added[-1]])
    return added


def _lowest(corners: Array, up: Array) -> NDArray[np.intp]:
    """Indices of the corners (N, 3) that carry, where `up` is the plane's normal."""
    heights = corners @ up
    return np.flatnonzero(heights <= heights.min() + FLAT)


def _around(corners: Array, up: Array) -> Array:
    """(D, 3) directions of O about the axis that an object rolls on: the line along which it
    touches the plane. What touches it at a point, as an egg does, may roll on any axis: about two
    of them."""
    low = corners[_lowest(corners, up)] @ _plane(up).T
    low = low - low.mean(axis=0)
    axes = np.linalg.svd(low)[2]
    along = axes[0]
    across = np.array((-along[1], along[0])) @ _plane(up)
    directions: Array = _circle(AROUND) @ np.stack([across, up])
    length, width = np.linalg.norm(low @ axes.T, axis=0)
    if width >= LINE * length:
        other = _circle(AROUND) @ np.stack([along @ _plane(up), up])
        directions = np.vstack([directions, other])
    return directions


def _plane(up: Array) -> Array:
    """(2, 3) unit vectors of O across a unit vector."""
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(np.round(up, 6)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def _circle(count: int) -> Array:
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _sphere(count: int) -> Array:
    """(N, 3) unit vectors spread evenly: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
