"""Configurations of an arm at many hand poses at once, a few of each per round.

The closed form where the arm has one; for any other serial arm a numeric search from the postures
of a fixed table whose hand poses are nearest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from burg_drake.core import Array, Arrays, Indices, cached, content_hash, rng_from
from burg_drake.motion.ik.numeric import ArmKinematics, solve_ik
from burg_drake.motion.ik.panda import PandaIk

POSTURES = 16_384
"""Size of the table that numeric searches start from."""
STARTS = (1, 3)
"""Postures to start from for each pose, round by round."""
ITERATIONS = 15
TOLERANCE = 1e-6
"""Of a numeric solution [m and rad]."""
LENGTH_SCALE = 0.3
"""Distance [m] that counts as much as one radian when postures near a pose are looked up."""


class ArmSolutions(Protocol):
    """Finds configurations without regard to collisions.

    Attributes:
        rounds: how many there are.
    """

    rounds: int

    def solve(self, X_AH: Array, turn: int) -> tuple[Indices, Array]:
        """Configurations that the rounds before this one did not have.

        Args:
            X_AH: (N, 4, 4) hand poses.
            turn: index of the round.

        Returns:
            (S,) index of the pose of each configuration, and (S, n) arm positions.
        """
        ...


def arm_solutions(
    arm: ArmKinematics, *, redundant: tuple[int, ...], limit_margin: float
) -> ArmSolutions:
    """The best way that there is for an arm.

    Args:
        arm: the arm.
        redundant: values of the redundant joint that the closed form sweeps, round by round.
        limit_margin: distance to keep from the joint limits [rad or m].
    """
    ik = PandaIk.of(arm)
    if ik is None:
        return NumericSolutions(arm, limit_margin)
    return ClosedFormSolutions(ik, redundant, limit_margin)


class ClosedFormSolutions:
    """All branches at evenly spaced values of the Panda's last joint; see `ArmSolutions`."""

    def __init__(self, ik: PandaIk, redundant: tuple[int, ...], limit_margin: float) -> None:
        self._ik = replace(ik, lower=ik.lower + limit_margin, upper=ik.upper - limit_margin)
        self._values: list[Array] = []
        for count in redundant:
            share = (np.arange(count) + 0.5) / count
            done = np.concatenate([np.empty(0), *self._values])
            near = np.abs(share[:, None] - done).min(axis=1, initial=np.inf)
            self._values.append(share[near > 1e-9])
        self.rounds = len(redundant)

    def solve(self, X_AH: Array, turn: int) -> tuple[Indices, Array]:
        """See `ArmSolutions`."""
        lower, upper = self._ik.lower[6], self._ik.upper[6]
        found = self._ik.solve(X_AH, lower + self._values[turn] * (upper - lower))
        return found.pose, found.q


class NumericSolutions:
    """Levenberg-Marquardt; what is found depends on the pose alone. See `ArmSolutions`."""

    def __init__(
        self,
        arm: ArmKinematics,
        limit_margin: float,
        *,
        starts: tuple[int, ...] = STARTS,
        limited: bool = True,
    ) -> None:
        """Makes the table of postures.

        Args:
            arm: the arm.
            limit_margin: distance to keep from the joint limits [rad or m].
            starts: postures to start from for each pose, round by round.
            limited: whether configurations have to be within the joint limits; the postures of the
                table are in either case.
        """
        lower, upper = arm.lower + limit_margin, arm.upper - limit_margin

        def make() -> Arrays:
            rng = rng_from("burg_drake arm solutions", POSTURES)
            q = rng.uniform(lower, upper, (POSTURES, len(lower)))
            return {"q": q, "features": _features(arm.forward(q)[0])}

        follows = (arm.turns, arm.axis, arm.p_AJ, arm.X_AH0, lower, upper)
        table = cached("hand-poses", content_hash(*follows), make)
        self._q, self._tree = table["q"], cKDTree(table["features"])
        self._arm = arm if limited else arm.unlimited()
        self._margin = limit_margin
        self._starts = starts
        self.rounds = len(starts)

    def solve(self, X_AH: Array, turn: int) -> tuple[Indices, Array]:
        """See `ArmSolutions`."""
        skip, count = sum(self._starts[:turn]), self._starts[turn]
        if not len(X_AH):
            return np.empty(0, np.intp), np.empty((0, self._q.shape[1]))
        _, near = self._tree.query(_features(X_AH), k=np.arange(skip + 1, skip + count + 1))
        pose = np.repeat(np.arange(len(X_AH)), count)
        q, met = solve_ik(
            self._arm,
            X_AH[pose],
            self._q[near.ravel()],
            iterations=ITERATIONS,
            tolerance=TOLERANCE,
            margin=self._margin,
        )
        return pose[met], q[met]


def _features(X_AH: Array) -> Array:
    """(N, 12) points whose squared distances are about those of poses, in squared radians: half the
    squared difference of two rotation matrices is their squared angle, where that is small."""
    R = X_AH[:, :3, :3].reshape(-1, 9) / np.sqrt(2.0)
    return np.concatenate([X_AH[:, :3, 3] / LENGTH_SCALE, R], axis=1)
