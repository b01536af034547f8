"""What an arm's servos are told at every step of the simulation, and where that leads the hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from burg_drake.core import Array
from burg_drake.motion.plans import Trajectory


class CommandSequence:
    """Trajectories one after the other, by steps of the simulation; the end of the last one from
    then on.

    A trajectory begins at the step at which the one before it has ended, at most a step late.

    Args:
        trajectories: at least one; each begins where the one before it ends.
        step: of the simulation [s].
        steps_per_check: steps from one look at the contacts to the next.
        forward: (K, 3) positions of the grasp frame in the world at arm positions (K, n) [m].
        rest: looks that follow after the end.

    Attributes:
        steps_per_check: as given.
        checks: from start to end.
        desired: (S + 1, 2 n) positions and velocities, by steps since the start.
        p_WG: (looks + 1, 3) where that leads the grasp frame in the world, by looks [m].
    """

    def __init__(
        self,
        trajectories: Sequence[Trajectory],
        step: float,
        steps_per_check: int,
        forward: Callable[[Array], Array],
        rest: int = 0,
    ) -> None:
        parts = [_desired(trajectories[0], np.zeros(1))]
        for trajectory in trajectories:
            count = int(np.ceil(trajectory.duration / step - 1e-6))
            parts.append(_desired(trajectory, step * np.arange(1.0, count + 1.0)))
        self.desired = np.concatenate(parts)
        self.checks = -(-(len(self.desired) - 1) // steps_per_check) + rest
        self.steps_per_check = steps_per_check
        self.p_WG = forward(np.array([self.q_at_check(check) for check in range(self.checks + 1)]))

    def at(self, step: int) -> Array:
        """(2 n,) positions and velocities to be reached at the end of a step since the start."""
        desired: Array = self.desired[min(step, len(self.desired) - 1)]
        return desired

    def q_at_check(self, check: int) -> Array:
        """(n,) desired positions some looks after the start."""
        return self.at(check * self.steps_per_check)[: self.desired.shape[1] // 2]


def _desired(trajectory: Trajectory, time: Array) -> Array:
    """(T, 2 n) positions and velocities at times (T,)."""
    v = [np.interp(time, trajectory.t, column) for column in trajectory.v.T]
    return np.concatenate([trajectory.at(time), np.stack(v, axis=1)], axis=1)
