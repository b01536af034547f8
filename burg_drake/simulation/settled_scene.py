"""Brings a scene to rest: stacks, heaps, and objects that are placed in the air."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.scene import SUNKEN_TOLERANCE, TOUCH_TOLERANCE, Scene, SceneLike, as_scene
from burg_drake.simulation.drift import predict_drift, report_simulation_errors
from burg_drake.simulation.falling import fall
from burg_drake.simulation.landing import has_moved, placed_scene, reduce_friction
from burg_drake.simulation.relaxation import RELAXING_ENGINE, TRIANGLE_RELAXING_ENGINE, relax
from burg_drake.simulation.rest_criterion import (
    BodySpeed,
    Displacement,
    depth_in_table,
    displacement_from_document,
)
from burg_drake.simulation.settings import SETTLING_ENGINE, SETTLING_TIME
from burg_drake.station import (
    ENGINES,
    MAX_SINK_DEPTH,
    Engine,
    Station,
    StationDiagram,
    StationLike,
    as_station,
    build_station_diagram,
    find_overlaps,
    instance_pose,
    touching_bodies,
)


@dataclass(frozen=True)
class SettledScene:
    """A simulated scene at rest, or at the time limit.

    Attributes:
        scene: the scene with the final poses of all free objects, without the fallen ones.
        duration: simulated time [s].
        moving: speed of each object that still moves at the end; empty if all came to rest.
            Includes objects that creep by more than 0.5 mm or 0.1 degrees in 5 s.
        fallen: objects that fell off the table, in the document's order.
        displacements: displacements of the objects that did not fall, by instance.
    """

    scene: Scene
    duration: float
    moving: Mapping[str, BodySpeed]
    fallen: tuple[str, ...]
    displacements: Mapping[str, Displacement]

    @property
    def at_rest(self) -> bool:
        """Whether all objects are at rest on the table."""
        return not self.moving and not self.fallen


def settle_scene(
    scene: SceneLike,
    station: StationLike,
    *,
    engine: Engine | str = ENGINES[SETTLING_ENGINE],
    time_limit: float = SETTLING_TIME,
    progress: Callable[[float, int], None] | None = None,
) -> SettledScene:
    """Simulates the objects of a scene until they are at rest.

    Background objects and the station's obstacles stay where they are. The robot is left out.
    Objects that fall below the table's top are removed. Rotation is damped with a time constant of
    0.1 s, which does not affect objects at rest.

    Example::

        settled = burg.settle_scene("breakfast.yaml", "panda_tabletop")
        burg.save_scene(settled.scene.document, "settled.yaml")

    Args:
        scene: the scene; objects may be in the air, but must not overlap.
        station: table and pose of the board.
        engine: how time is stepped.
        time_limit: simulated time allowed [s].
        progress: called regularly with the simulated time since the last call [s] and the number of
            objects that still move.

    Returns:
        The settled scene. Objects that have not moved keep their exact pose; other poses are
        rounded to a micrometre and a ten thousandth of a degree.

    Raises:
        InvalidInputError: objects overlap or are below the table's top at the start, or the time
            limit is not above 0.
        SimulationError: Drake cannot step the scene.
    """
    scene, station = as_scene(scene), as_station(station)
    if not 0.0 < time_limit < np.inf:
        raise InvalidInputError(f"time limit is {time_limit:g} s; give more than 0")
    built = build_station_diagram(scene, station, robot="none", engine=engine)
    _require_above_table(built)
    _require_no_overlap(built)
    with report_simulation_errors(scene):
        falling = fall(built, time_limit, progress)
        settled, moving = placed_scene(built, falling.X_WO), falling.moving
        if not moving:
            landed = settled
            for relaxing in (RELAXING_ENGINE, TRIANGLE_RELAXING_ENGINE):
                settled, moving = _bring_to_rest(landed, station, relaxing, progress)
                if not moving:
                    settled = _undo_sinking(settled, built)
                    break
    return SettledScene(
        scene=settled,
        duration=falling.duration,
        moving=moving,
        fallen=tuple(name for name in scene.instances if name not in settled.instances),
        displacements={
            name: displacement_from_document(built, name, instance_pose(settled, station, name))
            for name in settled.instances
        },
    )


def _bring_to_rest(
    scene: Scene,
    station: Station,
    engine: Engine,
    progress: Callable[[float, int], None] | None,
) -> tuple[Scene, Mapping[str, BodySpeed]]:
    """The scene at rest in its own diagram, and the speeds of objects that do not come to rest."""
    suspects: frozenset[str] | None = None
    last_speed = np.inf
    for rounds in itertools.count():
        built = build_station_diagram(scene, station, robot="none", engine=engine)
        predicted = predict_drift(built, among=suspects, once=rounds == 0)
        if progress is not None:
            progress(0.0, len(predicted.moving))
        if not predicted.moving:
            break
        before = scene
        if rounds == 0:
            reduce_friction(built)
            relaxed = relax(built, predicted.moving, time_limit=1.0)
            scene = placed_scene(built, relaxed.X_WO, exact=relaxed.together)
        else:
            beside = touching_bodies(built, built.free.values())
            exact = [name for name in predicted.doubtful if built.free[name] in beside]
            scene = placed_scene(built, predicted.X_WO, exact)
        suspects = predicted.doubtful & scene.instances.keys()
        # Objects that creep must get slower by 10 % in each round.
        slows_down = rounds <= 1 or predicted.relative_speed < 0.9 * last_speed
        is_unchanged = rounds > 0 and scene.document == before.document  # the first check is short
        # Objects may touch others after each round, so the diagram is built again.
        if rounds == 4 or not slows_down or is_unchanged:
            break
        last_speed = predicted.relative_speed
    return scene, predicted.moving


def _undo_sinking(settled: Scene, before: StationDiagram) -> Scene:
    """Lifts objects that stand alone and have sunk into the table by more than `SUNKEN_TOLERANCE`:
    a real table yields less, and in trials objects stand on feet.
    """
    built = build_station_diagram(settled, before.station, robot="none", engine=RELAXING_ENGINE)
    beside = touching_bodies(built, [*built.free.values(), *built.fixed.values()])
    X_WO = {name: built.X_WO(name) for name in built.free}
    for name, X in X_WO.items():
        depth = depth_in_table(settled, X, name)
        if depth > SUNKEN_TOLERANCE and built.free[name] not in beside:
            X[2, 3] += depth
    lifted = placed_scene(built, X_WO)
    kept = before.scene.instances
    instances = tuple(
        kept[name]
        if lifted.instances[name] != settled.instances[name] and not has_moved(before, name, X)
        else lifted.instances[name]
        for name, X in X_WO.items()
    )
    document = dataclasses.replace(lifted.document, instances=instances)
    return Scene(document, settled.library, settled.path)


def _require_above_table(built: StationDiagram) -> None:
    for name in built.free:
        center_of_mass = (*built.scene.entry(name).mass_properties.center_of_mass, 1.0)
        height = float((built.X_WO(name) @ center_of_mass)[2])
        if height < 0.0:
            raise InvalidInputError(
                f"{built.scene.path}: {name!r} starts {-height * 1e3:.0f} mm below the top of the"
                " table; move it up"
            )


def _require_no_overlap(built: StationDiagram) -> None:
    yielding = {"table", *built.station.document.background}
    for (a, b), depth in find_overlaps(built).items():
        if b == "table":  # as in `SceneCheck`: Drake's depths are off by up to a millimetre
            depth = min(depth, depth_in_table(built.scene, built.X_WO(a), a))
        if depth > (MAX_SINK_DEPTH if b in yielding else TOUCH_TOLERANCE):
            raise InvalidInputError(
                f"{built.scene.path}: {a!r} and {b!r} overlap by {depth * 1e3:.1f} mm and would be"
                " thrown apart; move them apart"
            )
