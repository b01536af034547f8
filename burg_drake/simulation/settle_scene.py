"""Brings a scene to rest: piles, heaps, and objects that are placed in the air."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    ProximityProperties,
    RoleAssign,
)
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError, SimulationError
from burg_drake.core.frames import Array, inverse, rotation_angle
from burg_drake.core.schema import Pose
from burg_drake.scene.scene import Scene
from burg_drake.scene.validate import TOUCH_TOLERANCE
from burg_drake.simulation.settle import BodySpeed, RestCriterion, settle
from burg_drake.station.check import overlaps
from burg_drake.station.diagram import StationDiagram, build_station_diagram
from burg_drake.station.engine import ENGINES, Engine
from burg_drake.station.hollow import is_mesh
from burg_drake.station.station import Station
from burg_drake.station.surroundings import DISSIPATION

DEFAULT_TIME_LIMIT = 10.0
"""Simulated time allowed [s]."""
STRETCH = 0.5
"""What falls off the table is looked for at this interval [s]."""
BRAKING_TIME = 0.5
"""Turning is braked with this time constant [s], as by air and rolling resistance, which Drake does
not have: a marble would roll, and a banana that hangs on its tips would swing, for ever."""
MODULUS = 1e7
"""Hydroelastic modulus of objects while they settle [Pa]. In trials they are rigid, and touch each
other at single points: a block on a block then never comes to rest, and walks off."""
STILL = (5e-5, float(np.deg2rad(0.02)))
"""An object that moves [m] and turns [rad] by less keeps the pose that it had in the document."""


@dataclass(frozen=True)
class Displacement:
    """How far an object was moved.

    Attributes:
        distance: of its centre of mass [m].
        angle: of its rotation [rad].
    """

    distance: float
    angle: float


@dataclass(frozen=True)
class SettledScene:
    """A scene after a while.

    Attributes:
        scene: the scene with all free objects where they are now, but without the fallen ones.
        duration: simulated time [s].
        moving: objects that still move at the end, and how fast; none if all came to rest.
        fallen: objects that fell off the table, in the document's order.
        displacements: of the objects that did not fall, by instance.
    """

    scene: Scene
    duration: float
    moving: Mapping[str, BodySpeed]
    fallen: tuple[str, ...]
    displacements: Mapping[str, Displacement]

    @property
    def at_rest(self) -> bool:
        """All objects are on the table, at rest."""
        return not self.moving and not self.fallen


def settle_scene(
    scene: Scene,
    station: Station,
    *,
    engine: Engine = ENGINES["standard"],
    time_limit: float = DEFAULT_TIME_LIMIT,
    progress: Callable[[float, int], None] | None = None,
) -> SettledScene:
    """Simulates the objects of a scene until they are at rest.

    Background objects and the station's obstacles stay where they are. The robot is left out. What
    has fallen below the table's top is taken out of the simulation. Turning is braked a little, see
    `BRAKING_TIME`; what is at rest does not notice.

    Args:
        scene: the scene; objects may be in the air, but not in one another.
        station: table and pose of the board.
        engine: how time is stepped.
        time_limit: simulated time allowed [s].
        progress: called now and then with the simulated time since the last call [s] and how many
            objects still move.

    Returns:
        The settled scene. Whatever has not moved keeps its pose to the last digit; other poses are
        rounded to a micrometre and a ten thousandth of a degree.

    Raises:
        InvalidInputError: objects overlap or are below the table's top at the start, or the time
            limit is not above 0.
        SimulationError: Drake cannot step the scene.
    """
    if not 0.0 < time_limit < np.inf:
        raise InvalidInputError(f"time limit is {time_limit:g} s; give more than 0")
    built = build_station_diagram(scene, station, robot="none", engine=engine)
    _require_above(built)
    _require_apart(built)
    simulator = Simulator(built.diagram)
    _soften(built, simulator.get_mutable_context())
    try:
        duration, moving, fallen = _settle(simulator, built, time_limit, progress)
    except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
        raise SimulationError(
            f"{scene.path}: the scene cannot be simulated: {' '.join(str(error).split())}"
        ) from error
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    X_WO = {
        name: built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(index)).GetAsMatrix4()
        for name, index in built.free.items()
        if name not in fallen
    }
    return SettledScene(
        scene=_placed(built, X_WO),
        duration=duration,
        moving=moving,
        fallen=tuple(name for name in built.free if name in fallen),
        displacements={name: _displacement(built, name, X) for name, X in X_WO.items()},
    )


def _settle(
    simulator: Simulator,
    built: StationDiagram,
    time_limit: float,
    progress: Callable[[float, int], None] | None,
) -> tuple[float, dict[str, BodySpeed], set[str]]:
    """Time it took, what still moves, and what fell."""
    context = built.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    names = {index: name for name, index in built.free.items()}
    fallen: set[str] = set()
    criterion = RestCriterion()
    while True:
        now = simulator.get_context().get_time()
        watched = [index for index, name in names.items() if name not in fallen]
        settled = settle(
            simulator,
            built.plant,
            watched,
            min(STRETCH, time_limit - now),
            criterion,
            before_poll=partial(_brake, built, context, watched, criterion.poll),
        )
        for index in settled.moving:
            body = built.plant.get_body(index)
            p_WOcm = built.plant.EvalBodyPoseInWorld(context, body).multiply(body.default_com())
            if not np.isfinite(p_WOcm).all():
                raise RuntimeError(f"the pose of {names[index]!r} is not finite")
            if p_WOcm[2] < 0.0:
                fallen.add(names[index])
                body.Lock(context)
        moving = {names[i]: v for i, v in settled.moving.items() if names[i] not in fallen}
        before, now = now, simulator.get_context().get_time()
        if progress is not None:
            progress(now - before, len(moving))
        if settled.at_rest or now >= time_limit - 1e-9:
            return now, moving, fallen


def _brake(
    built: StationDiagram, context: Context, bodies: list[BodyIndex], interval: float
) -> None:
    """Takes from the turning of bodies about their centres of mass what an interval costs."""
    plant, lost = built.plant, -math.expm1(-interval / BRAKING_TIME)
    for index in bodies:
        body = plant.get_body(index)
        V_WO = plant.EvalBodySpatialVelocityInWorld(context, body)
        R_WO = plant.EvalBodyPoseInWorld(context, body).rotation()
        w_lost = lost * V_WO.rotational()
        v_lost = np.cross(w_lost, -(R_WO @ body.default_com()))  # of O, as Ocm keeps its velocity
        plant.SetFreeBodySpatialVelocity(context, body, V_WO - SpatialVelocity(w_lost, v_lost))


def _soften(built: StationDiagram, context: Context) -> None:
    """Makes objects compliant, so that they meet on patches; see `MODULUS`. Rigid meshes stay."""
    graph, plant = built.scene_graph, built.plant
    graph_context = graph.GetMyMutableContextFromRoot(context)
    inspector = graph.model_inspector()
    bodies = {**built.free, **built.fixed}
    for name in (*built.scene.instances, *built.scene.background):
        if is_mesh(built.scene, name):
            continue
        body = plant.get_body(bodies[name])
        for geometry in plant.GetCollisionGeometriesForBody(body):
            rigid = inspector.GetProximityProperties(geometry)
            box = inspector.GetObbInGeometryFrame(geometry)
            hint = rigid.GetPropertyOrDefault(
                "hydroelastic", "resolution_hint", float(np.min(box.half_width()))
            )
            properties = ProximityProperties()
            AddCompliantHydroelasticProperties(hint, MODULUS, properties)
            AddContactMaterial(
                dissipation=DISSIPATION,
                friction=rigid.GetProperty("material", "coulomb_friction"),
                properties=properties,
            )
            graph.AssignRole(
                graph_context, plant.get_source_id(), geometry, properties, RoleAssign.kReplace
            )


def _require_above(built: StationDiagram) -> None:
    for name in built.free:
        center_of_mass = (*built.scene.entry(name).mass_properties.center_of_mass, 1.0)
        height = float((built.X_WO(name) @ center_of_mass)[2])
        if height < 0.0:
            raise InvalidInputError(
                f"{built.scene.path}: {name!r} starts {-height * 1e3:.0f} mm below the table's top;"
                " move it up"
            )


def _require_apart(built: StationDiagram) -> None:
    for (a, b), depth in overlaps(built).items():
        if depth > TOUCH_TOLERANCE:
            raise InvalidInputError(
                f"{built.scene.path}: {a!r} and {b!r} overlap by {depth * 1e3:.1f} mm, and would"
                " burst apart; move them apart"
            )


def _displacement(built: StationDiagram, name: str, X_WO: Array) -> Displacement:
    X_OO = inverse(built.X_WO(name)) @ X_WO
    p_OOcm = np.array(built.scene.entry(name).mass_properties.center_of_mass)
    moved = X_OO[:3, :3] @ p_OOcm + X_OO[:3, 3] - p_OOcm
    return Displacement(float(np.linalg.norm(moved)), float(rotation_angle(X_OO[:3, :3])))


def _placed(built: StationDiagram, X_WO: Mapping[str, Array]) -> Scene:
    """The scene with free objects at these poses (4, 4), and without those that have none."""
    scene = built.scene
    X_SW = inverse(built.station.document.X_WS.matrix())
    instances = []
    for name, X in X_WO.items():
        instance, moved = scene.instances[name], _displacement(built, name, X)
        if moved.distance > STILL[0] or moved.angle > STILL[1]:
            instance = dataclasses.replace(instance, X_SO=_readable(X_SW @ X))
        instances.append(instance)
    document = dataclasses.replace(scene.document, instances=tuple(instances))
    return Scene(document, scene.library, scene.path)


def _readable(X_SO: Array) -> Pose:
    """A pose to the micrometre and a ten thousandth of a degree, as people can read it."""
    exact = Pose.from_matrix(X_SO)
    x, y, z = (round(value, 6) + 0.0 for value in exact.translation)
    roll, pitch, yaw = (round(value, 4) + 0.0 for value in exact.rpy_deg or (0.0, 0.0, 0.0))
    return Pose((x, y, z), rpy_deg=(roll, pitch, yaw))
