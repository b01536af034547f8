"""Counts of clear and reachable grasps for each object, and acceptance of a scene by them.

Grasps of an object are sampled as if it stood on the table alone, so they are the same wherever it
stands. A page shows these counts while a scene is composed; sampled scenes are accepted by them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from burg_drake.core import (
    Array,
    Arrays,
    InvalidInputError,
    Pose,
    cached,
    content_hash,
    dump_document,
    make_pose,
    plain_data,
    referenced_files,
)
from burg_drake.evaluation.candidates import chosen_instances
from burg_drake.evaluation.grasp_sets.sampling import (
    ObjectSampler,
    approach_cone_from_above,
    shortfall_note,
)
from burg_drake.evaluation.judge import arm_reach, hand_alone
from burg_drake.evaluation.settings import DEFAULT_APPROACH_ANGLE_DEG, SamplingSettings
from burg_drake.motion import Reach, reach_without_objects
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Instance, Scene, SceneDocument, SceneLike, as_scene
from burg_drake.station import GraspMotion, Station, StationLike, as_station


@dataclass(frozen=True, eq=False)
class ObjectGrasps:
    """Grasps of an object that stands on the table alone.

    Attributes:
        X_OG: (N, 4, 4) grasps in the object frame; the open hand overlaps neither object nor table,
            and its pads touch the object antipodally.
        width: (N,) distance between the contacts [m].
        note: why there are fewer than asked; "" if there are not fewer.
    """

    X_OG: Array
    width: Array
    note: str


def object_grasps(
    library: ObjectLibrary, object: str, X_WO: Array, station: Station, n: int, seed: int = 0
) -> ObjectGrasps:
    """Samples antipodal grasps from above on an object that stands on the table alone, as
    `sample_grasps` does, but with fewer tries; what was sampled before comes from the user's cache.

    Args:
        library: has the object.
        object: its name.
        X_WO: (4, 4) how it stands; where, and how it is turned about the vertical, does not matter.
        station: has hand and table.
        n: number of grasps.
        seed: of the random numbers.

    Raises:
        InvalidInputError: n is below 1.
        UnknownNameError: the library has no such object, or a mesh file is missing.
        MeshError: a mesh file is damaged.
    """
    cache_version = 2  # Raise it when this code gives other grasps for the same arguments.
    library.entry(object)
    # turns below a twentieth of a degree and changes in height below 1 mm keep the cached grasps
    down_O = np.round((0.0, 0.0, -1.0) @ X_WO[:3, :3], 3) + 0.0
    height = 0.001 * round(float(X_WO[2, 3]) / 0.001)
    files = [station.hand_model, *referenced_files(station.hand_model, station.packages)]
    hand = content_hash(dump_document(station.hand), files)
    asked = content_hash(
        *(cache_version, library.content[object], hand, plain_data(station.document.table)),
        *(down_O, height, n, seed),
    )
    found = cached(
        "object-grasps",
        asked,
        lambda: _sample_alone(library, object, _upright_pose(down_O, height), station, n, seed),
    )
    return ObjectGrasps(found["X_OG"], found["width"], found["note"].tobytes().decode())


def _upright_pose(down_O: Array, height: float) -> Array:
    """(4, 4) pose of an object with a direction (3,) of its frame straight down, turned about the
    vertical in any one way."""
    turn, _ = Rotation.align_vectors([(0.0, 0.0, -1.0)], [down_O])
    return make_pose(turn.as_matrix(), (0.0, 0.0, height))


def _sample_alone(
    library: ObjectLibrary, object: str, X_WO: Array, station: Station, n: int, seed: int
) -> Arrays:
    x, y, *_ = station.document.table.center
    X_WO = make_pose(X_WO[:3, :3], (x, y, X_WO[2, 3]))
    bare = replace(station, document=replace(station.document, X_WS=Pose(), background={}))
    placed = Instance(object=object, X_SO=Pose.from_matrix(X_WO))
    document = SceneDocument(name=object, library=str(library.root), instances=(placed,))
    alone = Scene(document, library, library.root)
    screen, _ = hand_alone(alone, bare)
    # 40 antipodal grasps are tried for each wanted one, which bounds the time to a second
    sampler = ObjectSampler(library, station, 40 * n, seed, SamplingSettings())
    tried = sampler(object, approach_cone_from_above(X_WO, DEFAULT_APPROACH_ANGLE_DEG))
    test = sampler.clear_test(object, screen, object, X_WO)
    rows = np.empty(0, dtype=np.intp)
    first = 0
    while len(rows) < n and first < len(tried):
        some = tried.X_OG[first : first + 256]
        rows = np.append(rows, first + np.flatnonzero(test(some)))
        first += len(some)
    rows = rows[:n]
    provenance = {**tried.provenance, "tried": first, "blocked": dict(test.blocked)}
    note = shortfall_note(object, n, {**provenance, "target": object}, len(rows)).encode()
    return {
        "X_OG": tried.X_OG[rows],
        "width": tried.width[rows],
        "note": np.frombuffer(note, np.uint8),
    }


Blockers = NDArray[np.object_]

ARM_LIMITS = "the arm"
"""Counted as blocker for joint limits and self-collision; no instance has a space."""


@dataclass(frozen=True)
class GraspCount:
    """What becomes of the grasps of one object.

    Attributes:
        sampled: grasps that hand and object allow when it stands on the table alone.
        clear: those at which the open hand overlaps nothing.
        reachable: clear ones that the arm can execute, all the way; None if it was not asked.
        in_the_way: of the others, numbers by what is in the way, the most first: instances,
            obstacles of the station, `table`, or `ARM_LIMITS`. Where several things are, the one
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
        yield name, _count_object(grasps, blocker, None)
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
        yield name, _count_object(grasps, blocker, hindrance)


def _blocker_of(verdict: Reach, others: set[str]) -> str:
    """What hinders the arm; "" if nothing does."""
    if verdict.outcome is None:
        return ""
    body = verdict.blocker.rpartition(" vs ")[2]
    return body if body in others else ARM_LIMITS


def _count_object(
    grasps: ObjectGrasps, blocker: Blockers, hindrance: Blockers | None
) -> GraspCount:
    """What hand (N,) and arm (N,) say of grasps; None where the arm was not asked."""
    last = blocker if hindrance is None else hindrance
    return GraspCount(
        sampled=len(blocker),
        clear=int((blocker == "").sum()),
        reachable=None if hindrance is None else int((hindrance == "").sum()),
        in_the_way=dict(Counter(name for name in last.tolist() if name).most_common()),
        note=grasps.note,
    )


def within_reach(scene: SceneLike, station: StationLike) -> tuple[str, ...]:
    """Objects that are out of the arm's reach.

    An object is within reach if the arm can execute one of 24 sampled grasps, all the way from
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
    grasps = object_grasps(scene.library, object, X_WO, station, 24)
    X_WG = X_WO @ grasps.X_OG
    # the arm can execute one of the first few for most objects
    for some in (slice(0, 2), slice(2, 6), slice(6, 12), slice(12, 24)):
        found = reach.check_all([""] * len(X_WG[some]), X_WG[some], grasps.width[some])
        if any(verdict.outcome is None for verdict in found):
            return True
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
