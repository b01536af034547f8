"""Refuses arms that cannot be used; caches the result, so that Drake need not be loaded again."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Arrays, cached
from burg_drake.motion.arm_span import ArmSpan, unreachable_objects
from burg_drake.scene import Scene
from burg_drake.station import Station, world_content


def require_usable_arm(scene: Scene, station: Station) -> tuple[str, ...]:
    """Refuses an arm that can execute no grasp of a scene, by fast checks.

    Args:
        scene: the scene on the station.
        station: the station, with or without an arm.

    Returns:
        A line for each object of the scene that is certainly out of the arm's reach.

    Raises:
        InvalidInputError: the whole board is out of reach, the arm's base is inside a body, the arm
            collides in its home posture, or joint limits are missing; one line says where.
    """
    if station.document.arm is None:
        return ()

    def check() -> Arrays:
        from burg_drake.motion.station_check import usable_span  # loads Drake

        span = usable_span(scene, station)
        return {"p_WJ": span.p_WJ, "radius": np.array(span.radius)}

    found = cached("usable-arm", world_content(scene, station), check)
    span = ArmSpan(found["p_WJ"], float(found["radius"]))
    return tuple(unreachable_objects(span, scene, station).values())
