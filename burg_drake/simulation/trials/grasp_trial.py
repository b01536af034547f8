"""What trials of grasps share, whatever carries the hand: the worlds in which they run, the screen
of the open hand before, and the result of the execution after it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Generic, Protocol, TypeVar

from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, check_pose
from burg_drake.core.grasps import Outcome
from burg_drake.grasping.clearance import Clearance, HandClearance
from burg_drake.scene.document import Scene
from burg_drake.simulation.confidence import GripLoad, confidence
from burg_drake.simulation.rest import Neighbours
from burg_drake.simulation.trials.contacts import ContactReader
from burg_drake.simulation.trials.execution import Execution, OtherTouched
from burg_drake.simulation.trials.result import TrialResult, collision, failure
from burg_drake.simulation.trials.trial_settings import TrialSettings
from burg_drake.simulation.trials.trial_world import TrialWorld
from burg_drake.station.diagram import (
    HandHandle,
    StationDiagram,
    build_station_diagram,
    instance_pose,
)
from burg_drake.station.document import Engine, GraspMotion, Station
from burg_drake.station.world import Robot

KEPT_WORLDS = 16
"""Worlds of a target alone that are kept; each takes some 20 MB, and 0.1 s to build."""


class KeptWorld(Protocol):
    """A world in which trials begin."""

    @property
    def time(self) -> float:
        """Since the start of the trial [s]."""
        ...

    @property
    def robot_meets_hull(self) -> bool:
        """Whether, in a world of a target alone, parts of the robot meet a hull in its place."""
        ...

    def is_usable(self) -> bool:
        """Whether trials can begin in it."""
        ...

    def invalidate(self) -> None:
        """Has the next trial prepare it from scratch."""
        ...


W = TypeVar("W", bound=KeptWorld)


class GraspTrial(ABC, Generic[W]):
    """Executes grasps in one scene.

    A trial runs in a world in which the target alone can move, which costs less. If it meets
    another object there, it runs again in the complete world, from its beginning.

    Args:
        scene: the scene.
        station: the station.
        engine: how trials are stepped.
        settings: phases of a trial.
        clearance: the screen of the open hand in the scene.
        motion: where the hand goes, if not as the settings or else the station say.
        lock: keep objects locked until something moving touches them, and run in worlds of the
            target alone.

    Attributes:
        scene, station, engine, settings, clearance: as given.
        motion: where the hand goes.
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
        self._alone: dict[str, W | None] = {}
        self._complete: W | None = None
        self._world: W | None = None

    @property
    def world(self) -> W:
        """That of the last trial; before the first one the complete world."""
        return self._world or self.complete_world

    @property
    def complete_world(self) -> W:
        """The one in which all objects can move."""
        if self._complete is None:
            self._complete = self._build(None)
        return self._complete

    def X_WG(self, instance: str, X_OG: Array) -> Array:
        """A grasp (4, 4) of an instance in the world.

        Raises:
            InvalidInputError: `X_OG` is not a pose, or `instance` cannot be grasped.
        """
        if instance not in self.scene.instances:
            free = ", ".join(self.scene.instances) or "(none)"
            raise InvalidInputError(
                f"{instance!r} is not a free instance of scene {self.scene.name!r}; free are {free}"
            )
        return instance_pose(self.scene, self.station, instance) @ check_pose(X_OG, "X_OG")

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
        """Executes a grasp, if the open hand is clear at it, and where its approach begins.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world.
            begin: brings a world to the start of the trial.
            friction, mass: with which it begins; the library's if None.
            without_hull: not in a world in which parts of the robot meet the target's hull.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.
        """
        screen = self.clearance.check(instance, X_WG)
        if screen.outcome is not None:
            return collision(screen)
        start = self._screen_of_start(instance, X_WG)
        if start is not None and start.outcome is not None:
            return collision(replace(start, outcome=Outcome.HAND_COLLISION_APPROACH))
        world = self._world_of(instance)
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
            held_for = replace(margins, end_time=margins.end_time - found.grip_start)
            sure = confidence(self.engine, found.outcome, held_for, load)
            return replace(found, margins=margins, confidence=sure)
        except self.failures as error:
            world.invalidate()
            return failure(error, screen, world.time)

    def _screen_of_start(self, instance: str, X_WG: Array) -> Clearance | None:
        """The screen of the open hand where a trial begins; None if that is at the grasp, or the
        plan of an arm tells."""
        return None

    def grip_load(
        self,
        instance: str,
        X_WG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
    ) -> GripLoad:
        """What a grip has to carry.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world.
            friction, mass: of the target; the library's if None.
        """
        entry = self.scene.entry(instance)
        X_WO = instance_pose(self.scene, self.station, instance)
        return GripLoad.of(
            X_WG,
            X_WO[:3, :3] @ entry.mass_properties.center_of_mass + X_WO[:3, 3],
            friction=entry.friction if friction is None else friction,
            force=self.station.hand.force,
            mass=entry.mass if mass is None else mass,
            acceleration=self.settings.acceleration,
        )

    def closed_before_contact(self, instance: str, X_WG: Array) -> float:
        """How far the fingers can close, from 0 (open) to 1, before they touch anything: the
        clearance knows pieces, out of which the target's surface stands a little.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world at which the open hand is clear.
        """
        travel = min(abs(f.closed - f.open) for f in self.station.hand.fingers)
        excess = self.scene.entry(instance).contact.excess / travel
        return max(0.0, self.clearance.free_travel(X_WG) - excess)

    def _enter(self, world: W | None) -> W:
        """Makes a world, the complete one if None, the present one."""
        self._world = self.complete_world if world is None else world
        return self._world

    def _world_of(self, instance: str) -> W:
        """The cheapest in which a trial of an instance can begin."""
        if not self._lock:
            return self.complete_world
        if instance not in self._alone:
            world = self._build(instance)
            self._alone[instance] = world if world.is_usable() else None
        self._alone[instance] = found = self._alone.pop(instance)  # used last comes last
        if len(self._alone) > KEPT_WORLDS:
            del self._alone[next(iter(self._alone))]
        return found or self.complete_world

    @abstractmethod
    def _build(self, alone: str | None) -> W:
        """A world in which one object alone can move, or the complete one."""


class DrakeTrial(GraspTrial[TrialWorld]):
    """A trial in Drake.

    Args:
        scene, station, engine, settings, clearance, motion, lock: see `GraspTrial`.
        robot: what of the station moves.
        meshcat: where to show the trials.
    """

    def __init__(
        self,
        scene: Scene,
        station: Station,
        robot: Robot,
        engine: Engine,
        *,
        settings: TrialSettings,
        clearance: HandClearance,
        motion: GraspMotion | None = None,
        lock: bool = True,
        meshcat: Meshcat | None = None,
    ) -> None:
        super().__init__(
            scene, station, engine, settings=settings, clearance=clearance, motion=motion, lock=lock
        )
        self._robot, self._meshcat = robot, meshcat

    @property
    def diagram(self) -> StationDiagram:
        """Of `world`."""
        return self.world.diagram

    @property
    def hand(self) -> HandHandle:
        """The hand in `world`."""
        return self.world.hand

    @property
    def contacts(self) -> ContactReader:
        """Of `world`."""
        return self.world.contacts

    @property
    def neighbours(self) -> Neighbours:
        """Of `world`."""
        return self.world.neighbours

    @property
    def simulator(self) -> Simulator:
        """Of `world`."""
        return self.world.simulator

    @property
    def context(self) -> Context:
        """Of the trial that runs or ran last."""
        return self.world.context

    def _build(self, alone: str | None) -> TrialWorld:
        diagram = build_station_diagram(
            self.scene,
            self.station,
            robot=self._robot,
            engine=self.engine,
            meshcat=self._meshcat,
            for_trials=alone or True,
        )
        return TrialWorld(diagram, self._handle(diagram), self.settings)

    @abstractmethod
    def _handle(self, diagram: StationDiagram) -> HandHandle:
        """The hand in a diagram."""
