"""Settles a heap of objects; what lies beyond the board's edge, or creeps, is dropped again."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Pose, SimulationError
from burg_drake.scene import Heap, ObjectShapes, OccupiedBoard, Scene
from burg_drake.simulation import (
    RELAXING_ENGINE,
    BoardEdgeGuard,
    drop_onto_scene,
    placed_scene,
    predict_drift,
    reduce_friction_of,
    relax,
)
from burg_drake.station import SceneCheck, Station, build_station_diagram, obstacle_corners

BOARD_EDGE_MARGIN = 0.003
"""Metres within the board's edge for objects that relax or are dropped again."""


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
    max_drops = 10  # Times that objects are dropped again.
    settler = _HeapSettler(station, check, shapes)
    falling: Collection[str] = scene.instances
    # Objects still shift when they relax.
    margin = min(0.03, 0.07 * min(scene.board.size))
    for drops in range(max_drops + 1):
        try:
            dropped = drop_onto_scene(scene, station, falling, shapes, margin)
            lost = scene.instances.keys() - dropped.instances.keys()
            scene = _restore_missing(dropped, scene)
            scene, faulty = (scene, lost) if lost else settler.settle(scene)
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            raise SimulationError(
                f"{scene.path}: the heap cannot be simulated: {' '.join(str(error).split())}"
            ) from error
        if not faulty or drops == max_drops:
            break
        scene, falling, margin = (
            settler.raise_faulty_objects(scene, faulty, rng),
            faulty,
            BOARD_EDGE_MARGIN,
        )
    return SettledHeap(scene, tuple(sorted(faulty)), drops)


@dataclass(frozen=True)
class _HeapSettler:
    """Brings one heap to rest, and says what is wrong with it."""

    station: Station
    check: SceneCheck
    shapes: ObjectShapes

    def settle(self, scene: Scene) -> tuple[Scene, Collection[str]]:
        """A heap that was relaxed, and what is wrong with it, if anything."""
        # Shares of friction while objects relax: at first, and when they creep.
        friction_shares = (0.25, 0.15, 0.1)
        faulty = self._misplaced_objects(scene)
        if faulty:
            return scene, faulty
        slack, moving = dict.fromkeys(scene.instances, friction_shares[0]), [*scene.instances]
        for share in (*friction_shares[1:], None):
            scene = self._relax(scene, slack, moving)
            faulty = self._misplaced_objects(scene)
            if faulty:
                return scene, faulty
            built = build_station_diagram(scene, self.station, robot="none", engine=RELAXING_ENGINE)
            moving = list(predict_drift(built, once=share is not None).moving)
            if not moving or share is None:
                break
            slack |= dict.fromkeys(moving, share)
        return scene, moving

    def raise_faulty_objects(
        self, scene: Scene, faulty: Collection[str], rng: np.random.Generator
    ) -> Scene:
        """The scene with its faulty objects where there is room above the others, large ones
        first."""
        heap = Heap(
            OccupiedBoard(scene.board, obstacle_corners(self.station)),
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

    def _relax(self, scene: Scene, slack: Mapping[str, float], moving: Collection[str]) -> Scene:
        """A scene whose objects have come to rest with shares of their friction."""
        built = build_station_diagram(scene, self.station, robot="none", engine=RELAXING_ENGINE)
        reduce_friction_of(built, {built.free[name]: share for name, share in slack.items()})
        # The guard stops what gets slower.
        guard = BoardEdgeGuard(built, self.shapes, margin=BOARD_EDGE_MARGIN, share=1.0)
        relaxed = relax(built, moving, 1.0, before_window=guard.push_back)
        return _restore_missing(placed_scene(built, relaxed.X_WO, exact=relaxed.together), scene)

    def _misplaced_objects(self, scene: Scene) -> set[str]:
        """Objects that are where a scene may have nothing."""
        return {issue.instance for issue in self.check.issues(scene) if issue.is_error}


def _restore_missing(scene: Scene, before: Scene) -> Scene:
    """A scene with all objects of an earlier one: what fell off the table hangs where it did, and
    in the order of that."""
    instances = tuple(scene.instances.get(name, one) for name, one in before.instances.items())
    return Scene(replace(scene.document, instances=instances), scene.library, scene.path)
