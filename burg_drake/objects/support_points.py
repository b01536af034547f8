"""Support points: the hull corners on which an object stands or rolls on a plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

SUPPORT_HEIGHT_TOLERANCE = 1.5e-4
"""Metres above the lowest corner up to which corners carry the object."""
MAX_CARRYING_CORNERS = 12
"""Number of directions; the carrying corners that reach farthest in them are kept."""
HULL_TOLERANCE = 4e-3
"""Metres that the feet may fall short of the hull where no object comes to rest."""
ROLLING_TOLERANCE = 3e-4
"""Metres that the feet may fall short of the hull about the axis of rolling."""
AXIS_DIRECTIONS = 180
"""Directions about an axis, 2 degrees apart."""


def support_feet(
    corners: Array,
    ups: Sequence[Array],
    rolling: Sequence[Array] = (),
    carrying: Sequence[int] | NDArray[np.intp] = (),
) -> NDArray[np.intp]:
    """Chooses the feet of an object among the corners of its hull.

    The choice does not depend on the rotation about the vertical.

    Args:
        corners: (N, 3) corners of the hull that rests on a plane, in O [m].
        ups: normals (3,) of the plane in O for the poses in which the object rests. In these poses
            the feet support it as all corners would.
        rolling: normals (3,) for the poses from which the object can roll.
        carrying: corners that carry the object in the first of `ups`; by default the lowest ones.

    Returns:
        Indices of corners, in their order.
    """
    direction_count = 600  # Directions in which the hull is compared, 7 degrees apart.
    chosen: list[int] = []
    for k, up in enumerate(ups):
        low = np.asarray(carrying) if k == 0 and len(carrying) else _lowest_corners(corners, up)
        reach = np.round(
            corners[low]
            @ (_circle_directions(MAX_CARRYING_CORNERS) @ _perpendicular_vectors(up)).T,
            9,
        )
        chosen += low[reach.argmax(axis=0)].tolist()
    for up in rolling:
        directions = _rolling_directions(corners, up)
        chosen += _missing_corners(corners, directions, ROLLING_TOLERANCE, chosen)
    chosen += _missing_corners(corners, _sphere_directions(direction_count), HULL_TOLERANCE, chosen)
    return np.unique(np.array(chosen, dtype=np.intp))


def carrying_corners(
    corners: Array, up: Array, center_of_mass: Array, max_height: float
) -> NDArray[np.intp]:
    """The lowest corners that carry an object which rests on a plane.

    Corners are added from the lowest upwards until the centre of mass is above their polygon: an
    object that came to rest on a soft support may touch a rigid one with fewer corners.

    Args:
        corners: (N, 3) corners of the hull in O [m].
        up: (3,) normal of the plane in O.
        center_of_mass: (3,) centre of mass in O [m].
        max_height: largest height of a carrying corner above the lowest one [m].

    Returns:
        Indices of corners; if these do not support the object, those within
        `SUPPORT_HEIGHT_TOLERANCE` of the lowest one.
    """
    min_inner_distance = 5e-4  # Metres from the centre of mass to the sides of its support polygon.
    heights = np.round(corners @ up, 9)
    order = np.argsort(heights, kind="stable")
    order = order[heights[order] <= heights.min() + max_height]
    directions = _circle_directions(AXIS_DIRECTIONS) @ _perpendicular_vectors(up)
    beyond = np.maximum.accumulate((corners[order] - center_of_mass) @ directions.T, axis=0)
    stands = np.flatnonzero(beyond.min(axis=1) >= min_inner_distance)
    flat = heights[order] <= heights.min() + SUPPORT_HEIGHT_TOLERANCE
    if len(stands):
        flat |= heights[order] <= heights[order[stands[0]]]
    found: NDArray[np.intp] = order[flat]
    return found


def _missing_corners(
    corners: Array, directions: Array, tolerance: float, chosen: Sequence[int]
) -> list[int]:
    """Corners (N, 3) to add to the chosen ones so that these reach as far as all corners, within a
    tolerance [m], in directions (D, 3); the farthest missing one comes first."""
    reach = np.round(corners @ directions.T, 9)  # so that ties do not depend on orientation
    full = reach.max(axis=0)
    now = reach[list(chosen)].max(axis=0, initial=-np.inf)
    added: list[int] = []
    while (missing := full - now).max() > tolerance:
        worst = int(np.argmax(missing))
        added.append(int(np.argmax(reach[:, worst])))
        now = np.maximum(now, reach[added[-1]])
    return added


def _lowest_corners(corners: Array, up: Array) -> NDArray[np.intp]:
    """Indices of the corners (N, 3) that carry the object; `up` is the plane's normal."""
    heights = corners @ up
    return np.flatnonzero(heights <= heights.min() + SUPPORT_HEIGHT_TOLERANCE)


def _rolling_directions(corners: Array, up: Array) -> Array:
    """(D, 3) directions of O around the axis of rolling, the line along which an object touches the
    plane. An object with point contact, such as an egg, can roll about any axis; two are used."""
    max_line_ratio = 0.5  # Width over length; a wider contact is no line to roll on.
    low = corners[_lowest_corners(corners, up)] @ _perpendicular_vectors(up).T
    low = low - low.mean(axis=0)
    axes = np.linalg.svd(low)[2]
    along = axes[0]
    across = np.array((-along[1], along[0])) @ _perpendicular_vectors(up)
    directions: Array = _circle_directions(AXIS_DIRECTIONS) @ np.stack([across, up])
    length, width = np.linalg.norm(low @ axes.T, axis=0)
    if width >= max_line_ratio * length:
        other = _circle_directions(AXIS_DIRECTIONS) @ np.stack(
            [along @ _perpendicular_vectors(up), up]
        )
        directions = np.vstack([directions, other])
    return directions


def _perpendicular_vectors(up: Array) -> Array:
    """(2, 3) unit vectors of O perpendicular to a unit vector."""
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(np.round(up, 6)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def _circle_directions(count: int) -> Array:
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _sphere_directions(count: int) -> Array:
    """(N, 3) unit vectors spread evenly: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
