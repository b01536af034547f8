"""The floating hand's carrier: one joint along the way, whose speed is commanded."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, InvalidInputError
from burg_drake.simulation.trials.carrier import HandSegment
from burg_drake.simulation.trials.contacts import BodyContact, reached
from burg_drake.simulation.trials.lift_clearance import HandLiftClearance, PlacedRobot
from burg_drake.simulation.trials.robot_contacts import NamedBodies, RobotContactWatch
from burg_drake.simulation.trials.trial_settings import TrialSettings
from burg_drake.simulation.trials.trial_world import TrialWorld
from burg_drake.station.diagram import FloatingHand
from burg_drake.station.document import GraspMotion

REST_CHECKS = 1
"""Looks between arrival and closing, in which the hand comes to rest."""
DOWN = -1e-6
"""Upward part of a direction (unit vector) that goes down by more than rounding."""


class LiftPath(NamedTuple):
    """A straight segment of the hand's path.

    Attributes:
        direction_W: (3,) unit vector in the world.
        length: [m].
    """

    direction_W: Array
    length: float


class RobotWorld(NamedBodies, Protocol):
    """Bodies of a world with a robot; see `StationDiagram`."""

    @property
    def fixed(self) -> Mapping[str, BodyIndex]: ...


class HandWorld(PlacedRobot, Protocol):
    """A world with the floating hand; see `TrialWorld`."""

    @property
    def settings(self) -> TrialSettings: ...
    def X_WG(self) -> Array: ...


W = TypeVar("W", bound=HandWorld)


class FloatingCarrier(ABC, Generic[W]):
    """What carriers of the floating hand share, of whatever engine: the segments, and what is in
    the way; see `Carrier`.

    Args:
        world: that of a trial which has been brought to its start, with the joint along the first
            of all paths: the floating hand is at the grasp, or where the approach begins.
        bodies: of that world.
        time_step: of the engine [s].
        paths: of the hand from the grasp on, straight, at least one.
        lift_clearance: gives the check of the path ahead with the target in the hand.
        approach: the path to the grasp; None if the hand is there.
        target: the body to be grasped, which the hand may touch once it has come to the grasp.
    """

    tracking_error = tracking_distance = math.nan

    def __init__(
        self,
        world: W,
        bodies: RobotWorld,
        time_step: float,
        paths: Sequence[LiftPath],
        lift_clearance: Callable[[], HandLiftClearance],
        approach: LiftPath | None,
        target: BodyIndex,
    ) -> None:
        settings = world.settings
        self._world, self._bodies = world, bodies
        self._lift_clearance = lift_clearance
        self._hand = set(bodies.robot_bodies)
        self.segments = tuple(
            HandSegment(*path, check_count(path.length, settings) + (number + 1 < len(paths)))
            for number, path in enumerate(paths)
        )
        self.lift_time = sum(settings.time_of(path.length) for path in paths)
        self._approach = approach
        self.approach_steps = max(1, round(settings.poll / time_step))
        self.approach_checks = 0
        self._touches: RobotContactWatch | None = None
        if approach is not None:
            self.approach_checks = check_count(approach.length, settings) + REST_CHECKS
            self._touches = RobotContactWatch(bodies, (), target)
        self._number = 0 if approach is None else -1
        self._is_approaching = self._is_lifting = False
        self._X_WG_start = world.X_WG()

    @property
    def touched(self) -> str:
        """The first touch that was not planned; "" without an approach."""
        return "" if self._touches is None else self._touches.first

    def watch(self, contacts: list[BodyContact]) -> str:
        """Looks for fixed bodies that the hand touches; the table is none of them, unless the hand
        goes down with the target, or presses on it on its way to the grasp."""
        if self._touches is not None:
            stop = self._touches.update(contacts, arrived=not self._is_approaching)
            if self._is_approaching:
                return stop
        fixed = set(self._bodies.fixed.values()) - {self._bodies.table}
        if self._is_lifting and self.segments[self._number].direction_W[2] < DOWN:
            fixed.add(self._bodies.table)
        hit = reached(contacts, self._hand, fixed)
        return self._bodies.body_names[min(hit)] if hit else ""

    @abstractmethod
    def travelled(self) -> float:
        """Position of the joint [m]."""

    def carries_full_load(self, check: int) -> bool:
        """See `bears_full_load`."""
        return bears_full_load(self.segments[-1], check, self._world.settings)

    def is_free_ahead(self) -> bool:
        """Looks along the joint's axis."""
        last = self.segments[-1]
        return self._lift_clearance().is_free(
            self._world, self._X_WG_start, last.length - self.travelled(), last.direction_W
        )

    def _enter(self, number: int) -> bool:
        """Goes on in a segment; whether it begins."""
        self._is_lifting = True
        if number == self._number:
            return False
        self._number, self._X_WG_start = number, self._world.X_WG()
        return True


class LiftCarrier(FloatingCarrier[TrialWorld]):
    """Takes the floating hand away from the grasp, and to it if that is asked for; see `Carrier`.

    Where one segment ends and the next begins, the hand comes to rest, and its joint is laid along
    the new direction.

    Args:
        world, paths, lift_clearance, approach, target: see `FloatingCarrier`.
    """

    def __init__(
        self,
        world: TrialWorld,
        paths: Sequence[LiftPath],
        lift_clearance: Callable[[], HandLiftClearance],
        approach: LiftPath | None,
        target: BodyIndex,
    ) -> None:
        assert isinstance(world.hand, FloatingHand)
        self._floating = world.hand
        time_step = world.diagram.engine.time_step
        super().__init__(world, world.diagram, time_step, paths, lift_clearance, approach, target)
        self._plant_context = world.diagram.plant.GetMyMutableContextFromRoot(world.context)

    def approach(self) -> None:
        """Begins the way to the grasp; the speed is commanded from look to look."""
        self._is_approaching = True

    def close(self) -> None:
        """Closes the fingers; without an approach they have been closing from the start."""
        if self._approach is not None:
            self._is_approaching = False
            self._world.command("lift", np.zeros(2))
            self._world.command("hand", self._floating.closing_command())

    def lift(self, number: int, check: int) -> None:
        """Commands the speed of the middle of the interval; in one interval more, where another
        segment follows, the hand comes to rest."""
        segment = self.segments[number]
        if self._enter(number):
            self._floating.set_lift_direction(self._plant_context, segment.direction_W)
            self._world.simulator.Initialize()
        self._command_speed(segment.length, check, self._world.settings.poll)

    def stop(self) -> None:
        """Stands still."""
        self._world.command("lift", np.zeros(2))

    def advance_to(self, time: float) -> None:
        """Steps; commands change only from look to look."""
        if self._is_approaching and self._approach is not None:
            interval = self.approach_steps * self._world.diagram.engine.time_step
            check = round(self._world.context.get_time() / interval)
            self._command_speed(self._approach.length, check, interval)
        self._world.simulator.AdvanceTo(time)

    def travelled(self) -> float:
        """Position of the joint [m]."""
        return self._floating.travelled(self._plant_context)

    def _command_speed(self, length: float, check: int, interval: float) -> None:
        """Commands the speed of the middle of an interval [s] of a path of a length [m]."""
        checks = check_count(length, self._world.settings)
        top_speed = 2 * length / (checks * interval)
        speed = top_speed * max(0.0, 1 - abs(2 * check + 1 - checks) / checks)
        self._world.command("lift", np.array([0.0, speed]))


def bears_full_load(last: HandSegment, check: int, settings: TrialSettings) -> bool:
    """Whether the load on a grip was as large as it will ever be, up to an interval of the last
    segment.

    The hand accelerates in the first half of a segment and brakes in the second. Straight up, the
    first adds to the weight and the second takes away from it. Otherwise both count, and standing
    still is in between.
    """
    half = check_count(last.length, settings) // 2
    if last.is_straight_up:
        return check < half
    return check >= half + settings.steady_polls


def check_count(length: float, settings: TrialSettings) -> int:
    """Looks on a path of a length [m]: as many to speed up as to brake."""
    return 2 * max(1, round(settings.time_of(length) / settings.poll / 2))


def lift_paths(motion: GraspMotion, X_WG: Array, lift: float | None = None) -> tuple[LiftPath, ...]:
    """Straight paths of the hand with the target: the retreat, if there is one, and the lift.

    Args:
        motion: where the hand goes.
        X_WG: (4, 4) grasp in the world.
        lift: length of the lift [m], in place of the motion's.

    Returns:
        One or two, each longer than 0.

    Raises:
        InvalidInputError: the hand would not move, or a length is not one.
    """
    height = motion.lift_height if lift is None else lift
    if not 0.0 <= height < math.inf or motion.retreat + height <= 0.0:
        raise InvalidInputError(
            f"lift is {height:g} m and retreat {motion.retreat:g} m; give a finite lift of 0 or"
            " more, and above 0 if there is no retreat"
        )
    paths = (
        LiftPath(-X_WG[:3, 2], motion.retreat),
        LiftPath(motion.direction_W, height),
    )
    return tuple(path for path in paths if path.length > 0.0)
