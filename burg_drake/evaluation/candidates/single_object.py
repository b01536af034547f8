"""Grasps of an object that stands on the table alone, the same wherever it stands: what is counted
while a scene is composed, and what the arm is asked about an object."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, Arrays, cached, content_hash, make_pose
from burg_drake.core.documents import Pose, dump_document, plain_data
from burg_drake.core.paths import named_files
from burg_drake.evaluation.candidates.approach_limits import from_above
from burg_drake.evaluation.candidates.sampling import ObjectSampler
from burg_drake.evaluation.candidates.sampling_settings import (
    DEFAULT_APPROACH_ANGLE_DEG,
    SamplingSettings,
)
from burg_drake.evaluation.candidates.sampling_shortfall import shortfall
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Instance, Scene, SceneDocument
from burg_drake.station.document import Station

VERSION = 2
"""Raised when the same arguments begin to give other grasps by the code of this file."""
DIRECTION_DIGITS = 3
"""Straight down in an object's frame is rounded to this, a twentieth of a degree: an object that is
turned about the vertical, or settles by a hair, keeps its grasps ..."""
HEIGHT_STEP = 0.001
"""... and so does one whose height changes by less than this, most often [m]."""
MAX_DRAWS_PER_GRASP = 40
"""Antipodal grasps that are tried for each that is wanted: an object that the hand hardly takes as
it stands gets fewer, within a second."""
CHUNK = 256
DOWN = (0.0, 0.0, -1.0)


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
    library.entry(object)
    down_O = np.round(DOWN @ X_WO[:3, :3], DIRECTION_DIGITS) + 0.0
    height = HEIGHT_STEP * round(float(X_WO[2, 3]) / HEIGHT_STEP)
    files = [station.hand_model, *named_files(station.hand_model, station.packages)]
    hand = content_hash(dump_document(station.hand), files)
    asked = content_hash(
        *(VERSION, library.content[object], hand, plain_data(station.document.table)),
        *(down_O, height, n, seed),
    )
    found = cached(
        "object-grasps",
        asked,
        lambda: _sampled(library, object, _standing(down_O, height), station, n, seed),
    )
    return ObjectGrasps(found["X_OG"], found["width"], found["note"].tobytes().decode())


def _standing(down_O: Array, height: float) -> Array:
    """(4, 4) pose of an object with a direction (3,) of its frame straight down, turned about the
    vertical in any one way."""
    turn, _ = Rotation.align_vectors([DOWN], [down_O])
    return make_pose(turn.as_matrix(), (0.0, 0.0, height))


def _sampled(
    library: ObjectLibrary, object: str, X_WO: Array, station: Station, n: int, seed: int
) -> Arrays:
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.station.diagram import build_station_diagram

    x, y, *_ = station.document.table.center
    X_WO = make_pose(X_WO[:3, :3], (x, y, X_WO[2, 3]))
    bare = replace(station, document=replace(station.document, X_WS=Pose(), background={}))
    placed = Instance(object=object, X_SO=Pose.from_matrix(X_WO))
    document = SceneDocument(name=object, library=str(library.root), instances=(placed,))
    alone = Scene(document, library, library.root)
    screen = HandClearance(build_station_diagram(alone, bare, robot="hand"))
    sampler = ObjectSampler(library, station, MAX_DRAWS_PER_GRASP * n, seed, SamplingSettings())
    tried = sampler(object, from_above(X_WO, DEFAULT_APPROACH_ANGLE_DEG))
    test = sampler.clear_test(object, screen, object, X_WO)
    rows = np.empty(0, dtype=np.intp)
    first = 0
    while len(rows) < n and first < len(tried):
        some = tried.X_OG[first : first + CHUNK]
        rows = np.append(rows, first + np.flatnonzero(test(some)))
        first += len(some)
    rows = rows[:n]
    provenance = {**tried.provenance, "tried": first, "blocked": dict(test.blocked)}
    note = shortfall(object, n, {**provenance, "target": object}, len(rows)).encode()
    return {
        "X_OG": tried.X_OG[rows],
        "width": tried.width[rows],
        "note": np.frombuffer(note, np.uint8),
    }
