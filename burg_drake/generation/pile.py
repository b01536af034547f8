"""Piles up a heap: what came to lie beyond the board, or creeps, is dropped once more.

All objects fall within walls at first. Then the heap is relaxed without them, with half the
friction; what creeps after that, with less and less. What still does, or is where a scene may have
nothing, hangs anew where there is room, and falls onto the others, which hold still meanwhile.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core.errors import SimulationError
from burg_drake.core.schema import Pose
from burg_drake.scene.arrange_heap import Heap
from burg_drake.scene.arrangement import Occupied
from burg_drake.scene.object_shapes import ObjectShapes
from burg_drake.scene.scene import Scene
from burg_drake.simulation.creep import creep
from burg_drake.simulation.land import land
from burg_drake.simulation.placed_scene import placed_scene
from burg_drake.simulation.relax import RELAXING, relax
from burg_drake.simulation.slack import slacken_bodies
from burg_drake.station.boxes import boxes_in_scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.scene_check import SceneCheck
from burg_drake.station.station import Station

DROPS = 10
"""So often is something dropped once more, at most."""
SLACKS = (0.5, 0.25, 0.125)
"""Shares of friction that are left while an object relaxes: the first time, and when it creeps."""
RELAXING_TIME = 1.0
"""Time that may be stepped in each round of relaxing [s]."""


@dataclass(frozen=True)
class Piled:
    """What became of a heap.

    Attributes:
        scene: the heap.
        faulty: objects that creep, or lie where they may not; none if it is a good heap.
        drops: how often something was dropped once more.
    """

    scene: Scene
    faulty: tuple[str, ...]
    drops: int


def pile(
    scene: Scene,
    station: Station,
    check: SceneCheck,
    shapes: ObjectShapes,
    rng: np.random.Generator,
) -> Piled:
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
    falling: Collection[str] = scene.instances
    for drops in range(DROPS + 1):
        try:
            landed = _with_lost(land(scene, station, falling), scene)
            scene, faulty = _rested(landed, station, check)
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            raise SimulationError(
                f"{scene.path}: the heap cannot be simulated: {' '.join(str(error).split())}"
            ) from error
        if not faulty or drops == DROPS:
            break
        scene, falling = _hung_again(scene, station, faulty, shapes, rng), faulty
    return Piled(scene, tuple(sorted(faulty)), drops)


def _rested(scene: Scene, station: Station, check: SceneCheck) -> tuple[Scene, Collection[str]]:
    """A heap that was relaxed, and what is wrong with it, if anything."""
    slack, moving = dict.fromkeys(scene.instances, SLACKS[0]), [*scene.instances]
    for share in (*SLACKS[1:], None):
        scene = _relaxed(scene, station, slack, moving)
        faulty = {issue.instance for issue in check.issues(scene) if issue.is_error}
        if faulty:
            return scene, faulty
        built = build_station_diagram(scene, station, robot="none", engine=RELAXING)
        moving = list(creep(built).moving)
        if not moving or share is None:
            break
        slack |= dict.fromkeys(moving, share)
    return scene, moving


def _relaxed(
    scene: Scene, station: Station, slack: Mapping[str, float], moving: Collection[str]
) -> Scene:
    """A scene whose objects have come to rest with shares of their friction."""
    built = build_station_diagram(scene, station, robot="none", engine=RELAXING)
    slacken_bodies(built, {built.free[name]: share for name, share in slack.items()})
    relaxed = relax(built, moving, RELAXING_TIME)
    return _with_lost(placed_scene(built, relaxed.X_WO, exact=relaxed.together), scene)


def _with_lost(scene: Scene, before: Scene) -> Scene:
    """A scene with all objects of an earlier one: what fell off the table hangs where it did, and
    in the order of that."""
    instances = tuple(scene.instances.get(name, one) for name, one in before.instances.items())
    return Scene(replace(scene.document, instances=instances), scene.library, scene.path)


def _hung_again(
    scene: Scene,
    station: Station,
    faulty: Collection[str],
    shapes: ObjectShapes,
    rng: np.random.Generator,
) -> Scene:
    """The scene with its faulty objects where there is room above the others, large ones first."""
    heap = Heap(
        Occupied(scene.board, boxes_in_scene(station)),
        [shapes[one.object] for one in scene.instances.values()],
    )
    found = dict(scene.instances)
    for name, one in found.items():
        if name not in faulty:
            heap.stand(shapes[one.object], scene.X_SO(name))
    sizes = {n: np.prod(np.ptp(shapes[found[n].object].corners, axis=0)) for n in faulty}
    for name in sorted(faulty, key=lambda name: (-sizes[name], name)):
        X_SO = heap.hang_low(shapes[found[name].object], rng)
        if X_SO is not None:
            found[name] = replace(found[name], X_SO=Pose.readable(X_SO))
    document = replace(scene.document, instances=tuple(found.values()))
    return Scene(document, scene.library, scene.path)
