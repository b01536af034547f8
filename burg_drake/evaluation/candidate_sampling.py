"""Samples the grasps that a run judges."""

from __future__ import annotations

import numpy as np

from burg_drake.core.content import rng_from
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import Candidates, distinct, join_candidates
from burg_drake.grasping.approach import ApproachCone
from burg_drake.objects.entry import ObjectEntry
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station

DEFAULT_APPROACH_ANGLE_DEG = 75.0
"""Keeps the hand above the horizontal, and leaves out pairs of an object's bottom and top for
friction up to tan(15 deg) = 0.27: one of the two fingers would be below the table."""

DOWN_DIGITS = 6
"""Straight down in an object's frame is rounded, so that instances of one object that differ by a
turn about the vertical share their grasps."""


def sample_candidates(
    scene: Scene,
    station: Station,
    n: int,
    seed: int,
    approach_angle_deg: float = DEFAULT_APPROACH_ANGLE_DEG,
) -> Candidates:
    """Samples antipodal grasps on every free instance.

    The random stream follows from the seed and the object's content alone. All instances of an
    object that lie on the same side get the same grasps, whatever else stands in the scene.

    Args:
        scene: the scene; its background objects get no grasps.
        station: gives the opening of the hand.
        n: grasps for each instance; there are fewer where the object has no more.
        seed: of the run.
        approach_angle_deg: largest angle between the approach and straight down, above 0 to
            180; with 180 the hand comes from anywhere.

    Raises:
        InvalidInputError: n is below 1, or the angle out of its range.
        UnknownNameError: the mesh file of an object is missing.
    """
    if n < 1:
        raise InvalidInputError(f"grasps per object is {n}; give 1 or more")
    if not 0.0 < approach_angle_deg <= 180.0:
        raise InvalidInputError(
            f"approach angle is {approach_angle_deg:g} degrees; give more than 0, at most 180"
        )
    wanted: dict[str, tuple[str, ApproachCone | None]] = {}
    for name, instance in scene.instances.items():
        cone = _approach_cone(scene, station, name, approach_angle_deg)
        wanted[name] = instance.object, cone
    sampled = {
        (object, cone): _sample_object(scene, station, object, n, seed, cone)
        for object, cone in dict.fromkeys(wanted.values())
    }
    return join_candidates({name: sampled[key] for name, key in wanted.items()})


def _approach_cone(
    scene: Scene, station: Station, instance: str, angle_deg: float
) -> ApproachCone | None:
    """The cone about straight down, seen from an instance; None if it holds every direction."""
    if angle_deg == 180.0:
        return None
    X_WO = station.document.X_WS.matrix() @ scene.X_SO(instance)
    x, y, z = np.round(-X_WO[2, :3], DOWN_DIGITS) + 0.0  # no negative zeros
    return ApproachCone((x, y, z), np.deg2rad(angle_deg))


def _sample_object(
    scene: Scene, station: Station, name: str, n: int, seed: int, cone: ApproachCone | None
) -> GraspSet:
    from burg_drake.grasping.antipodal import sample_antipodal

    entry: ObjectEntry = scene.library.entry(name)
    return distinct(
        sample_antipodal(
            scene.library.surface(name),
            n,
            rng_from("antipodal", seed, entry.build),
            friction=entry.friction,
            opening=station.hand.opening,
            approach_cone=cone,
            object=name,
        )
    )
