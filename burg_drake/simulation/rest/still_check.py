"""How far the objects of a scene move when it is simulated: hardly, once it has settled."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, SimulationError
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.simulation.rest.displacement import (
    Displacement,
    depth_in_table,
    displacement_from_document,
)
from burg_drake.simulation.rest.rolling_resistance import resist_rolling
from burg_drake.station.checks import DEEPEST
from burg_drake.station.diagram import StationDiagram, build_station_diagram, touching
from burg_drake.station.document import ENGINES, Engine, StationLike, as_station

STILL_DISTANCE = 5e-4
"""A settled scene moves by less than this [m] ..."""
STILL_ANGLE = float(np.deg2rad(0.1))
"""... and this [rad] in `STILL_DURATION`."""
STILL_DURATION = 5.0
"""Simulated to tell whether a scene is still [s]."""


def stillness(
    scene: SceneLike,
    station: StationLike,
    *,
    duration: float = STILL_DURATION,
    engine: Engine | str = ENGINES["reference"],
) -> Mapping[str, Displacement]:
    """Simulates a scene as it stands, without the robot, and tells how far each object moves.

    The world is that of `build_station_diagram` with this engine, and resists rolling, which
    trials do not.

    An object that touches nothing but the table may sink straight into it, as far as the table
    yields to what stands on it: that is no movement. `settle_scene` lifts such objects onto the
    table, and they sink in again.

    Args:
        scene: the scene.
        station: table, pose of the board and obstacles.
        duration: simulated time [s].
        engine: how time is stepped.

    Returns:
        By free instance: how far it is at the end from where the document places it, without how
        far it has sunk into the table if it stands there alone.

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
    try:
        simulator.AdvanceTo(duration)
    except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
        raise SimulationError(
            f"{scene.path}: the scene cannot be simulated: {' '.join(str(error).split())}"
        ) from error
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    beside = touching(built, [*built.free.values(), *built.fixed.values()])
    return {
        name: displacement_from_document(
            built, name, X_WO if built.free[name] in beside else _lifted(built, name, X_WO)
        )
        for name, X_WO in poses(built, context).items()
    }


def _lifted(built: StationDiagram, name: str, X_WO: Array) -> Array:
    """`X_WO` without how far the instance has sunk straight into the table since the start."""
    center_of_mass = np.array((*built.scene.entry(name).mass_properties.center_of_mass, 1.0))
    lowered = float(((built.X_WO(name) - X_WO) @ center_of_mass)[2])
    sunk = min(lowered, depth_in_table(built.scene, X_WO, name), DEEPEST)
    lifted = X_WO.copy()
    lifted[2, 3] += max(0.0, sunk)
    return lifted


def poses(built: StationDiagram, context: Context) -> dict[str, Array]:
    """Where the free instances are: (4, 4) poses in the world by name.

    Args:
        built: the scene.
        context: of its plant.
    """
    return {
        name: built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(index)).GetAsMatrix4()
        for name, index in built.free.items()
    }


def is_still(displacements: Mapping[str, Displacement]) -> bool:
    """Whether nothing has moved further than a settled scene may."""
    return all(map(has_stayed, displacements.values()))


def has_stayed(moved: Displacement) -> bool:
    """Whether an object of a settled scene may move so far in `STILL_DURATION`."""
    return moved.distance < STILL_DISTANCE and moved.angle < STILL_ANGLE
