"""Things that stand on the table beside the objects of a scene, and have no label."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from burg_drake.core import (
    Array,
    InvalidInputError,
    inverse,
    make_pose,
    rot_z,
    transform_points,
)
from burg_drake.core.documents import Pose
from burg_drake.dataset.appearance.appearance import Appearance, Distractor
from burg_drake.dataset.appearance.settings import AppearanceSettings
from burg_drake.dataset.views import PlacedBox, box_around
from burg_drake.objects.library import ObjectEntry, ObjectLibrary, load_library
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station, boxes_in_scene

CORNERS = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
TRIES = 40
"""Places that are looked at for each."""
GAP = 0.01
"""Between a distractor and everything else [m]."""
BASE_RADIUS = 0.20
"""Around the axis of an arm's base, which nothing is put into [m]; that of the Panda reaches
0.14 m."""


@dataclass(frozen=True, eq=False)
class FreeTable:
    """The table of a scene, seen from above in the scene frame.

    Attributes:
        X_ST: (4, 4) of the table's middle.
        half: (2,) half of its extents [m].
        rectangles: lower and upper corners (2, 2) of what is kept free of, [m].
        circles: middles and radii (3,) of the same [m].
    """

    X_ST: Array
    half: Array
    rectangles: list[Array]
    circles: list[Array]

    def place(self, radius: float, rng: np.random.Generator) -> Array | None:
        """(2,) middle of a circle that is free, which is taken then; None if none is found."""
        room = self.half - radius
        if (room <= 0.0).any():
            return None
        for _ in range(TRIES):
            p_T = np.array([*rng.uniform(-room, room), 0.0])
            p = transform_points(self.X_ST, p_T[None])[0, :2]
            if self._is_free(p, radius + GAP):
                self.circles.append(np.array([*p, radius]))
                return np.asarray(p)
        return None

    def _is_free(self, p: Array, radius: float) -> bool:
        for lower, upper in self.rectangles:
            if np.linalg.norm(p - np.clip(p, lower, upper)) < radius:
                return False
        return all(np.hypot(*(p - one[:2])) >= radius + one[2] for one in self.circles)


def place_distractors(
    settings: AppearanceSettings, scene: Scene, station: Station, rng: np.random.Generator
) -> tuple[Distractor, ...]:
    """Draws things and their places: on the table in a stable pose, their bounding circles clear of
    those of the scene's objects, of obstacles, the arm's base and, unless allowed, the board. What
    the scene itself has of the library is none.

    Raises:
        UnknownNameError: there is no such library.
        InvalidInputError: no object of it has a stable pose.
    """
    low, high = settings.distractors
    count = int(rng.integers(low, high + 1))
    if not count:
        return ()
    library = distractor_library(settings.distractor_library)
    labelled = {one.object for one in (*scene.instances.values(), *scene.background.values())}
    if library.root.resolve() != scene.library.root.resolve():
        labelled = set()
    usable = sorted(n for n, e in library.objects.items() if e.stable_poses and n not in labelled)
    if not usable:
        raise InvalidInputError(
            f"library {library.root} has no object that could be a distractor: it needs a stable"
            " pose, and must not be in the scene"
        )
    table = free_table(scene, station, settings.distractors_on_board)
    found = []
    for name in (usable[int(k)] for k in rng.integers(len(usable), size=count)):
        entry = library.entry(name)
        chance = np.array([pose.probability for pose in entry.stable_poses])
        pose = int(rng.choice(len(chance), p=chance / chance.sum()))
        X_SO = make_pose(rot_z(rng.uniform(-np.pi, np.pi))) @ entry.X_SO(pose)
        middle, radius = bounding_circle(entry, X_SO)
        place = table.place(radius, rng)
        if place is not None:
            X_SO[:2, 3] += place - middle
            found.append(Distractor(object=name, X_SO=Pose.readable(X_SO)))
    return tuple(found)


def distractor_boxes(look: Appearance) -> tuple[PlacedBox, ...]:
    """Boxes around the things of a look, in the scene frame.

    Raises:
        UnknownNameError: there is no such library, or no such object in it.
    """
    if not look.distractors:
        return ()
    library = distractor_library(look.library)
    return tuple(
        box_around(f"distractor {k}", library.entry(one.object), one.X_SO.matrix())
        for k, one in enumerate(look.distractors)
    )


@lru_cache(maxsize=4)
def distractor_library(reference: str) -> ObjectLibrary:
    """The library of distractors; kept, as to read one takes longer than all else."""
    return load_library(reference)


def free_table(scene: Scene, station: Station, on_board: bool) -> FreeTable:
    """The table as a scene leaves it."""
    document = station.document
    X_SW = inverse(document.X_WS.matrix())
    boxes = [corners[:, :2] for corners in boxes_in_scene(station)]
    rectangles = [np.array([box.min(axis=0), box.max(axis=0)]) for box in boxes]
    if not on_board:
        rectangles.append(np.array([(0.0, 0.0), scene.board.size]))
    circles = []
    for name in (*scene.instances, *scene.background):
        middle, radius = bounding_circle(scene.entry(name), scene.X_SO(name))
        circles.append(np.array([*middle, radius]))
    if document.arm is not None:
        p_SA = transform_points(X_SW, document.arm.X_WA.matrix()[:3, 3][None])[0]
        circles.append(np.array([*p_SA[:2], BASE_RADIUS]))
    X_ST = X_SW @ make_pose(p_AB=(*document.table.center, 0.0))
    return FreeTable(X_ST, np.array(document.table.size[:2]) / 2, rectangles, circles)


def bounding_circle(entry: ObjectEntry, X_SO: Array) -> tuple[Array, float]:
    """Middle (2,) and radius of a circle that an object stays within, seen from above [m]: around
    the corners of its bounding box."""
    lower, upper = np.array(entry.lower), np.array(entry.upper)
    corners = transform_points(X_SO, lower + CORNERS * (upper - lower))[:, :2]
    middle = corners.mean(axis=0)
    return middle, float(np.linalg.norm(corners - middle, axis=1).max())
