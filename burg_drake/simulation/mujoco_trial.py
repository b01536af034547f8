"""The floating-hand trial on MuJoCo: the same phases and decisions as in Drake, other physics.

Screen, phases, force, speed, geometry, masses and friction are those of `HandTrial`. Objects touch
as their convex pieces, also at the pads, and pads are beds of springs (`export`). The target alone
can move, as in Drake's trials; if it meets or leans on another object, the trial runs in the
complete world.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import trimesh
from pydrake.geometry import Meshcat

from burg_drake.core import Array, InvalidInputError
from burg_drake.export import lay_out
from burg_drake.objects import ObjectEntry, ObjectLibrary
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.simulation.grasp_trial import HandAloneTrial, HandTrial
from burg_drake.simulation.hand_carrier import FloatingCarrier, check_count, copy_object_poses
from burg_drake.simulation.mujoco_world import MujocoWorld, load_mujoco
from burg_drake.simulation.settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.simulation.shaking import ShakeCarrier, ShakeExecution
from burg_drake.simulation.trial_execution import Execution
from burg_drake.simulation.trial_result import TrialResult
from burg_drake.simulation.trial_world import check_overrides
from burg_drake.station import (
    ENGINES,
    Engine,
    FloatingHand,
    GraspMotion,
    Station,
    StationDiagram,
    StationLike,
    as_engine,
    as_station,
    build_station_diagram,
    read_hand,
)


def check_objects(scene: Scene) -> None:
    """Rejects objects without convex pieces for collisions.

    Raises:
        InvalidInputError: an object has neither a primitive nor pieces, or a flat piece.
    """
    checked = set()
    for instance in {**scene.instances, **scene.background}.values():
        if instance.object not in checked:
            checked.add(instance.object)
            _check_object(scene.library, instance.object)


def _check_object(library: ObjectLibrary, name: str) -> None:
    entry: ObjectEntry = library.entry(name)
    if entry.contact.kind == "primitive" and entry.contact.primitive is not None:
        return
    if not entry.pieces:
        raise InvalidInputError(
            f"object {name!r} has no convex pieces, which engine mujoco needs; build it again"
            " without a contact geometry of its own, or evaluate with an engine of Drake"
        )
    for piece in entry.pieces:
        path = library.path(piece)
        try:
            points = np.asarray(trimesh.load_mesh(path, process=False).vertices, dtype=float)
        except Exception as error:  # the reader raises whatever it stumbles over
            raise library.damaged(path) from error
        extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if len(points) < 4 or extents[-1] <= 1e-7 * extents[0]:
            raise InvalidInputError(
                f"object {name!r}: convex piece {path.name} has no volume ({len(points)} points),"
                " which engine mujoco needs; build the object again"
            )


class WorldPicture:
    """Shows worlds of one scene in Meshcat.

    Args:
        scene, station: scene and station of the worlds.
        meshcat: the viewer.

    Attributes:
        diagram: the diagram that publishes to the viewer.
    """

    def __init__(self, scene: Scene, station: Station, meshcat: Meshcat) -> None:
        self.diagram = build_station_diagram(scene, station, robot="hand", meshcat=meshcat)
        self._hand = FloatingHand(self.diagram)
        self._context = self.diagram.diagram.CreateDefaultContext()

    def show(self, world: MujocoWorld) -> None:
        """Publishes the current state of a world."""
        plant = self.diagram.plant
        plant_context = plant.GetMyMutableContextFromRoot(self._context)
        self._hand.place(plant_context, world.X_WG())
        fingers = world.robot_positions("hand")
        plant.SetPositions(plant_context, plant.GetModelInstanceByName("hand"), fingers)
        copy_object_poses(self.diagram, plant_context, world)
        self._context.SetTime(world.time)
        self.diagram.diagram.ForcedPublish(self._context)


class MujocoCarrier(FloatingCarrier[MujocoWorld]):
    """Moves the floating hand to the grasp, if an approach is given, and away from it; see
    `Carrier` and `LiftCarrier`. Here commands change at every step.

    Args:
        world, paths, lift_clearance, approach, target: see `FloatingCarrier`.
    """

    _length = 0.0  # Metres along the current segment.
    _step: int | None = None

    def approach(self) -> None:
        """Starts the approach."""
        assert self._approach is not None
        self._is_approaching, self._length, self._step = True, self._approach.length, 0

    def close(self) -> None:
        """Closes the fingers; without an approach they have been closing from the start."""
        if self._approach is not None:
            self._is_approaching, self._step = False, None
            self._world.command_lift(self._approach.length, 0.0, 0.0)
            self._world.close_hand()

    def lift(self, segment_index: int, check: int) -> None:
        """Commands one interval. Before another segment, the hand comes to rest in one more."""
        segment = self.segments[segment_index]
        if self._begin_segment(segment_index):
            self._world.turn_lift(segment.direction_W)
        self._length = segment.length
        self._step = check * self.approach_steps

    def stop(self) -> None:
        """Holds the hand at the end of the last segment."""
        self._step = None
        self._world.command_lift(self.segments[self._segment_index].length, 0.0, 0.0)

    def advance_to(self, time: float) -> None:
        """Advances the simulation; on a segment, with a command for the end of each step."""
        world = self._world
        steps = round((time - world.time) / world.engine.time_step)
        if self._step is None:
            world.advance(steps)
            return
        for _ in range(steps):
            _, before = self._command(self._step)
            self._step += 1
            travelled, speed = self._command(self._step)
            world.command_lift(travelled, speed, (speed - before) / world.engine.time_step)
            world.advance(1)

    def travelled(self) -> float:
        """Position of the joint [m]."""
        return self._world.travelled()

    def _command(self, step: int) -> tuple[float, float]:
        """Position [m] and speed [m/s] at the end of a step: the hand accelerates over half of the
        path and brakes over the other half."""
        length = self._length
        steps = check_count(length, self._world.settings) * self.approach_steps
        share = min(1.0, step / steps)
        left = min(share, 1.0 - share)
        gone = 2.0 * left * left
        duration = steps * self._world.engine.time_step
        return length * (gone if share < 0.5 else 1.0 - gone), 4.0 * length * left / duration


class MujocoTrial(HandAloneTrial[MujocoWorld]):
    """Executes grasps of one scene with the hand alone, on MuJoCo.

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: engine with the time step, or the name of a preset.
        settings: phases of a trial.
        motion: the hand's motion around the grasp; by default that of the settings, else the
            station's.
        lock: use single-target worlds, where the result is the same.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        scene, station, engine, settings, motion, clearance: see `GraspTrial`.

    Raises:
        MissingDependencyError: MuJoCo is not installed.
        InvalidInputError: the engine is Drake; an object has no convex pieces; a pad of the hand is
            not flat, or its fingers are more than two joints.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        engine: Engine | str = ENGINES["mujoco"],
        settings: TrialSettings = DEFAULT_TRIAL,
        motion: GraspMotion | None = None,
        lock: bool = True,
        meshcat: Meshcat | None = None,
    ) -> None:
        scene, station, engine = as_scene(scene), as_station(station), as_engine(engine)
        mujoco = load_mujoco()
        if engine.simulator != "mujoco":
            raise InvalidInputError(
                f"engine {engine.name!r} has simulator {engine.simulator}; a MujocoTrial needs an"
                " engine with simulator mujoco"
            )
        self.failures = (*self.failures, mujoco.FatalError)
        check_objects(scene)
        super().__init__(scene, station, engine, settings=settings, motion=motion, lock=lock)
        self._picture = None if meshcat is None else WorldPicture(scene, station, meshcat)
        self._layout, self._parts = lay_out(scene, station), read_hand(self._plain_diagram)

    @property
    def diagram(self) -> StationDiagram:
        """The Drake diagram of scene and hand that shows the trials."""
        return self._plain_diagram if self._picture is None else self._picture.diagram

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
        lift: float | None = None,
    ) -> TrialResult:
        """Executes one grasp; see `HandTrial.run`."""
        X_WG = self.X_WG(instance, X_OG)
        check_overrides(friction, mass)
        paths = self.lift_paths(X_WG, lift)

        def begin(world: MujocoWorld) -> Execution:
            self._use_world(world)
            approach, target = self.approach_of(X_WG), world.free[instance]
            X_WF = X_WG if approach is None else self.pregrasp_of(X_WG)
            closed = self.closed_before_contact(instance, X_WG) if approach is None else None
            direction_W = (approach or paths[0]).direction_W
            world.prepare(instance, X_WF, closed, direction_W, friction=friction, mass=mass)
            moving = set(world.free.values())
            if self.settings.shake is not None:
                return ShakeExecution(world, target, moving, ShakeCarrier(world, target))
            lift_clearance = partial(self.lift_clearance, instance)
            carrier = MujocoCarrier(world, paths, lift_clearance, approach, target)
            return Execution(world, target, moving, carrier)

        return self.execute(instance, X_WG, begin, friction=friction, mass=mass)

    def _build(self, alone: str | None) -> MujocoWorld:
        return MujocoWorld(
            self.scene,
            self.station,
            self._layout,
            self._parts,
            engine=self.engine,
            settings=self.settings,
            alone=alone,
            shown=None if self._picture is None else self._picture.show,
        )


def hand_trial_of(
    scene: SceneLike, station: StationLike, engine: Engine | str, **more: Any
) -> HandTrial | MujocoTrial:
    """Builds the trial of an engine; see `HandTrial` and `MujocoTrial`.

    Args:
        scene, station: the scene and the station.
        engine: the engine, or the name of a preset.
        more: `settings`, `motion`, `lock`.
    """
    engine = as_engine(engine)
    kind = HandTrial if engine.simulator == "drake" else MujocoTrial
    return kind(scene, station, engine=engine, **more)
