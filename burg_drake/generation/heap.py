"""Brings a heap to rest: what came to lie beyond the board, or creeps, is dropped once more.

All objects fall and are relaxed with a quarter of the friction, and kept on the board; what creeps
after that is relaxed with less and less. What still does, or is where a scene may have nothing,
hangs anew where there is room, and falls onto the others, which hold still meanwhile.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import SimulationError
from burg_drake.core.documents import Pose
from burg_drake.scene.arrangement import Heap, ObjectShapes, OccupiedBoard
from burg_drake.scene.document import Scene
from burg_drake.simulation.rest import RELAXING, predict_drift, relax
from burg_drake.simulation.settling import (
    BoardEdgeGuard,
    drop_onto_scene,
    placed_scene,
    reduce_friction_of,
)
from burg_drake.station.checks import SceneCheck
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.document import Station, boxes_in_scene

DROPS = 10
"""So often is something dropped once more, at most."""
SLACKS = (0.25, 0.15, 0.1)
"""Shares of friction that are left while an object relaxes: the first time, and when it creeps."""
MARGIN, MARGIN_SHARE = 0.03, 0.07
"""At first objects are kept so far within the board's edge [m], or by such a share of its shorter
side: when they relax, they still shift."""
EDGE = 0.003
"""What relaxes, or is dropped once more, is kept so far within the board's edge [m]."""
RELAXING_TIME = 1.0
"""Time that may be stepped in each round of relaxing [s]."""


@dataclass(frozen=True)
class SettledHeap:
    """What became of a heap.

    Attributes:
        scene: the heap.
        faulty: objects that creep, or lie where they may not; none if it is a good heap.
        drops: how often something was dropped once more.
    """

    scene: Scene
    faulty: tuple[str, ...]
    drops: int


def settle_heap(
    scene: Scene,
    station: Station,
    check: SceneCheck,
    shapes: ObjectShapes,
    rng: np.random.Generator,
) -> SettledHeap:
    """Lets a heap fall, and come to rest on the board.

    Args:
        scene: objects that hang above the board.
        station: table and boxes.
        check: of that station.
        shapes: of the library's objects.
        rng: draws where something is dropped once more.

    Raises:
        SimulationError: Drake cannot step the scene.
    """
    settler = _HeapSettler(station, check, shapes)
    falling: Collection[str] = scene.instances
    margin = min(MARGIN, MARGIN_SHARE * min(scene.board.size))
    for drops in range(DROPS + 1):
        try:
            dropped = drop_onto_scene(scene, station, falling, shapes, margin)
            lost = scene.instances.keys() - dropped.instances.keys()
            scene = _with_missing(dropped, scene)
            scene, faulty = (scene, lost) if lost else settler.settled_or_faulty(scene)
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            raise SimulationError(
                f"{scene.path}: the heap cannot be simulated: {' '.join(str(error).split())}"
            ) from error
        if not faulty or drops == DROPS:
            break
        scene, falling, margin = settler.raised_again(scene, faulty, rng), faulty, EDGE
    return SettledHeap(scene, tuple(sorted(faulty)), drops)


@dataclass(frozen=True)
class _HeapSettler:
    """Brings one heap to rest, and says what is wrong with it."""

    station: Station
    check: SceneCheck
    shapes: ObjectShapes

    def settled_or_faulty(self, scene: Scene) -> tuple[Scene, Collection[str]]:
        """A heap that was relaxed, and what is wrong with it, if anything."""
        faulty = self._misplaced(scene)
        if faulty:
            return scene, faulty
        slack, moving = dict.fromkeys(scene.instances, SLACKS[0]), [*scene.instances]
        for share in (*SLACKS[1:], None):
            scene = self._relaxed(scene, slack, moving)
            faulty = self._misplaced(scene)
            if faulty:
                return scene, faulty
            built = build_station_diagram(scene, self.station, robot="none", engine=RELAXING)
            moving = list(predict_drift(built, once=share is not None).moving)
            if not moving or share is None:
                break
            slack |= dict.fromkeys(moving, share)
        return scene, moving

    def raised_again(
        self, scene: Scene, faulty: Collection[str], rng: np.random.Generator
    ) -> Scene:
        """The scene with its faulty objects where there is room above the others, large ones
        first."""
        heap = Heap(
            OccupiedBoard(scene.board, boxes_in_scene(self.station)),
            [self.shapes[one.object] for one in scene.instances.values()],
        )
        found = dict(scene.instances)
        for name, one in found.items():
            if name not in faulty:
                heap.add(self.shapes[one.object], scene.X_SO(name))
        sizes = {n: np.prod(np.ptp(self.shapes[found[n].object].corners, axis=0)) for n in faulty}
        for name in sorted(faulty, key=lambda name: (-sizes[name], name)):
            X_SO = heap.place_low(self.shapes[found[name].object], rng)
            if X_SO is not None:
                found[name] = replace(found[name], X_SO=Pose.readable(X_SO))
        document = replace(scene.document, instances=tuple(found.values()))
        return Scene(document, scene.library, scene.path)

    def _relaxed(self, scene: Scene, slack: Mapping[str, float], moving: Collection[str]) -> Scene:
        """A scene whose objects have come to rest with shares of their friction."""
        built = build_station_diagram(scene, self.station, robot="none", engine=RELAXING)
        reduce_friction_of(built, {built.free[name]: share for name, share in slack.items()})
        guard = BoardEdgeGuard(
            built, self.shapes, margin=EDGE, share=1.0
        )  # what gets slower is stopped
        relaxed = relax(built, moving, RELAXING_TIME, before_window=guard.push_back)
        return _with_missing(placed_scene(built, relaxed.X_WO, exact=relaxed.together), scene)

    def _misplaced(self, scene: Scene) -> set[str]:
        """Objects that are where a scene may have nothing."""
        return {issue.instance for issue in self.check.issues(scene) if issue.is_error}


def _with_missing(scene: Scene, before: Scene) -> Scene:
    """A scene with all objects of an earlier one: what fell off the table hangs where it did, and
    in the order of that."""
    instances = tuple(scene.instances.get(name, one) for name, one in before.instances.items())
    return Scene(replace(scene.document, instances=instances), scene.library, scene.path)
