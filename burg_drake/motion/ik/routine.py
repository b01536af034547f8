"""Inverse kinematics of one's own, for an arm that is known better than the numeric search does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from burg_drake.core import Array, Indices, InvalidInputError, rotation_angle
from burg_drake.motion.ik.numeric import ArmKinematics, solve_ik
from burg_drake.motion.ik.solutions import ITERATIONS, TOLERANCE

MISSED = 5e-3
"""Deviation of the hand above which a routine is taken to solve for another frame [m and rad];
what is below, such as the deviation of a calibrated arm from its data sheet, is polished away."""


class IkRoutine(Protocol):
    """Finds arm positions for hand poses."""

    def __call__(self, X_AH: Array) -> Sequence[Array]:
        """Solves for N poses.

        Args:
            X_AH: (N, 4, 4) wanted poses of the hand body (the station's `hand` document names it)
                in the frame of the arm's base link (`arm.base` of the station).

        Returns:
            For each pose the arm positions (S, n) that meet it, joints from base to hand [rad or
            m]; S may be 0. Of a redundant arm as many as are worth trying. Whole turns do not
            matter, and positions beyond the joint limits are told apart here.
        """
        ...


class RoutineSolutions:
    """What a routine finds, in one round; see `ArmSolutions`."""

    rounds = 1

    def __init__(
        self, arm: ArmKinematics, routine: IkRoutine, limit_margin: float, *, limited: bool = True
    ) -> None:
        """Wraps a routine.

        Args:
            arm: the arm.
            routine: its inverse kinematics.
            limit_margin: distance to keep from the joint limits [rad or m].
            limited: whether to leave out what is beyond the limits.
        """
        self._arm, self._routine = arm, routine
        self._lower, self._upper = arm.lower + limit_margin, arm.upper - limit_margin
        self._limited = limited

    def solve(self, X_AH: Array, turn: int) -> tuple[Indices, Array]:
        """See `ArmSolutions`.

        Raises:
            InvalidInputError: the routine does not return what it should, or its positions do not
                bring the hand to the poses.
        """
        n = len(self._lower)
        found = [np.asarray(q, dtype=float).reshape(-1, n) for q in self._ask(X_AH)]
        pose = np.repeat(np.arange(len(X_AH)), [len(q) for q in found])
        q = np.concatenate([np.empty((0, n)), *found])
        self._check(X_AH[pose], q)
        polished, met = solve_ik(
            self._arm.unlimited(), X_AH[pose], q, iterations=ITERATIONS, tolerance=TOLERANCE
        )
        q = self._arm.wrapped_near(polished, 0.5 * (self._lower + self._upper))
        if self._limited:
            met &= ((self._lower <= q) & (q <= self._upper)).all(axis=1)
        return pose[met], q[met]

    def _ask(self, X_AH: Array) -> Sequence[Array]:
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
        off = np.linalg.norm(X[:, :3, 3] - X_AH[:, :3, 3], axis=1)
        turned = rotation_angle(X[:, :3, :3].swapaxes(-1, -2) @ X_AH[:, :3, :3])
        if len(q) and max(off.max(), turned.max()) > MISSED:
            k = int(np.argmax(np.maximum(off, turned)))
            raise InvalidInputError(
                f"the joint positions {q[k].round(4).tolist()} of the IK routine place the hand"
                f" {off[k]:.4f} m and {np.rad2deg(turned[k]):.2f} degrees from the requested pose;"
                " poses are those of the hand body in the frame of the arm's base"
            )
