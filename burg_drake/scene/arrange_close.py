"""Objects beside one another: a few millimetres apart, or in contact."""

from __future__ import annotations

import numpy as np

from burg_drake.scene.arrangement import (
    Occupied,
    Standing,
    random_place,
    travel,
)
from burg_drake.scene.polygons import exit_distance, forbidden

CLOSE = (0.002, 0.010)
"""Between shadows that are close to each other [m]: too little for a finger."""
START = 1e-4
"""What is pushed against others starts with its shadow that far from theirs [m]."""


def place_beside(
    occupied: Occupied, turned: Standing, rng: np.random.Generator, *, touching: bool
) -> Standing | None:
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
    around = forbidden(partner.shadow, turned.shadow)
    middle = partner.shadow.mean(axis=0) - turned.shadow.mean(axis=0)
    way = exit_distance(around, middle, direction)
    way += START if touching else rng.uniform(*CLOSE)
    one = turned.shifted(middle + way * direction)
    if not occupied.is_free(one, 0.0 if touching else CLOSE[0]):
        return None
    if touching:
        back = np.array([*-direction, 0.0])
        pushed = travel(one.pieces(), occupied.pieces(), back, way)
        if pushed == way:
            return None
        one = one.shifted(-pushed * direction)
    return one if occupied.in_bounds(one) else None
