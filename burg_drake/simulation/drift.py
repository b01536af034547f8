"""How far the objects of a simulated scene move, and a prediction of which ones drift.

Creep in Drake has nearly the same speed whatever the time step: within 2 % in steps of 1 and 10 ms.
0.2 s distinguish most stable objects from drifting ones. Objects that lean on others or rock are
simulated for up to 2 s, while all else is frozen; that predicts 0.9 to 1.05 times the motion.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator

from burg_drake.core import Array, InvalidInputError, SimulationError
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.simulation.contacts import contact_islands, freeze_bodies
from burg_drake.simulation.falling import free_poses, is_below
from burg_drake.simulation.relaxation import resist_rolling
from burg_drake.simulation.rest_criterion import (
    BodySpeed,
    Displacement,
    center_pose,
    depth_in_table,
    displacement_from_document,
    mean_speed,
)
from burg_drake.station import (
    ENGINES,
    MAX_SINK_DEPTH,
    Engine,
    StationDiagram,
    StationLike,
    as_station,
    build_station_diagram,
    touching_bodies,
)


class DriftLimits:
    """How far an object of a settled scene may move."""

    distance = 5e-4  # Metres.
    angle = float(np.deg2rad(0.1))  # Radians.
    duration = 5.0  # Seconds that are simulated to measure it.


def measure_drift(
    scene: SceneLike,
    station: StationLike,
    *,
    duration: float = DriftLimits.duration,
    engine: Engine | str = ENGINES["reference"],
) -> Mapping[str, Displacement]:
    """Simulates a scene without the robot, and measures how far each object moves.

    The world is that of `build_station_diagram` with this engine, and resists rolling, which trials
    do not.

    The depth by which an object that touches only the table sinks straight into the compliant table
    does not count as motion. `settle_scene` lifts such objects onto the table, and they sink in
    again.

    Args:
        scene: the scene.
        station: table, pose of the board and obstacles.
        duration: simulated time [s].
        engine: how time is stepped.

    Returns:
        Displacement of each free instance from its pose in the document, by name; without the depth
        it sank into the table if it touches nothing else.

    Raises:
        InvalidInputError: the duration is not above 0.
        SimulationError: Drake cannot step the scene.
    """
    if not 0.0 < duration < np.inf:
        raise InvalidInputError(f"duration is {duration:g} s; give more than 0")
    scene, station = as_scene(scene), as_station(station)
    built = build_station_diagram(scene, station, robot="none", engine=engine)
    simulator = Simulator(built.diagram)
    resist_rolling(built, simulator)
    with report_simulation_errors(scene):
        simulator.AdvanceTo(duration)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    beside = touching_bodies(built, [*built.free.values(), *built.fixed.values()])
    return {
        name: displacement_from_document(
            built, name, X_WO if built.free[name] in beside else _without_sinking(built, name, X_WO)
        )
        for name, X_WO in free_poses(built, context).items()
    }


@contextmanager
def report_simulation_errors(scene: Scene) -> Iterator[None]:
    """Reports errors of the simulator as a `SimulationError` that names the scene's file."""
    try:
        yield
    except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
        raise SimulationError(
            f"{scene.path}: the scene cannot be simulated: {' '.join(str(error).split())}"
        ) from error


def _without_sinking(built: StationDiagram, name: str, X_WO: Array) -> Array:
    """`X_WO` raised by the depth that the instance has sunk straight into the table."""
    center_of_mass = np.array((*built.scene.entry(name).mass_properties.center_of_mass, 1.0))
    lowered = float(((built.X_WO(name) - X_WO) @ center_of_mass)[2])
    sunk = min(lowered, depth_in_table(built.scene, X_WO, name), MAX_SINK_DEPTH)
    lifted = X_WO.copy()
    lifted[2, 3] += max(0.0, sunk)
    return lifted


def is_still(displacements: Mapping[str, Displacement]) -> bool:
    """Whether all displacements are within the limits of a settled scene."""
    return all(map(_has_stayed, displacements.values()))


def _has_stayed(moved: Displacement, share: float = 1.0) -> bool:
    """Whether a displacement is below a share of `DriftLimits`; False for NaN."""
    limits = DriftLimits
    return moved.distance < share * limits.distance and moved.angle < share * limits.angle


DRIFT_CHECK_TIMES = ((0.1, 0.2, 0.1), (0.2, 0.4, 0.4), (0.5, 1.0, 0.4), (1.0, 2.0, 0.8))
"""Start and end of each measurement in seconds, and the share of the motion allowed."""


@dataclass(frozen=True)
class DriftPrediction:
    """Predicted drift of a scene that is released.

    Attributes:
        moving: mean speed of each free object that would exceed `DriftLimits` within their
            duration, by name.
        X_WO: (4, 4) poses in the world of the free objects that are still on the table, by name:
            final poses of doubtful objects, else those of the document.
        doubtful: objects that were simulated until the end, and the objects that touch them.
    """

    moving: Mapping[str, BodySpeed]
    X_WO: Mapping[str, Array]
    doubtful: frozenset[str]

    @property
    def relative_speed(self) -> float:
        """Speed of the fastest object relative to the limit of a settled scene."""
        shares = [
            max(moved.speed / DriftLimits.distance, moved.turning / DriftLimits.angle)
            for moved in self.moving.values()
        ]
        return DriftLimits.duration * max(shares, default=0.0)


def predict_drift(
    built: StationDiagram, *, among: Collection[str] | None = None, once: bool = False
) -> DriftPrediction:
    """Simulates a scene from the poses in the documents, and predicts which objects drift.

    Args:
        built: the scene without a robot.
        among: free objects to simulate, with all objects that touch them; others are known to stay.
            All if None.
        once: stop at the first check at which an object drifts.

    Raises:
        RuntimeError, SystemExit: Drake failed.
    """
    drift = _DriftSimulation(built)
    drift.freeze_all_but(built.free if among is None else among)
    for start, end, share in DRIFT_CHECK_TIMES:
        shifts = drift.check_between(start, end)
        drift.freeze_all_but([n for n, shift in shifts.items() if not _has_stayed(shift, share)])
        if not drift.moving_objects or (once and not all(map(_has_stayed, shifts.values()))):
            break
    doubtful = frozenset(drift.moving_objects)
    kept = {name: built.X_WO(name) for name in built.free if name not in doubtful}
    last = DRIFT_CHECK_TIMES[-1][-1]
    moving = {
        n: _mean_speed(shifts[n]) for n in drift.moving_objects if not _has_stayed(shifts[n], last)
    }
    return DriftPrediction(moving, kept | drift.on_table(), doubtful)


class _DriftSimulation:
    """Simulation of a scene, with checks of its motion between two times."""

    def __init__(self, built: StationDiagram) -> None:
        self._built, self._plant = built, built.plant
        self._simulator = Simulator(built.diagram)
        self._root = self._simulator.get_mutable_context()
        self._context = self._plant.GetMyContextFromRoot(self._root)
        resist_rolling(built, self._simulator)

        self._islands = contact_islands(built)
        self._names = {index: name for name, index in built.free.items()}

    @property
    def moving_objects(self) -> list[str]:
        """Objects that are not frozen."""
        return [self._names[index] for island in self._islands for index in island]

    def freeze_all_but(self, names: Iterable[str]) -> None:
        """Freezes all objects except the named ones and the objects that touch them."""
        chosen = {self._built.free[name] for name in names}
        for island in self._islands:
            if chosen.isdisjoint(island):
                freeze_bodies(self._built, self._root, island)
        self._islands = [i for i in self._islands if not chosen.isdisjoint(i)]

    def check_between(self, start: float, end: float) -> dict[str, Displacement]:
        """Displacements of the moving objects, extrapolated from their speed from `start` to `end`
        [s]."""
        built, context = self._built, self._context
        bodies = {name: self._plant.get_body(built.free[name]) for name in self.moving_objects}
        self._simulator.AdvanceTo(start)
        before = {name: center_pose(body, context) for name, body in bodies.items()}
        self._simulator.AdvanceTo(end)
        X_WO, left, shifts = free_poses(built, context), DriftLimits.duration - end, {}
        for name, body in bodies.items():
            speed = mean_speed(before[name], center_pose(body, context), end - start)
            now = displacement_from_document(built, name, X_WO[name])
            shifts[name] = Displacement(
                now.distance + left * speed.speed, now.angle + left * speed.turning
            )
        return shifts

    def on_table(self) -> dict[str, Array]:
        """Poses in the world of the moving objects that are still on the table."""
        built, X_WO = self._built, free_poses(self._built, self._context)
        above = (
            n for n in self.moving_objects if not is_below(built, self._context, built.free[n])
        )
        return {name: X_WO[name] for name in above}


def _mean_speed(shift: Displacement) -> BodySpeed:
    time = DriftLimits.duration
    return BodySpeed(shift.distance / time, shift.angle / time)
