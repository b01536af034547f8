"""Objects beside one another: a few millimetres apart, or in contact."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array
from burg_drake.scene.arrangement.occupancy import (
    BOX_TOLERANCE,
    OccupiedBoard,
    StandingObject,
    free_distance,
    random_place,
)
from burg_drake.scene.arrangement.polygons import exit_distance

CLOSE = (0.002, 0.010)
"""Between shadows that are close to each other [m]: too little for a finger."""
START_GAP = 1e-4
"""What is pushed against others starts with its shadow that far from theirs [m]."""


def place_beside(
    occupied: OccupiedBoard, turned: StandingObject, rng: np.random.Generator, *, touching: bool
) -> StandingObject | None:
    """Looks for a place beside one of those that stand there, or anywhere for the first one.

    One try: one of them and a direction from there are drawn, each as probable.

    Args:
        occupied: the board and what stands there.
        turned: the object, turned by a yaw.
        rng: draws.
        touching: push it against them until the pieces of both touch.

    Returns:
        None if there is no room, or nothing to be pushed against.
    """
    if not occupied.standing:
        return random_place(occupied, turned, rng, CLOSE[0], 1)[0]
    partner = occupied.standing[rng.integers(len(occupied.standing))]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])
    around = partner.shadow.forbids(turned.shadow)
    middle = partner.shadow.middle - turned.shadow.middle
    distance = exit_distance(around, middle, direction)
    distance += START_GAP if touching else rng.uniform(*CLOSE)
    place = middle + distance * direction
    if touching:
        return _moved_to_contact(occupied, partner, turned, place, -direction, distance)
    one = turned.shifted(place)
    if occupied.in_bounds(one) and occupied.is_free(turned, place, CLOSE[0]):
        return one
    return None


def _moved_to_contact(
    occupied: OccupiedBoard,
    partner: StandingObject,
    turned: StandingObject,
    place: Array,
    direction: Array,
    limit: float,
) -> StandingObject | None:
    """An object that is pushed from a place (2,) towards its partner along a unit vector (2,) until
    it touches others; None if the place is not free, it touches nothing within the limit [m], or it
    ends off the board."""
    one = turned.shifted(place)
    least, most = occupied.exit_distances(one, direction)
    if least > min(most, limit) + BOX_TOLERANCE or most < -BOX_TOLERANCE:
        return None
    if not occupied.is_free(turned, place, 0.0):
        return None
    along = np.array([*direction, 0.0])
    distance = free_distance(
        one.pieces, occupied.pieces(partner), along, limit, stop_below=least - BOX_TOLERANCE
    )
    if distance == limit:
        return None
    one = one.shifted(distance * direction)
    return one if occupied.in_bounds(one) else None
