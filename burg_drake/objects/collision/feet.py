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
CARRYING = 5e-4
"""The polygon of the corners that carry an object is kept to this [m] ..."""
MOST_CARRYING = 12
"""... with so many of them, which make 0.97 of a circle at least."""
ANYWHERE = 4e-3
"""In any other direction the hull is kept to this [m]: nothing comes to rest there."""
ROUND = 3e-4
"""About the axis that an object rolls on it is kept to this [m]."""
DIRECTIONS = 600
"""In which the hull is looked at; 7 degrees apart."""
AROUND = 180
"""Directions about an axis; 2 degrees apart."""


def support_feet(corners: Array, ups: Sequence[Array], rolling: Sequence[Array] = ()) -> Array:
    """Chooses the feet of an object.

    The choice is the object's own: which way it is turned about the vertical does not enter.

    Args:
        corners: (N, 3) corners of the hull that rests on a plane, in O [m].
        ups: (3,) the plane's normals in O, in poses in which the object rests: it is carried in
            them as by all its corners.
        rolling: (3,) those of poses from which it can roll on.

    Returns:
        (F, 3) corners of the hull in O [m].
    """
    chosen: list[int] = []
    for up in ups:
        low = _lowest(corners, up)
        directions = _circle(AROUND) @ _plane(up)
        chosen += low[_thinned(corners[low], directions, CARRYING, MOST_CARRYING)].tolist()
    for up in rolling:
        directions = _around(corners, up)
        chosen += _thinned(corners, directions, ROUND, len(corners), chosen)
    chosen += _thinned(corners, _sphere(DIRECTIONS), ANYWHERE, len(corners), chosen)
    found: Array = corners[np.unique(chosen)]
    return found


def _thinned(
    corners: Array, directions: Array, tolerance: float, most: int, chosen: Sequence[int] = ()
) -> list[int]:
    """Corners (N, d) that are missing among those that are chosen, so that these reach as far as
    all of them, to a tolerance, in directions (D, d); the one that is missed most comes first."""
    reach = np.round(corners @ directions.T, 9)  # what is as far is as far, however it is turned
    full = reach.max(axis=0)
    now = reach[list(chosen)].max(axis=0) if len(chosen) else np.full(len(directions), -np.inf)
    added: list[int] = []
    while len(added) < most:
        missing = full - now
        worst = int(np.argmax(missing))
        if missing[worst] <= tolerance:
            break
        added.append(int(np.argmax(reach[:, worst])))
        now = np.maximum(now, reach[added[-1]])
    return added


def _lowest(corners: Array, up: Array) -> NDArray[np.intp]:
    """Indices of the corners (N, 3) that carry, where `up` is the plane's normal."""
    heights = corners @ up
    return np.flatnonzero(heights <= heights.min() + FLAT)


def _around(corners: Array, up: Array) -> Array:
    """(D, 3) directions of O about the axis that an object rolls on: the line along which it
    touches the plane."""
    low = corners[_lowest(corners, up)] @ _plane(up).T
    along = np.linalg.svd(low - low.mean(axis=0))[2][0]
    across = np.array((-along[1], along[0])) @ _plane(up)
    directions: Array = _circle(AROUND) @ np.stack([across, up])
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
