"""The floating hand's carrier in MuJoCo: one joint along the way, which force and servos move."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pydrake.multibody.tree import BodyIndex

from burg_drake.simulation.mujoco.mujoco_world import MujocoWorld
from burg_drake.simulation.trials import (
    FloatingCarrier,
    HandLiftClearance,
    LiftPath,
    check_count,
)


class MujocoCarrier(FloatingCarrier[MujocoWorld]):
    """Takes the floating hand away from the grasp, and to it if that is asked for; see `Carrier`
    and `trials.LiftCarrier`. Here commands change at every step.

    Args:
        world, paths, lift_clearance, approach, target: see `FloatingCarrier`.
    """

    def __init__(
        self,
        world: MujocoWorld,
        paths: Sequence[LiftPath],
        lift_clearance: Callable[[], HandLiftClearance],
        approach: LiftPath | None,
        target: BodyIndex,
    ) -> None:
        time_step = world.engine.time_step
        super().__init__(world, world, time_step, paths, lift_clearance, approach, target)
        self._path = approach
        self._step: int | None = None

    def approach(self) -> None:
        """Begins the way to the grasp."""
        self._is_approaching, self._step = True, 0

    def close(self) -> None:
        """Closes the fingers; without an approach they have been closing from the start."""
        if self._approach is not None:
            self._is_approaching, self._step = False, None
            self._world.command_lift(self._approach.length, 0.0, 0.0)
            self._world.close_hand()

    def lift(self, number: int, check: int) -> None:
        """Commands one interval; where another segment follows, the hand comes to rest in one
        more."""
        segment = self.segments[number]
        if self._enter(number):
            self._world.turn_lift(segment.direction_W)
        self._path = LiftPath(segment.direction_W, segment.length)
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

    def travelled(self) -> float:
        """Position of the joint [m]."""
        return self._world.travelled()

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
