"""The arm as the hand's carrier: its servos follow the trajectories of a plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array
from burg_drake.simulation.trials.carrier import HandSegment
from burg_drake.simulation.trials.command_sequence import CommandSequence
from burg_drake.simulation.trials.contacts import BodyContact
from burg_drake.simulation.trials.lift_clearance import ArmLiftClearance
from burg_drake.simulation.trials.robot_contacts import RobotContactWatch
from burg_drake.simulation.trials.trial_world import TrialWorld
from burg_drake.station.diagram import MountedHand

SPACING = 0.01
"""Hand's way between two looks along the rest of the lift [m]."""
NEGLIGIBLE_LOAD = 0.01
"""Relative difference of loads that does not count."""
DIGITS = 3
"""Of directions: a plan may leave its straight segment by half a millimetre."""


class ArmCarrier:
    """Moves the hand with the arm; see `Carrier`.

    Commands change at every step of the simulation, which is what a real arm's controller gets (a
    Panda's takes one a millisecond). The servos are part of a step, so that they are told what is
    wanted at its end.

    Args:
        world: that of a trial with an arm which has been brought to its start.
        target: the grasped body.
        approach: from the pregrasp, or from further back, to the grasp.
        segments: from there on, at least one; the hand goes straight on each.
        closed: how far the fingers can close at a grasp (4, 4) in the world before they touch.
        lift_clearance: gives the check of the path ahead with the target in the hand.
    """

    def __init__(
        self,
        world: TrialWorld,
        target: BodyIndex,
        approach: CommandSequence,
        segments: Sequence[CommandSequence],
        closed: Callable[[Array], float],
        lift_clearance: Callable[[], ArmLiftClearance],
    ) -> None:
        assert isinstance(world.hand, MountedHand)
        diagram = world.diagram
        self._world = world
        self._closed = closed
        self._mounted = world.hand
        self._lift_clearance = lift_clearance
        self._step = diagram.engine.time_step
        self._plant_context = diagram.plant.GetMyMutableContextFromRoot(world.context)
        self._port = diagram.diagram.GetInputPort("arm.desired_state")
        self._approach, self._commands = approach, tuple(segments)
        self._gravity = float(np.linalg.norm(diagram.plant.gravity_field().gravity_vector()))
        interval = segments[-1].steps_per_check * self._step
        self._loads = _loads(segments[-1].p_WG, interval, self._gravity)
        speed = np.linalg.norm(np.diff(segments[-1].p_WG, axis=0), axis=1)
        self._fastest = int(speed.argmax())
        self._touches = RobotContactWatch(diagram, world.hand.links, target)
        self._current: CommandSequence | None = None
        self._number = 0
        self._start = 0
        self._arrived = False
        self.approach_checks = approach.checks
        self.approach_steps = approach.steps_per_check
        self.segments = tuple(_segment(segment) for segment in segments)
        self.lift_time = sum(segment.checks for segment in segments) * interval
        self.tracking_error = self.tracking_distance = math.nan

    @property
    def touched(self) -> str:
        """The first touch that was not planned."""
        return self._touches.first

    def approach(self) -> None:
        """Follows the path to the grasp."""
        self._follow(self._approach)

    def close(self) -> None:
        """Closes the hand; the fingers begin where they would touch something first, as nothing
        happens before, unless something has been moved."""
        self._arrived = True
        self._follow(None)
        world = self._world
        world.command("hand", self._mounted.closing_command())
        if not self.touched:
            X_WG = self._mounted.X_WG(self._plant_context)
            self._mounted.set_fingers(self._plant_context, self._closed(X_WG))
            world.simulator.Initialize()

    def lift(self, number: int, check: int) -> None:
        """Follows one segment of the plan."""
        if check == 0:
            self._number = number
            self._follow(self._commands[number])

    def stop(self) -> None:
        """Stays where the last segment ends."""
        self._follow(None)

    def advance_to(self, time: float) -> None:
        """Steps, with a command of its own for each step."""
        context, simulator = self._world.context, self._world.simulator
        if self._current is None:
            simulator.AdvanceTo(time)
            return
        done, last = self._steps(context.get_time()), self._steps(time)
        for step in range(done + 1, last + 1):
            self._port.FixValue(context, self._current.at(step - self._start))
            simulator.AdvanceTo(step * self._step)

    def watch(self, contacts: list[BodyContact]) -> str:
        """Looks at the whole robot's contacts, and at how well it follows its command."""
        if self._current is not None:
            self._track(self._current)
        return self._touches.update(contacts, self._arrived)

    def travelled(self) -> float:
        """Of the grasp frame since the beginning of a segment as it was commanded [m]."""
        p_WG = self._mounted.X_WG(self._plant_context)[:3, 3]
        p_GG_W = p_WG - self._commands[self._number].p_WG[0]
        return float(p_GG_W @ self.segments[self._number].direction_W)

    def carries_full_load(self, check: int) -> bool:
        """Compares what gravity and acceleration of the planned motion have loaded and will.

        Not straight up, the load when the hand brakes is another one than when it accelerates, and
        both count.
        """
        polls = self._world.settings.steady_polls
        window = self._loads[max(0, check + 1 - polls) : check + 1]
        ahead = np.append(self._loads[check + 1 :], self._gravity).max()
        brakes = self.segments[-1].is_straight_up or check >= self._fastest + polls
        return bool(brakes and ahead <= (1.0 + NEGLIGIBLE_LOAD) * window.max())

    def is_free_ahead(self) -> bool:
        """Looks along the planned motion."""
        commands = self._commands[-1]
        check = self._checks_done(commands)
        p_WG = commands.p_WG[check:]
        gone = np.append(0.0, np.linalg.norm(np.diff(p_WG, axis=0), axis=1).cumsum())
        marks = np.append(np.arange(SPACING, gone[-1], SPACING), gone[-1])
        rows = check + np.searchsorted(gone, marks - 1e-9)
        q = np.array([commands.q_at_check(row) for row in rows])
        return self._lift_clearance().is_free(self._world, q)

    def _follow(self, commands: CommandSequence | None) -> None:
        """Follows a course from now on; without one the last command stays."""
        self._current = commands
        self._start = self._steps(self._world.context.get_time())

    def _steps(self, time: float) -> int:
        return round(time / self._step)

    def _checks_done(self, commands: CommandSequence) -> int:
        """Looks since the start of the course that is followed."""
        steps = self._steps(self._world.context.get_time()) - self._start
        return steps // commands.steps_per_check

    def _track(self, commands: CommandSequence) -> None:
        check = self._checks_done(commands)
        q = self._mounted.q(self._plant_context)
        p_WG = self._mounted.X_WG(self._plant_context)[:3, 3]
        error = float(np.abs(q - commands.q_at_check(check)).max())
        distance = float(np.linalg.norm(p_WG - commands.p_WG[check]))
        self.tracking_error = float(np.fmax(self.tracking_error, error))
        self.tracking_distance = float(np.fmax(self.tracking_distance, distance))


def _segment(commands: CommandSequence) -> HandSegment:
    """The straight segment along which a course leads the hand."""
    p_GG_W = commands.p_WG[-1] - commands.p_WG[0]
    direction_W = np.round(p_GG_W / np.linalg.norm(p_GG_W), DIGITS)
    direction_W /= np.linalg.norm(direction_W)
    return HandSegment(direction_W, float(p_GG_W @ direction_W), commands.checks)


def _loads(p_WG: Array, interval: float, gravity: float) -> Array:
    """(L,) what gravity and the acceleration of the hand load on a target in it, over its mass
    [m/s^2], in each interval between positions (L + 1, 3)."""
    velocity = np.diff(p_WG, axis=0) / interval
    velocity = np.concatenate([np.zeros((1, 3)), velocity, np.zeros((1, 3))])
    at_ends = np.diff(velocity, axis=0) / interval
    at_ends[:, 2] += gravity
    load = np.linalg.norm(at_ends, axis=1)
    peak: Array = np.maximum(load[:-1], load[1:])
    return peak
