"""The floating hand's carrier in MuJoCo: one joint along the way, which force and servos move."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pydrake.multibody.tree import BodyIndex

from burg_drake.simulation.mujoco.mujoco_world import MujocoWorld
from burg_drake.simulation.trials import (
    DOWN,
    REST_CHECKS,
    BodyContact,
    HandLiftClearance,
    HandSegment,
    LiftPath,
    RobotContactWatch,
    bears_full_load,
    check_count,
    reached,
)


class MujocoCarrier:
    """Takes the floating hand away from the grasp, and to it if that is asked for; see `Carrier`
    and `trials.LiftCarrier`. Here commands change at every step.

    Args:
        world: brought to its start, with the joint along the first of all paths.
        paths: of the hand from the grasp on, straight, at least one.
        lift_clearance: gives the check of the path ahead with the target in the hand.
        approach: the path to the grasp; None if the hand is there.
        target: the body to be grasped.
    """

    tracking_error = tracking_distance = math.nan

    def __init__(
        self,
        world: MujocoWorld,
        paths: Sequence[LiftPath],
        lift_clearance: Callable[[], HandLiftClearance],
        approach: LiftPath | None,
        target: BodyIndex,
    ) -> None:
        settings = world.settings
        self._world = world
        self._lift_clearance = lift_clearance
        self.segments = tuple(
            HandSegment(*path, check_count(path.length, settings) + (number + 1 < len(paths)))
            for number, path in enumerate(paths)
        )
        self.lift_time = sum(settings.time_of(path.length) for path in paths)
        self.approach_steps = max(1, round(settings.poll / world.engine.time_step))
        self.approach_checks = 0
        self._touches: RobotContactWatch | None = None
        self._path = approach
        if approach is not None:
            self.approach_checks = check_count(approach.length, settings) + REST_CHECKS
            self._touches = RobotContactWatch(world, (), target)
        self._number = 0 if approach is None else -1
        self._step: int | None = None
        self._is_approaching = self._is_lifting = False
        self._X_WG_start = world.X_WG()

    @property
    def touched(self) -> str:
        """The first touch that was not planned; "" without an approach."""
        return "" if self._touches is None else self._touches.first

    def approach(self) -> None:
        """Begins the way to the grasp."""
        self._is_approaching, self._step = True, 0

    def close(self) -> None:
        """Closes the fingers; without an approach they have been closing from the start."""
        if self._path is not None:
            self._is_approaching, self._step = False, None
            self._world.command_lift(self._path.length, 0.0, 0.0)
            self._world.close_hand()

    def lift(self, number: int, check: int) -> None:
        """Commands one interval; where another segment follows, the hand comes to rest in one
        more."""
        self._is_lifting = True
        if number != self._number:
            self._number = number
            self._X_WG_start = self._world.X_WG()
            self._world.turn_lift(self.segments[number].direction_W)
        self._path = LiftPath(self.segments[number].direction_W, self.segments[number].length)
        self._step = check * self.approach_steps

    def stop(self) -> None:
        """Stands at the end of the last segment."""
        self._step = None
        self._world.command_lift(self.segments[self._number].length, 0.0, 0.0)

    def advance_to(self, time: float) -> None:
        """Steps; on the way with commands for the end of each step."""
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

    def watch(self, contacts: list[BodyContact]) -> str:
        """Looks for fixed bodies that the hand touches; the table is none of them, unless the hand
        goes down with the target, or presses on it on its way to the grasp."""
        world = self._world
        if self._touches is not None:
            stop = self._touches.update(contacts, arrived=not self._is_approaching)
            if self._is_approaching:
                return stop
        fixed = set(world.fixed.values())
        if not self._is_lifting or self.segments[self._number].direction_W[2] >= DOWN:
            fixed.discard(world.table)
        hit = reached(contacts, world.robot, fixed)
        return world.body_names[min(hit)] if hit else ""

    def travelled(self) -> float:
        """Position of the joint [m]."""
        return self._world.travelled()

    def carries_full_load(self, check: int) -> bool:
        """See `bears_full_load`."""
        return bears_full_load(self.segments[-1], check, self._world.settings)

    def is_free_ahead(self) -> bool:
        """Looks along the joint's axis."""
        last = self.segments[-1]
        return self._lift_clearance().is_free(
            self._world, self._X_WG_start, last.length - self.travelled(), last.direction_W
        )

    def _command(self, step: int) -> tuple[float, float]:
        """Place [m] and speed [m/s] at the end of a step: half of the way accelerates, half of it
        brakes."""
        assert self._path is not None
        length = self._path.length
        steps = check_count(length, self._world.settings) * self.approach_steps
        share = min(1.0, step / steps)
        left = min(share, 1.0 - share)
        gone = 2.0 * left * left
        duration = steps * self._world.engine.time_step
        return length * (gone if share < 0.5 else 1.0 - gone), 4.0 * length * left / duration
