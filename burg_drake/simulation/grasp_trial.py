"""Trials of grasps: their common base classes, and the trial of the floating hand.

A trial screens the open hand, chooses the world to run in, executes the phases there, and adds the
confidence to the result.

The open hand starts at the grasp, or at the pregrasp if `TrialSettings.approach` asks for it. After
Rudorfer et al., "BURG-Toolkit" (2022): a grasp in collision is rejected before any step; the
fingers close with a limited force until the grip settles; the hand rises by 0.30 m along world z,
unless another motion is given, and holds. A trial succeeds if both fingers still hold the target.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import ClassVar, Generic, TypeVar

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, Outcome, check_pose, make_pose
from burg_drake.grasping import Clearance, HandClearance
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.simulation.hand_carrier import HandLiftClearance, LiftCarrier, LiftPath
from burg_drake.simulation.settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.simulation.shaking import ShakeCarrier, ShakeExecution, require_single_object
from burg_drake.simulation.trial_execution import Execution, OtherTouched, SteppedWorld
from burg_drake.simulation.trial_result import (
    GripLoad,
    TrialResult,
    collision_result,
    confidence,
    simulation_failure_result,
)
from burg_drake.simulation.trial_world import TrialWorld, check_overrides
from burg_drake.station import (
    ENGINES,
    Engine,
    FloatingHand,
    GraspMotion,
    HandHandle,
    MountedHand,
    Robot,
    Station,
    StationDiagram,
    StationLike,
    as_drake_engine,
    as_station,
    build_station_diagram,
    instance_pose,
)

MAX_KEPT_WORLDS = 16
"""Cached single-target worlds; each takes 20 MB, and 0.1 s to build."""


W = TypeVar("W", bound=SteppedWorld)


class GraspTrial(ABC, Generic[W]):
    """Executes grasps in one scene.

    A trial runs in a single-target world, in which only the target can move, as that is cheaper. If
    the target or the robot meets another object there, the trial is repeated in the complete world.

    Args:
        scene: the scene.
        station: the station.
        engine: time step and contact settings.
        settings: phases of a trial.
        clearance: the screen of the open hand in the scene.
        motion: the hand's motion around the grasp; by default that of the settings, else the
            station's.
        lock: keep objects locked until something moving touches them, and use single-target worlds.

    Attributes:
        scene, station, engine, settings, clearance: as given.
        motion: the hand's motion around the grasp.
        failures: errors of the simulator; a trial that has one ends as `SIMULATION_FAILED`.
    """

    failures: tuple[type[BaseException], ...] = (RuntimeError, SystemExit)
    """Drake ends some failed checks by SystemExit."""

    def __init__(
        self,
        scene: Scene,
        station: Station,
        engine: Engine,
        *,
        settings: TrialSettings,
        clearance: HandClearance,
        motion: GraspMotion | None = None,
        lock: bool = True,
    ) -> None:
        self.scene, self.station, self.engine = scene, station, engine
        self.settings, self.clearance = settings, clearance
        self.motion = motion or settings.motion or station.document.motion
        self._lock = lock
        self._kept_worlds: dict[str, W | None] = {}
        self._complete: W | None = None
        self._world: W | None = None

    @property
    def world(self) -> W:
        """The world of the last trial; before the first trial the complete world."""
        return self._world or self.complete_world

    @property
    def complete_world(self) -> W:
        """The world in which all objects can move."""
        if self._complete is None:
            self._complete = self._build(None)
        return self._complete

    def final_poses(self) -> dict[str, Array]:
        """Poses (4, 4) of the free instances in the world at the end of the last trial.

        Only valid if that trial began: its open hand was clear.
        """
        poses = {name: self.world.X_WB(body) for name, body in self.world.free.items()}
        scene, station = self.scene, self.station
        return {
            name: poses[name] if name in poses else instance_pose(scene, station, name)
            for name in scene.instances
        }

    def X_WG(self, instance: str, X_OG: Array) -> Array:
        """A grasp (4, 4) of an instance in the world.

        Raises:
            InvalidInputError: `X_OG` is not a pose, or `instance` cannot be grasped.
        """
        return self.X_WO(instance) @ check_pose(X_OG, "X_OG")

    def X_WO(self, instance: str) -> Array:
        """Pose (4, 4) of an instance in the scene, in the world.

        Raises:
            InvalidInputError: `instance` cannot be grasped.
        """
        if instance not in self.scene.instances:
            free = ", ".join(self.scene.instances) or "(none)"
            raise InvalidInputError(
                f"{instance!r} is not a free instance of scene {self.scene.name!r}; free are {free}"
            )
        return instance_pose(self.scene, self.station, instance)

    def execute(
        self,
        instance: str,
        X_WG: Array,
        begin: Callable[[W], Execution],
        *,
        friction: float | None = None,
        mass: float | None = None,
        without_hull: bool = False,
    ) -> TrialResult:
        """Executes a grasp, if the open hand is clear at the grasp and at the start of its
        approach.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world.
            begin: prepares a world for the start of the trial.
            friction, mass: the target's; the library's if None.
            without_hull: avoid worlds in which parts of the robot meet the target's hull.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.
        """
        screen = self.clearance.check(instance, X_WG)
        if screen.outcome is not None:
            return collision_result(screen)
        start = self._screen_start(instance, X_WG)
        if start is not None and start.outcome is not None:
            return collision_result(replace(start, outcome=Outcome.HAND_COLLISION_APPROACH))
        world = self.world_of(instance)
        if without_hull and world.robot_meets_hull:
            world = self.complete_world
        try:
            try:
                found = begin(world).run()
            except OtherTouched:
                world = self.complete_world
                found = begin(world).run()
            margins = replace(found.margins, clearance=screen.clearance)
            load = self.grip_load(instance, X_WG, friction=friction, mass=mass)
            trust = None
            if self.settings.shake is None:
                trust = confidence(self.engine, found.outcome, margins, load)
            return replace(found, margins=margins, confidence=trust)
        except self.failures as error:
            world.invalidate()
            return simulation_failure_result(error, screen, world.time)

    def _screen_start(self, instance: str, X_WG: Array) -> Clearance | None:
        """The screen of the open hand at the start of the approach; None if the trial begins at the
        grasp, or an arm follows a plan."""
        return None

    def grip_load(
        self,
        instance: str,
        X_WG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
    ) -> GripLoad:
        """Load on the grip.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world.
            friction, mass: the target's; the library's if None.
        """
        entry = self.scene.entry(instance)
        X_WO = self.X_WO(instance)
        return GripLoad.of(
            X_WG,
            X_WO[:3, :3] @ entry.mass_properties.center_of_mass + X_WO[:3, 3],
            friction=entry.friction if friction is None else friction,
            force=self.station.hand.force,
            mass=entry.mass if mass is None else mass,
            acceleration=self.settings.acceleration,
        )

    def closed_before_contact(self, instance: str, X_WG: Array) -> float:
        """How far the fingers can close, from 0 (open) to 1, before contact. Considers the target's
        surface, which may protrude a little from the convex pieces that the clearance uses.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world at which the open hand is clear.
        """
        return max(0.0, self.clearance.free_travel(X_WG) - self._excess(instance))

    def closed_before_contacts(self, instance: str, X_WG: Array) -> Array:
        """The same (N,) for many grasps (N, 4, 4) together; see `HandClearance.free_travels`."""
        travels = self.clearance.free_travels(X_WG)
        return np.maximum(0.0, travels - self._excess(instance))

    def _excess(self, instance: str) -> float:
        """How far the target's surface protrudes from its pieces, as a share of the closing."""
        travel = min(abs(f.closed - f.open) for f in self.station.hand.fingers)
        return self.scene.entry(instance).contact.excess / travel

    def _use_world(self, world: W | None) -> W:
        """Makes a world the current one; the complete world if None."""
        self._world = self.complete_world if world is None else world
        return self._world

    def world_of(self, instance: str) -> W:
        """The cheapest usable world for trials of an instance."""
        if not self._lock:
            return self.complete_world
        if instance not in self._kept_worlds:
            world = self._build(instance)
            self._kept_worlds[instance] = world if world.is_usable() else None
        self._kept_worlds[instance] = found = self._kept_worlds.pop(instance)  # most recent last
        if len(self._kept_worlds) > MAX_KEPT_WORLDS:
            del self._kept_worlds[next(iter(self._kept_worlds))]
        return found or self.complete_world

    @abstractmethod
    def _build(self, alone: str | None) -> W:
        """Builds the world in which only object `alone` can move; the complete world if None."""


class DrakeTrial(GraspTrial[TrialWorld]):
    """A trial in Drake.

    Attributes:
        robot: moving part of the station.
        hand_type: class of the handle on the hand in its diagrams.
    """

    robot: ClassVar[Robot]
    hand_type: ClassVar[type[FloatingHand] | type[MountedHand]]
    _meshcat: Meshcat | None

    @property
    def diagram(self) -> StationDiagram:
        """The diagram of `world`."""
        return self.world.diagram

    @property
    def hand(self) -> HandHandle:
        """The hand in `world`."""
        return self.world.hand

    @property
    def context(self) -> Context:
        """The Context of the current or last trial."""
        return self.world.context

    def _build(self, alone: str | None) -> TrialWorld:
        diagram = build_station_diagram(
            self.scene,
            self.station,
            robot=self.robot,
            engine=self.engine,
            meshcat=self._meshcat,
            for_trials=alone or True,
        )
        return TrialWorld(diagram, self.hand_type(diagram), self.settings)


class HandAloneTrial(GraspTrial[W]):
    """A trial of the hand alone, in any engine.

    Args:
        scene, station, engine, settings, motion, lock: see `GraspTrial`.
    """

    def __init__(
        self,
        scene: Scene,
        station: Station,
        engine: Engine,
        *,
        settings: TrialSettings,
        motion: GraspMotion | None,
        lock: bool,
    ) -> None:
        if settings.shake is not None:
            require_single_object(scene, station)
        self._plain_diagram = build_station_diagram(scene, station, robot="hand")
        clearance = HandClearance(self._plain_diagram)
        super().__init__(
            scene, station, engine, settings=settings, clearance=clearance, motion=motion, lock=lock
        )
        self.lift_clearance = lru_cache(MAX_KEPT_WORLDS)(
            partial(HandLiftClearance, self._plain_diagram)
        )

    def lift_paths(self, X_WG: Array, lift: float | None = None) -> tuple[LiftPath, ...]:
        """Straight paths of the hand with the target: the retreat, if any, and the lift.

        Args:
            X_WG: (4, 4) grasp in the world.
            lift: length of the lift [m], in place of the motion's.

        Returns:
            One or two paths, each longer than 0.

        Raises:
            InvalidInputError: the hand would not move, or a length is invalid.
        """
        motion, height = self.motion, self.motion.lift_height if lift is None else lift
        if not 0.0 <= height < math.inf or motion.retreat + height <= 0.0:
            raise InvalidInputError(
                f"lift is {height:g} m and retreat {motion.retreat:g} m; give a finite lift of 0 or"
                " more, and above 0 if there is no retreat"
            )
        paths = LiftPath(-X_WG[:3, 2], motion.retreat), LiftPath(motion.direction_W, height)
        return tuple(path for path in paths if path.length > 0.0)

    def X_WG_start(self, X_WG: Array) -> Array:
        """Start pose (4, 4) of the hand for a grasp in the world: the grasp or its pregrasp."""
        return X_WG if self.approach_of(X_WG) is None else self.pregrasp_of(X_WG)

    def _screen_start(self, instance: str, X_WG: Array) -> Clearance | None:
        if self.approach_of(X_WG) is None:
            return None
        return self.clearance.check(instance, self.pregrasp_of(X_WG))

    @property
    def approaches(self) -> bool:
        """Whether trials begin at the pregrasp."""
        return self.settings.approach and self.motion.standoff > 0.0

    def approach_of(self, X_WG: Array) -> LiftPath | None:
        """The approach path to a grasp (4, 4) in the world; None if the hand begins there."""
        if not self.approaches:
            return None
        return LiftPath(X_WG[:3, 2], self.motion.standoff)

    def pregrasp_of(self, X_WG: Array) -> Array:
        """Pregrasp (4, 4) of a grasp in the world."""
        return make_pose(X_WG[:3, :3], X_WG[:3, 3] - self.motion.standoff * X_WG[:3, 2])


class HandTrial(HandAloneTrial[TrialWorld], DrakeTrial):
    """Executes grasps of one scene with the hand alone.

    The approach is not simulated: the open hand begins at the grasp, and an overlap there is a
    collision. With `TrialSettings.approach` it begins at the pregrasp, the standoff back along the
    approach, and goes straight in with open fingers, as fast as it lifts. It pushes objects, or is
    stopped by them, as in the trial of the whole arm.

    Example::

        trial = burg.HandTrial("tabletop_six", "panda_tabletop")
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 10, only=["mug"])
        for X_OG in grasps.X_OG:
            print(trial.run("mug", X_OG).outcome)

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: time step and contact settings, or the name of a preset.
        settings: phases of a trial.
        motion: the hand's motion around the grasp; by default that of the settings, else the
            station's. The standoff counts only if the approach is simulated.
        lock: keep objects locked until something moving touches them. Without it all free objects
            are simulated from the start, which costs more and gives the same verdicts.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        scene, station, engine, settings, motion, clearance: see `GraspTrial`.
    """

    robot = "hand"
    hand_type = FloatingHand

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        engine: Engine | str = ENGINES["standard"],
        settings: TrialSettings = DEFAULT_TRIAL,
        motion: GraspMotion | None = None,
        lock: bool = True,
        meshcat: Meshcat | None = None,
    ) -> None:
        self._meshcat = meshcat
        super().__init__(
            as_scene(scene),
            as_station(station),
            as_drake_engine(engine),
            settings=settings,
            motion=motion,
            lock=lock,
        )

    @property
    def hand(self) -> FloatingHand:
        """The hand in `world`."""
        hand = self.world.hand
        assert isinstance(hand, FloatingHand)
        return hand

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
        lift: float | None = None,
        without_hull: bool = False,
    ) -> TrialResult:
        """Executes one grasp.

        Args:
            instance: name of the target in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            friction: the target's friction coefficient, in place of the library's.
            mass: the target's mass [kg], in place of the library's; its inertia scales with it.
            lift: length of the lift [m], in place of the motion's.
            without_hull: avoid worlds in which parts of the hand meet the target's hull; for
                callers that continue in `world`.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.

        Raises:
            InvalidInputError: `X_OG` is not a pose, `instance` cannot be grasped, friction is below
                0, the mass is not above 0, or the lift has no length.
        """
        X_WG = self.X_WG(instance, X_OG)
        check_overrides(friction, mass)
        paths = self.lift_paths(X_WG, lift)

        def begin(world: TrialWorld) -> Execution:
            return self.begin(instance, X_WG, paths, friction=friction, mass=mass, world=world)

        return self.execute(
            instance, X_WG, begin, friction=friction, mass=mass, without_hull=without_hull
        )

    def begin(
        self,
        instance: str,
        X_WG: Array,
        paths: Sequence[LiftPath] | None = None,
        *,
        friction: float | None = None,
        mass: float | None = None,
        world: TrialWorld | None = None,
    ) -> Execution:
        """Resets the Context to the start of a trial.

        The fingers start just before their first contact, as nothing happens earlier. Only the
        target and its neighbours, on which it may lean, are free to move; other objects are
        released when something moving touches them. Untouched objects stay at rest, so the result
        is that with all objects free, at a lower cost. With an approach the fingers start open, and
        the target is locked like the others.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world at which the open hand is clear.
            paths: paths of the hand with the target; those of the motion if None.
            friction, mass: as in `run`.
            world: world of the trial; by default the complete one.
        """
        world = self._use_world(world)
        target = world.diagram.free[instance]
        everything = set(world.diagram.free.values())
        approach = self.approach_of(X_WG)
        beside_hand = set() if approach else world.neighbours.with_neighbours({target})
        moving = beside_hand if self._lock else everything
        world.prepare(instance, moving, friction, mass)
        paths = self.lift_paths(X_WG) if paths is None else paths
        assert isinstance(world.hand, FloatingHand)
        if approach is None:
            closed = self.closed_before_contact(instance, X_WG)
            world.hand.place(world.plant_context, X_WG, closed, direction_W=paths[0].direction_W)
            world.command("hand", world.hand.closing_command())
        else:
            X_WP = self.pregrasp_of(X_WG)
            world.hand.place(world.plant_context, X_WP, direction_W=approach.direction_W)
            world.command("hand", world.hand.opening_command())
        world.command("lift", np.zeros(2))
        world.simulator.Initialize()
        lift_clearance = partial(self.lift_clearance, instance)
        if self.settings.shake is not None:
            return ShakeExecution(world, target, moving, ShakeCarrier(world, target))
        carrier = LiftCarrier(world, paths, lift_clearance, approach, target)
        return Execution(world, target, moving, carrier)
