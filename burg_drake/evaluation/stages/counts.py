"""How many grasps of each object of a scene are clear and reachable, and what is in the way of the
others: what a page tells while a scene is composed, and what sampled scenes are accepted by.

Every object brings the same grasps to every scene, those that hand and object allow when it stands
on the table alone (`object_grasps`), so that counts before and after a move compare. Verdicts are
those of `evaluation.reach`: the same screen, the same arm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError
from burg_drake.evaluation.candidates import ObjectGrasps, chosen_instances, object_grasps
from burg_drake.evaluation.stages.screening import arm_reach, hand_alone
from burg_drake.motion.reach import Reach
from burg_drake.scene.document import Scene, SceneLike, as_scene
from burg_drake.station.document import GraspMotion, Station, StationLike, as_station

Blockers = NDArray[np.object_]

THE_ARM = "the arm"
"""Stands among what is in the way for the arm's own limits: its range, its joints, its links among
each other. No instance goes by a name with a space."""


@dataclass(frozen=True)
class GraspCount:
    """What becomes of the grasps of one object.

    Attributes:
        sampled: grasps that hand and object allow when it stands on the table alone.
        clear: those at which the open hand overlaps nothing.
        reachable: clear ones that the arm can execute, all the way; None if it was not asked.
        in_the_way: of the others, numbers by what is in the way, the most first: instances,
            obstacles of the station, `table`, or `THE_ARM`. Where several things are, the one
            counts that would be in the way in an emptier scene, too.
        note: why fewer grasps were sampled than asked, in words; "" if not fewer were.
    """

    sampled: int
    clear: int
    reachable: int | None
    in_the_way: Mapping[str, int]
    note: str = ""

    @property
    def good(self) -> int:
        """Reachable grasps; clear ones where no arm was asked."""
        return self.clear if self.reachable is None else self.reachable


def count_grasps(
    scene: SceneLike,
    station: StationLike,
    *,
    only: Iterable[str] | None = None,
    grasps_per_object: int = 50,
    reach: bool = True,
    motion: GraspMotion | None = None,
    exact: bool = True,
    seed: int = 0,
) -> dict[str, GraspCount]:
    """Counts grasps of a scene's free objects, which need not be sound: overlaps are tolerated.

    Args:
        scene: what stands where.
        station: hand, arm and surroundings.
        only: names of instances, or of objects for all their instances; all if None.
        grasps_per_object: grasps that are sampled for each object.
        reach: whether to ask the arm, which takes some ten times as long as the hand alone; a
            station without an arm is never asked.
        motion: how the hand goes to a grasp and away from it; as the station says if None.
        exact: whether Drake's collision checker sees each yes of the arm; without, it takes half
            the time, and one grasp in some hundred is counted wrong. See `reach`.
        seed: of the samples.

    Returns:
        Counts by instance, in the scene's order.

    Raises:
        InvalidInputError: the arm collides with something in its home posture, or the number of
            grasps is below 1.
        UnknownNameError: no such instance or object, or a mesh file is missing.
        MeshError: a mesh file is damaged.
    """
    scene, station = as_scene(scene), as_station(station)
    names = chosen_instances(scene, only)
    found = dict(
        grasp_counts(
            *(scene, station, names),
            grasps_per_object=grasps_per_object,
            reach=reach,
            motion=motion,
            exact=exact,
            seed=seed,
        )
    )
    return {name: found[name] for name in scene.instances if name in found}


def grasp_counts(
    scene: Scene,
    station: Station,
    names: Sequence[str],
    *,
    grasps_per_object: int = 50,
    reach: bool = True,
    motion: GraspMotion | None = None,
    exact: bool = True,
    seed: int = 0,
) -> Iterator[tuple[str, GraspCount]]:
    """Counts as they come: what the hand says of each object at once, with `reachable` None; then
    each object again when the arm was asked.

    Args:
        scene, station, grasps_per_object, reach, motion, exact, seed: see `count_grasps`.
        names: of instances, those first whose counts are wanted first.

    Yields:
        Names and counts.

    Raises:
        InvalidInputError, UnknownNameError, MeshError: see `count_grasps`; that the arm collides at
            home is found when the hand's counts are out.
    """
    if grasps_per_object < 1:
        raise InvalidInputError(f"grasps per object is {grasps_per_object}; give 1 or more")
    if not names:
        return
    hand, X_WO = hand_alone(scene, station)
    placed = []
    for name in names:
        object = scene.instance(name).object
        grasps = object_grasps(scene.library, object, X_WO[name], station, grasps_per_object, seed)
        X_WG = X_WO[name] @ grasps.X_OG
        blocker = hand.measure(name, X_WG).blocker.astype(np.object_)
        yield name, _count(grasps, blocker, None)
        placed.append((name, grasps, X_WG, blocker))
    if not reach or station.document.arm is None:
        return
    arm = arm_reach(scene, station, motion or station.document.motion, exact=exact)
    others = {*scene.instances, *scene.background, *station.document.background, "table"}
    for name, grasps, X_WG, blocker in placed:
        clear = np.flatnonzero(blocker == "")
        verdicts = arm.check_all([name] * len(clear), X_WG[clear], grasps.width[clear])
        hindrance = blocker.copy()
        hindrance[clear] = [_blocker_of(verdict, others) for verdict in verdicts]
        yield name, _count(grasps, blocker, hindrance)


def _blocker_of(verdict: Reach, others: set[str]) -> str:
    """What hinders the arm; "" if nothing does."""
    if verdict.outcome is None:
        return ""
    body = verdict.blocker.rpartition(" vs ")[2]
    return body if body in others else THE_ARM


def _count(grasps: ObjectGrasps, blocker: Blockers, hindrance: Blockers | None) -> GraspCount:
    """What hand (N,) and arm (N,) say of grasps; None where the arm was not asked."""
    last = blocker if hindrance is None else hindrance
    return GraspCount(
        sampled=len(blocker),
        clear=int((blocker == "").sum()),
        reachable=None if hindrance is None else int((hindrance == "").sum()),
        in_the_way=dict(Counter(name for name in last.tolist() if name).most_common()),
        note=grasps.note,
    )
