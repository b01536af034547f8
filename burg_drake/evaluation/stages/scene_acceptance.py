"""Whether a composed or sampled scene is of use: every object within the arm's reach, and enough
clear grasps of each. What a camera sees of them is in `cameras.projection.visibility`."""

from __future__ import annotations

from burg_drake.core import Array
from burg_drake.evaluation.candidates import object_grasps
from burg_drake.evaluation.stages.counts import count_grasps
from burg_drake.motion.workspace import reach_without_objects
from burg_drake.scene.document import Scene, SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station

TRIED = 24
"""Grasps of an object that the arm is asked for ..."""
ROUNDS = (2, 4, 6, 12)
"""... so many at a time, until it can execute one: most objects need no more than the first."""


def within_reach(scene: SceneLike, station: StationLike) -> tuple[str, ...]:
    """Objects that are out of the arm's reach.

    An object is within reach if the arm can execute one of `TRIED` sampled grasps, all the way from
    home to the end of the lift, as if it stood in its place alone: among the station's obstacles,
    but with no other object, so that the answer stays as it is when others are moved. What the hand
    carries is not looked at. An object that the hand takes nowhere as it stands is out of reach.
    What other objects block is counted by `count_grasps`.

    Args:
        scene: what stands where; it need not be sound.
        station: with an arm, which is made ready once a process for the same `Station`.

    Returns:
        Names of free instances, in the scene's order; none if all is well.

    Raises:
        InvalidInputError: the station has no arm, or one that collides in its home posture.
        UnknownNameError: a mesh file is missing.
        MeshError: a mesh file is damaged.
    """
    scene, station = as_scene(scene), as_station(station)
    X_WS = station.document.X_WS.matrix()
    reach_without_objects(station)  # refuses a station without an arm, whatever the scene
    return tuple(
        name
        for name, instance in scene.instances.items()
        if not _is_within_reach(scene, instance.object, X_WS @ scene.X_SO(name), station)
    )


def _is_within_reach(scene: Scene, object: str, X_WO: Array, station: Station) -> bool:
    reach = reach_without_objects(station)
    grasps = object_grasps(scene.library, object, X_WO, station, TRIED)
    X_WG = X_WO @ grasps.X_OG
    first = 0
    for count in ROUNDS:
        some = slice(first, first + count)
        found = reach.check_all([""] * len(X_WG[some]), X_WG[some], grasps.width[some])
        if any(verdict.outcome is None for verdict in found):
            return True
        first += count
    return False


def clear_grasp_counts(
    scene: SceneLike, station: StationLike, *, grasps_per_object: int = 50
) -> dict[str, int]:
    """How many grasps of each free object the open hand can take; the arm is not asked.

    Args:
        scene: what stands where; it need not be sound.
        station: has the hand.
        grasps_per_object: how many are sampled for each object.

    Returns:
        Numbers by instance, in the scene's order.

    Raises:
        InvalidInputError, UnknownNameError, MeshError: see `count_grasps`.
    """
    scene, station = as_scene(scene), as_station(station)
    counts = count_grasps(scene, station, grasps_per_object=grasps_per_object, reach=False)
    return {name: count.clear for name, count in counts.items()}
