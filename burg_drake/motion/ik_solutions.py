"""Configurations of an arm at many hand poses at once, a few of each per round.

They come from the closed form, the numeric search, or an inverse kinematics routine of the user.

The numeric search starts from the postures of a fixed table whose hand poses are nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from burg_drake.core import (
    Array,
    Arrays,
    Indices,
    InvalidInputError,
    cached,
    content_hash,
    rng_from,
    rotation_angle,
)
from burg_drake.motion.numeric_ik import ArmKinematics, solve_ik
from burg_drake.motion.panda_ik import PandaIk


class ArmSolutions(Protocol):
    """Finds configurations without regard to collisions.

    Attributes:
        rounds: number of rounds.
    """

    rounds: int

    def solve(self, X_AH: Array, round_index: int) -> tuple[Indices, Array]:
        """Configurations that the rounds before this one did not return.

        Args:
            X_AH: (N, 4, 4) hand poses.
            round_index: index of the round.

        Returns:
            (S,) index of the pose of each configuration, and (S, n) arm positions.
        """
        ...


def arm_solutions(
    arm: ArmKinematics, *, redundant: tuple[int, ...], limit_margin: float
) -> ArmSolutions:
    """The best solver for an arm: the closed form if it has one, else the numeric search.

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
        self._ik = ik.within(limit_margin)
        self._values: list[Array] = []
        for count in redundant:
            share = (np.arange(count) + 0.5) / count
            done = np.concatenate([np.empty(0), *self._values])
            near = np.abs(share[:, None] - done).min(axis=1, initial=np.inf)
            self._values.append(share[near > 1e-9])
        self.rounds = len(redundant)

    def solve(self, X_AH: Array, round_index: int) -> tuple[Indices, Array]:
        """See `ArmSolutions`."""
        lower, upper = self._ik.lower[6], self._ik.upper[6]
        found = self._ik.solve(X_AH, lower + self._values[round_index] * (upper - lower))
        return found.pose, found.q


class NumericSolutions:
    """Levenberg-Marquardt; the result depends on the pose alone. See `ArmSolutions`."""

    def __init__(
        self,
        arm: ArmKinematics,
        limit_margin: float,
        *,
        starts: tuple[int, ...] = (1, 3),
        limited: bool = True,
    ) -> None:
        """Makes the table of postures.

        Args:
            arm: the arm.
            limit_margin: distance to keep from the joint limits [rad or m].
            starts: postures to start from for each pose, round by round.
            limited: whether configurations have to be within the joint limits; the table's postures
                always are.
        """
        table_size = 16_384  # Postures among which the starts of numeric searches are chosen.
        lower, upper = arm.lower + limit_margin, arm.upper - limit_margin

        def make() -> Arrays:
            rng = rng_from("burg_drake arm solutions", table_size)
            q = rng.uniform(lower, upper, (table_size, len(lower)))
            return {"q": q, "features": _pose_features(arm.forward(q)[0])}

        inputs = (arm.turns, arm.axis, arm.p_AJ, arm.X_AH0, lower, upper)
        table = cached("hand-poses", content_hash(*inputs), make)
        self._q, self._tree = table["q"], cKDTree(table["features"])
        self._arm = arm if limited else arm.unlimited()
        self._margin = limit_margin
        self._starts = starts
        self.rounds = len(starts)

    def solve(self, X_AH: Array, round_index: int) -> tuple[Indices, Array]:
        """See `ArmSolutions`."""
        skip, count = sum(self._starts[:round_index]), self._starts[round_index]
        if not len(X_AH):
            return np.empty(0, np.intp), np.empty((0, self._q.shape[1]))
        _, near = self._tree.query(_pose_features(X_AH), k=np.arange(skip + 1, skip + count + 1))
        pose = np.repeat(np.arange(len(X_AH)), count)
        q, met = solve_ik(
            self._arm,
            X_AH[pose],
            self._q[near.ravel()],
            iterations=15,
            tolerance=1e-6,
            margin=self._margin,
        )
        return pose[met], q[met]


def _pose_features(X_AH: Array) -> Array:
    """(N, 12) points whose squared distances approximate those of poses [rad^2]: half the squared
    difference of two rotation matrices is their squared angle, if that is small."""
    length_scale = 0.3  # Metres that count as much as one radian.
    R = X_AH[:, :3, :3].reshape(-1, 9) / np.sqrt(2.0)
    return np.concatenate([X_AH[:, :3, 3] / length_scale, R], axis=1)


class IkRoutine(Protocol):
    """Finds arm positions for hand poses."""

    def __call__(self, X_AH: Array) -> Sequence[Array]:
        """Solves for N poses.

        Args:
            X_AH: (N, 4, 4) wanted poses of the hand body (the station's `hand` document names it)
                in the frame of the arm's base link (`arm.base` of the station).

        Returns:
            For each pose the arm positions (S, n) that meet it, joints from base to hand [rad or
            m]; S may be 0. For a redundant arm, as many as are worth trying. Whole turns do not
            matter, and positions may be beyond the joint limits.
        """
        ...


class RoutineSolutions:
    """Solutions of the user's IK routine, in one round; see `ArmSolutions`."""

    rounds = 1

    def __init__(
        self, arm: ArmKinematics, routine: IkRoutine, limit_margin: float, *, limited: bool = True
    ) -> None:
        """Wraps a routine.

        Args:
            arm: the arm.
            routine: its inverse kinematics.
            limit_margin: distance to keep from the joint limits [rad or m].
            limited: whether to leave out positions beyond the limits.
        """
        self._arm, self._routine = arm, routine
        self._lower, self._upper = arm.lower + limit_margin, arm.upper - limit_margin
        self._limited = limited

    def solve(self, X_AH: Array, round_index: int) -> tuple[Indices, Array]:
        """See `ArmSolutions`.

        Raises:
            InvalidInputError: the routine returns arrays of a wrong shape, or its positions do not
                bring the hand to the poses.
        """
        n = len(self._lower)
        found = [np.asarray(q, dtype=float).reshape(-1, n) for q in self._call_routine(X_AH)]
        pose = np.repeat(np.arange(len(X_AH)), [len(q) for q in found])
        q = np.concatenate([np.empty((0, n)), *found])
        self._check(X_AH[pose], q)
        polished, met = solve_ik(
            self._arm.unlimited(), X_AH[pose], q, iterations=15, tolerance=1e-6
        )
        q = self._arm.wrapped_near(polished, 0.5 * (self._lower + self._upper))
        if self._limited:
            met &= ((self._lower <= q) & (q <= self._upper)).all(axis=1)
        return pose[met], q[met]

    def _call_routine(self, X_AH: Array) -> Sequence[Array]:
        found = self._routine(X_AH.copy())
        n = len(self._lower)
        shapes = [np.shape(q) for q in found]
        if len(shapes) != len(X_AH) or any(
            s[-1:] != (n,) and s not in ((0,), (0, n)) for s in shapes
        ):
            raise InvalidInputError(
                f"the IK routine returned arrays of shapes {list(dict.fromkeys(shapes))[:4]} for"
                f" {len(X_AH)} poses; expected {len(X_AH)} arrays of shape (S, {n}), one for each"
                " pose"
            )
        return found

    def _check(self, X_AH: Array, q: Array) -> None:
        if not np.isfinite(q).all():
            raise InvalidInputError("the IK routine returned joint positions that are not finite")
        X = self._arm.forward(q)[0]
        distance = np.linalg.norm(X[:, :3, 3] - X_AH[:, :3, 3], axis=1)
        turned = rotation_angle(X[:, :3, :3].swapaxes(-1, -2) @ X_AH[:, :3, :3])
        # Metres and radians. A calibrated arm deviates less from its data sheet.
        if len(q) and max(distance.max(), turned.max()) > 5e-3:
            k = int(np.argmax(np.maximum(distance, turned)))
            raise InvalidInputError(
                f"the joint positions {q[k].round(4).tolist()} of the IK routine place the hand"
                f" {distance[k]:.4f} m and {np.rad2deg(turned[k]):.2f} degrees from the requested"
                " pose; poses are those of the hand body in the frame of the arm's base"
            )
