"""Follows arm postures at grasps along the straight segments, from pose to pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.motion.lines.chain_candidates import APPROACH, GRASP, LIFT, RETREAT, WHOLE
from burg_drake.motion.lines.line_poses import LinePoses

Solve = Callable[[Array, Array], tuple[Array, NDArray[np.bool_]]]
"""Postures (S, n) at hand poses (S, 4, 4) by steps from near postures (S, n), and whether they meet
them."""
MeasureClearance = Callable[[Array], tuple[Array, Array]]
"""Bounds of the clearance of postures (S, n): lower, and what has to be positive to count [m]."""


@dataclass(frozen=True, eq=False)
class Followed:
    """S postures at grasps, and what became of them at L poses of the way.

    Attributes:
        q: (S, L, n) arm positions; NaN where they have not got to.
        lower, upper: (S, L) bounds of the clearance [m]; infinite where not measured.
        stage: (S,) where they ended, `WHOLE` if they did not.
    """

    q: Array
    lower: Array
    upper: Array
    stage: Indices

    def blocked(self, s: int) -> int | None:
        """The pose at which a posture is deepest in collision; None if it is nowhere."""
        worst = int(self.upper[s].argmin())
        return None if self.upper[s, worst] > 0.0 else worst


@dataclass(frozen=True, eq=False)
class Follower:
    """Follows postures; those in collision on the way are not followed any further.

    Attributes:
        lines: where the hand goes.
        travel: most that a joint may move from one to the next [rad].
        solve: solves for postures.
        measure: measures their clearance.
    """

    lines: LinePoses
    travel: float
    solve: Solve
    measure: MeasureClearance

    def follow(self, X_AG: Array, q: Array) -> Followed:
        """From the grasp to the pregrasp; then, from the grasp, back and up to the top.

        Args:
            X_AG: (S, 4, 4) grasps in the arm's base frame.
            q: (S, n) postures there.
        """
        count, at_grasp = len(self.lines.layers), self.lines.at_grasp
        at_retreated = self.lines.at_retreated
        lower, upper = np.full((2, len(q), count), np.inf)
        every = np.full((len(q), count, q.shape[1]), np.nan)
        every[:, at_grasp] = q
        found = Followed(every, lower, upper, np.full(len(q), WHOLE))
        self._measure(found, [at_grasp], GRASP)
        for stage, begin, end in (
            (APPROACH, at_grasp, 0),
            (RETREAT, at_grasp, at_retreated),
            (LIFT, at_retreated, count - 1),
        ):
            step = -1 if end < begin else 1
            poses = range(begin + step, end + step, step)
            for pose in poses:
                self._step(found, X_AG, pose, step, stage, bent=pose - step == begin)
            self._measure(found, poses, stage)
        return found

    def _step(
        self, found: Followed, X_AG: Array, pose: int, step: int, stage: int, *, bent: bool
    ) -> None:
        """To the next pose, on from the last two; from the last one alone where the way is bent."""
        alive = np.flatnonzero(found.stage == WHOLE)
        before = found.q[alive, pose - step]
        start = before
        if not bent:
            start = 2.0 * before - found.q[alive, pose - 2 * step]
        X_AH = self.lines.X_AH(X_AG[alive], self.lines.layers[pose])
        q, met = self.solve(X_AH, start)
        met &= np.abs(q - before).max(axis=1, initial=0.0) <= self.travel
        found.q[alive[met], pose] = q[met]
        found.stage[alive[~met]] = stage

    def _measure(self, found: Followed, poses: Sequence[int], stage: int) -> None:
        alive = np.flatnonzero(found.stage == WHOLE)
        if not len(alive) or not len(poses):
            return
        where = np.ix_(alive, np.array(poses))
        lower, upper = self.measure(found.q[where].reshape(-1, found.q.shape[-1]))
        shape = len(alive), len(poses)
        found.lower[where], found.upper[where] = lower.reshape(shape), upper.reshape(shape)
        found.stage[alive[~(found.upper[where] > 0.0).all(axis=1)]] = stage
