"""Settles a heap of objects; drops objects again that lie off the board or creep."""

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
"""Margin inside the board's edge for objects that relax or are dropped again, in metres."""


@dataclass(frozen=True)
class SettledHeap:
    """Result of settling a heap.

    Attributes:
        scene: the heap.
        faulty: objects that creep or are misplaced; empty for a good heap.
        drops: number of times that objects were dropped again.
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
    """Drops a heap onto the board and lets it come to rest.

    Args:
        scene: objects above the board.
        station: station with table and obstacles.
        check: scene check of the station.
        shapes: shapes of the library's objects.
        rng: random numbers for the positions of objects that are dropped again.

    Raises:
        SimulationError: Drake cannot step the scene.
    """
    max_drops = 10
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
        scene = settler.raise_faulty_objects(scene, faulty, rng)
        falling, margin = faulty, BOARD_EDGE_MARGIN
    return SettledHeap(scene, tuple(sorted(faulty)), drops)


@dataclass(frozen=True)
class _HeapSettler:
    """Brings one heap to rest, and finds its faulty objects."""

    station: Station
    check: SceneCheck
    shapes: ObjectShapes

    def settle(self, scene: Scene) -> tuple[Scene, Collection[str]]:
        """Relaxes the heap; also returns its faulty objects."""
        # Factors of friction while objects relax: at first, and when they creep.
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
        """Moves faulty objects to free space above the others, large ones first."""
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
            X_SO = heap.place_lowest(self.shapes[found[name].object], rng)
            if X_SO is not None:
                found[name] = replace(found[name], X_SO=Pose.readable(X_SO))
        document = replace(scene.document, instances=tuple(found.values()))
        return Scene(document, scene.library, scene.path)

    def _relax(self, scene: Scene, slack: Mapping[str, float], moving: Collection[str]) -> Scene:
        """Lets the objects come to rest with reduced friction."""
        built = build_station_diagram(scene, self.station, robot="none", engine=RELAXING_ENGINE)
        reduce_friction_of(built, {built.free[name]: share for name, share in slack.items()})
        # The guard stops objects that slow down.
        guard = BoardEdgeGuard(built, self.shapes, margin=BOARD_EDGE_MARGIN, share=1.0)
        relaxed = relax(built, moving, 1.0, before_window=guard.push_back)
        return _restore_missing(placed_scene(built, relaxed.X_WO, exact=relaxed.together), scene)

    def _misplaced_objects(self, scene: Scene) -> set[str]:
        """Objects whose pose breaks a rule of the scene check."""
        return {issue.instance for issue in self.check.issues(scene) if issue.is_error}


def _restore_missing(scene: Scene, before: Scene) -> Scene:
    """Restores objects that fell off the table at their earlier poses, in the earlier order."""
    instances = tuple(scene.instances.get(name, one) for name, one in before.instances.items())
    return Scene(replace(scene.document, instances=instances), scene.library, scene.path)
