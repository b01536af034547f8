"""Random antipodal grasps at which the open hand is clear, from the samples of a surface."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .arrays import Array, pose
from .catalogue import Thing
from .hand import FINGER_PARTS, OPEN, PAD, PADS, PALM
from .trial import first_touch

CONE = np.deg2rad(70.0)
"""Between the approach and straight down, at most."""
TILTED = np.deg2rad(20.0)
"""Between the closing direction and the normals, at most."""
WIDEST, NARROWEST = 0.074, 0.0015
CLEAR = 1.5e-3
"""What is nearer to the open hand is not clear [m]."""
TRIES = 20000
ENDS = (np.argmin, np.argmax)
BESIDE = 1e-3
"""A sample this near to a line is on it [m]."""


def draw_grasps(thing: Thing, pose_number: int, rng: np.random.Generator) -> Iterator[Array]:
    """Grasps (4, 4) X_OG, as many as there are tries for.

    Args:
        thing: the object.
        pose_number: how it rests.
        rng: for everything that is random.
    """
    X_WO = thing.X_WO(pose_number)
    solid, feet_W = thing.feet, thing.feet.points @ X_WO[:3, :3].T + X_WO[:3, 3]
    chances = solid.areas / solid.areas.sum()
    for _ in range(TRIES):
        first = int(rng.choice(len(chances), p=chances))
        for found in _opposite(solid.points, solid.normals, first):
            start, end = X_WO[:3, :3] @ solid.points[first], X_WO[:3, :3] @ solid.points[found]
            X_WG = _hand(start + X_WO[:3, 3], end + X_WO[:3, 3], rng)
            if X_WG is not None and is_clear(X_WG, feet_W):
                yield np.linalg.inv(X_WO) @ X_WG
                break


def _opposite(points: Array, normals: Array, first: int) -> list[int]:
    """Samples that the other pad could press on: on the other side of the wall, and of the whole
    object, if that is another one."""
    n = normals[first]
    offset = points - points[first]
    along = -offset @ n
    beside = np.linalg.norm(offset + along[:, None] * n, axis=1)
    fits = (beside < BESIDE) & (along > NARROWEST) & (along < WIDEST)
    fits &= normals @ n < -np.cos(TILTED)
    candidates = np.flatnonzero(fits)
    if not len(candidates):
        return []
    return list(dict.fromkeys(int(candidates[pick(along[candidates])]) for pick in ENDS))


def _hand(start: Array, end: Array, rng: np.random.Generator) -> Array | None:
    """(4, 4) X_WG that closes along the line between two points, and approaches from above."""
    x = (start - end) / np.linalg.norm(start - end)
    if rng.random() < 0.5:
        x = -x
    turn = rng.normal(size=3)
    z = turn - (turn @ x) * x
    z /= np.linalg.norm(z)
    if -z[2] < np.cos(CONE):
        return None
    y = np.cross(z, x)
    shift = rng.uniform(-0.35, 0.35, size=2) * PAD
    return pose(np.stack((x, y, z), axis=1), (start + end) / 2 + shift[0] * y + shift[1] * z)


def is_clear(X_WG: Array, points_W: Array) -> bool:
    """Whether the open hand is clear of points (N, 3) of the object and of the table."""
    boxes = (*PALM, *FINGER_PARTS, *PADS)
    corners = np.concatenate([box.corners(OPEN) for box in boxes])
    if (corners @ X_WG[2, :3] + X_WG[2, 3]).min() < CLEAR:
        return False
    points_G = (points_W - X_WG[:3, 3]) @ X_WG[:3, :3]
    if any(box.contains(points_G, OPEN, CLEAR).any() for box in boxes):
        return False
    return first_touch(points_G) > 0.0
