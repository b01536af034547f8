"""Counts of clear and reachable grasps for each object, and acceptance of a scene by them.

Grasps are sampled on an object that stands alone on the table, so they do not depend on its place.
A page shows these counts while a scene is composed; sampled scenes are accepted by them.
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
from burg_drake.evaluation.judge import arm_reach, build_hand_clearance
from burg_drake.evaluation.settings import DEFAULT_APPROACH_ANGLE_DEG, SamplingSettings
from burg_drake.motion import Reach, reach_without_objects
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Instance, Scene, SceneDocument, SceneLike, as_scene
from burg_drake.station import GraspMotion, Station, StationLike, as_station


@dataclass(frozen=True, eq=False)
class ObjectGrasps:
    """Grasps of an object that stands alone on the table.

    Attributes:
        X_OG: (N, 4, 4) grasps in the object frame; the open hand overlaps neither object nor table,
            and its pads touch the object antipodally.
        width: (N,) distance between the contacts [m].
        note: reason for fewer grasps than requested; "" if there are enough.
    """

    X_OG: Array
    width: Array
    note: str


def object_grasps(
    library: ObjectLibrary, object: str, X_WO: Array, station: Station, n: int, seed: int = 0
) -> ObjectGrasps:
    """Samples antipodal grasps from above on an object that stands alone on the table, like
    `sample_grasps` with fewer tries; uses the user's cache.

    Args:
        library: library with the object.
        object: name of the object.
        X_WO: (4, 4) pose of the object; position and turn about the vertical do not matter.
        station: station with hand and table.
        n: number of grasps.
        seed: seed of the random numbers.

    Raises:
        InvalidInputError: n is below 1.
        UnknownNameError: the library has no such object, or a mesh file is missing.
        MeshError: a mesh file is damaged.
    """
    cache_version = 2  # Increase if this code yields other grasps for the same arguments.
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
    """(4, 4) pose of an object in which the direction `down_O` (3,) points straight down.

    The turn about the vertical is arbitrary but fixed.
    """
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
    screen, _ = build_hand_clearance(alone, bare)
    # 40 antipodal grasps are tried for each wanted one, which bounds the time to a second
    sampler = ObjectSampler(library, station, 40 * n, seed, SamplingSettings())
    tried = sampler.sample(object, approach_cone_from_above(X_WO, DEFAULT_APPROACH_ANGLE_DEG))
    accept = sampler.clearance_filter(object, screen, object, X_WO)
    rows = np.empty(0, dtype=np.intp)
    first = 0
    while len(rows) < n and first < len(tried):
        batch = tried.X_OG[first : first + 256]
        rows = np.append(rows, first + np.flatnonzero(accept(batch)))
        first += len(batch)
    rows = rows[:n]
    provenance = {**tried.provenance, "tried": first, "blocked": dict(accept.blocked)}
    note = shortfall_note(object, n, {**provenance, "target": object}, len(rows)).encode()
    return {
        "X_OG": tried.X_OG[rows],
        "width": tried.width[rows],
        "note": np.frombuffer(note, np.uint8),
    }


Blockers = NDArray[np.object_]

ARM_LIMITS = "the arm"
"""Blocker name for joint limits and self-collision; instance names have no space."""


@dataclass(frozen=True)
class GraspCount:
    """Counts of the grasps of one object.

    Attributes:
        sampled: sampled grasps, free of collisions when the object stands alone on the table.
        clear: sampled grasps at which the open hand overlaps nothing in the scene.
        reachable: clear grasps that the arm can execute all the way; None if it was not checked.
        in_the_way: counts of the blocked grasps by blocker, most frequent first: instances,
            obstacles of the station, `table`, or `ARM_LIMITS`. Of several blockers of a grasp, the
            one counts that would also block in an emptier scene.
        note: reason for fewer sampled grasps than requested; "" if there are enough.
    """

    sampled: int
    clear: int
    reachable: int | None
    in_the_way: Mapping[str, int]
    note: str = ""

    @property
    def good(self) -> int:
        """Number of reachable grasps; of clear grasps if no arm was checked."""
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
    """Counts grasps of a scene's free objects. The objects may overlap.

    Args:
        scene: the scene.
        station: hand, arm and surroundings.
        only: names of instances, or of objects for all their instances; all if None.
        grasps_per_object: grasps that are sampled for each object.
        reach: whether to check the arm, if there is one, which takes about ten times as long as the
            hand alone.
        motion: approach and retreat of the hand; the station's if None.
        exact: whether Drake's collision checker confirms each reachable grasp. Without this it
            takes half the time, and about one grasp in a hundred is counted wrong. See `reach`.
        seed: seed of the samples.

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
    """Yields the counts of each object for the hand, then again for hand and arm.

    The counts for the hand of all objects come first, with `reachable` None.

    Args:
        scene, station, grasps_per_object, reach, motion, exact, seed: see `count_grasps`.
        names: names of instances in the order in which counts are wanted.

    Yields:
        Names and counts.

    Raises:
        InvalidInputError, UnknownNameError, MeshError: see `count_grasps`; a collision of the arm
            at home is found after the counts for the hand.
    """
    if grasps_per_object < 1:
        raise InvalidInputError(f"grasps per object is {grasps_per_object}; give 1 or more")
    if not names:
        return
    hand, X_WO = build_hand_clearance(scene, station)
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
        any_blocker = blocker.copy()
        any_blocker[clear] = [_blocker_of(verdict, others) for verdict in verdicts]
        yield name, _count_object(grasps, blocker, any_blocker)


def _blocker_of(verdict: Reach, others: set[str]) -> str:
    """The body or limit that blocks the arm; "" if none."""
    if verdict.outcome is None:
        return ""
    body = verdict.blocker.rpartition(" vs ")[2]
    return body if body in others else ARM_LIMITS


def _count_object(
    grasps: ObjectGrasps, hand_blocker: Blockers, any_blocker: Blockers | None
) -> GraspCount:
    """Counts grasps by what blocks them.

    Args:
        grasps: N grasps of the object.
        hand_blocker: (N,) blocker of the hand; "" if none.
        any_blocker: (N,) blocker of hand or arm; None if the arm was not checked.
    """
    last = hand_blocker if any_blocker is None else any_blocker
    return GraspCount(
        sampled=len(hand_blocker),
        clear=int((hand_blocker == "").sum()),
        reachable=None if any_blocker is None else int((any_blocker == "").sum()),
        in_the_way=dict(Counter(name for name in last.tolist() if name).most_common()),
        note=grasps.note,
    )


def within_reach(scene: SceneLike, station: StationLike) -> tuple[str, ...]:
    """Objects that are out of the arm's reach.

    An object is within reach if the arm can execute one of 24 sampled grasps from home to the end
    of the lift, among the station's obstacles but without other objects; so the answer does not
    change when other objects are moved. Collisions of the carried object are ignored. An object
    without collision-free grasps is out of reach. `count_grasps` counts what other objects block.

    Args:
        scene: the scene; objects may overlap.
        station: station with an arm; the arm is prepared once per process for the same `Station`.

    Returns:
        Names of free instances out of reach, in the scene's order.

    Raises:
        InvalidInputError: the station has no arm, or the arm collides in its home posture.
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
    # for most objects one of the first few is reachable
    for batch in (slice(0, 2), slice(2, 6), slice(6, 12), slice(12, 24)):
        found = reach.check_all([""] * len(X_WG[batch]), X_WG[batch], grasps.width[batch])
        if any(verdict.outcome is None for verdict in found):
            return True
    return False


def clear_grasp_counts(
    scene: SceneLike, station: StationLike, *, grasps_per_object: int = 50
) -> dict[str, int]:
    """Number of collision-free grasps of the open hand for each free object, without the arm.

    Args:
        scene: the scene; objects may overlap.
        station: station with the hand.
        grasps_per_object: number of grasps sampled for each object.

    Returns:
        Counts by instance, in the scene's order.

    Raises:
        InvalidInputError, UnknownNameError, MeshError: see `count_grasps`.
    """
    scene, station = as_scene(scene), as_station(station)
    counts = count_grasps(scene, station, grasps_per_object=grasps_per_object, reach=False)
    return {name: count.clear for name, count in counts.items()}
