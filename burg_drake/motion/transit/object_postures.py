"""Postures in which the hand looks at an object from nearby, as at the pregrasps to come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Arrays, cached, content_hash, rng_from
from burg_drake.motion.ik import ArmLinks
from burg_drake.station.diagram import StationDiagram

DRAWN = 40_000
"""Postures that the few are chosen from; half of them are uniform, half around home."""
SPREAD = 0.25
"""Standard deviation around home, in parts of a joint's range."""
NEAREST, FARTHEST = 0.03, 0.30
"""Distance of the grasp frame to the origin of an object [m]."""
COSINE = 0.6
"""Of the angle between the approach direction and the direction to that object, at least."""
BLOCK = 4096
"""Postures whose links are placed at once."""


def random_postures(
    home: Array, lower: Array, upper: Array, count: int, rng: np.random.Generator
) -> Array:
    """(count, n) postures within joint limits, uniform and around home by turns."""
    q = rng.uniform(lower, upper, (count, len(home)))
    around = home + SPREAD * (upper - lower) * rng.standard_normal(q[::2].shape)
    q[::2] = np.clip(around, lower, upper)
    return q


def postures_over_objects(
    station_diagram: StationDiagram, links: ArmLinks, home: Array, lower: Array, upper: Array
) -> Array:
    """Chooses random postures by where the hand is and where it points.

    Args:
        station_diagram: says where the scene's free objects are, and what hand there is.
        links: the arm's kinematics in the world.
        home: (n,) posture around which half of the postures are drawn.
        lower, upper: (n,) joint limits [rad or m].

    Returns:
        (F, n) postures, which may collide; none if the scene has no free object.
    """
    station, plant = station_diagram.station, station_diagram.plant
    hand = plant.GetBodyByName(station.hand.body, plant.GetModelInstanceByName("hand")).index()
    X_FG = links.X_FB[hand] @ station.hand.X_HG.matrix()
    objects = [station_diagram.X_WO(name)[:3, 3] for name in station_diagram.scene.instances]
    frame = links.frame_of[hand]

    def make() -> Arrays:
        q = random_postures(home, lower, upper, DRAWN, rng_from("burg_drake postures over objects"))
        return {"q": q[_aimed_at(links, frame, X_FG, objects, q)]}

    asked = (links.X_before, list(links.turns), frame, X_FG, objects, home, lower, upper)
    return np.asarray(cached("postures", content_hash(*asked), make)["q"])


def _aimed_at(
    links: ArmLinks, frame: int, X_FG: Array, objects: list[Array], q: Array
) -> NDArray[np.bool_]:
    """(N,) whether the hand looks at one of the objects in postures (N, n)."""
    looks = np.zeros(len(q), dtype=bool)
    for start in range(0, len(q), BLOCK):
        block = slice(start, start + BLOCK)
        poses = links.poses(q[block])
        points = np.stack([X_FG[:3, 3], X_FG[:3, 3] + X_FG[:3, 2]]).astype(np.float32)
        p_WG, ahead = poses.place(frame, points).swapaxes(0, 1)
        approach = ahead - p_WG
        for p_WO in objects:
            offset = p_WO.astype(np.float32)[:, None] - p_WG
            distance = np.sqrt((offset * offset).sum(axis=0))
            along = (offset * approach).sum(axis=0)
            near = (distance > NEAREST) & (distance < FARTHEST)
            looks[block] |= near & (along > COSINE * distance)
    return looks
