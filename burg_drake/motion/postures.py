"""Arm configurations at a grasp and its pregrasp, round by round, the most promising ones first.

Two ways to find them: the closed form of the Panda, and for any other serial arm a numeric search
that starts at postures near the wanted pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.content import rng_from
from burg_drake.core.frames import Array
from burg_drake.motion.ik import ArmKinematics, solve_ik
from burg_drake.motion.panda_ik import PandaIk
from burg_drake.motion.reach_settings import ReachSettings

LENGTH_SCALE = 0.3
"""Distance [m] that counts as much as one radian when postures near a pose are looked up."""


@dataclass(frozen=True)
class Posture:
    """Arm configurations at a grasp and at its pregrasp, on one branch.

    Attributes:
        way: 0 or 1, which finger is on which side.
        q, q_before: (n,) arm positions at grasp and pregrasp [rad].
    """

    way: int
    q: Array
    q_before: Array


class PostureSearch(Protocol):
    """Finds configurations without regard to collisions."""

    def rounds(self, X_AH: Array, X_AH_before: Array) -> Iterator[list[Posture]]:
        """Looks more and more thoroughly.

        Args:
            X_AH, X_AH_before: (2, 4, 4) hand poses at grasp and pregrasp, for the two ways to put
                the fingers.

        Returns:
            For each round configurations that the rounds before it did not have, within the
            joint limits, those closest to home first.
        """
        ...


def posture_search(arm: ArmKinematics, home: Array, settings: ReachSettings) -> PostureSearch:
    """The closed form where the arm has one and it is wanted, else the numeric search."""
    ik = PandaIk.of(arm) if settings.closed_form else None
    if ik is None:
        return NumericPostures(arm, home, settings)
    return ClosedFormPostures(ik, home, settings)


class ClosedFormPostures:
    """Sweeps the Panda's last joint; every branch of each of its values is found.

    The arm goes from pregrasp to grasp on the configuration that is nearest in joint space, at
    any swept value of the last joint.
    """

    def __init__(self, ik: PandaIk, home: Array, settings: ReachSettings) -> None:
        margin = settings.limit_margin
        self._ik = replace(ik, lower=ik.lower + margin, upper=ik.upper - margin)
        self._home = home
        self._settings = settings

    def rounds(self, X_AH: Array, X_AH_before: Array) -> Iterator[list[Posture]]:
        """See `PostureSearch`."""
        lower, upper = self._ik.lower[6], self._ik.upper[6]
        done: list[float] = []
        for count in self._settings.redundant:
            share = (np.arange(count) + 0.5) / count
            new = share[~np.isin(share, done)]
            done += new.tolist()
            yield self._postures(X_AH, X_AH_before, lower + new * (upper - lower))

    def _postures(self, X_AH: Array, X_AH_before: Array, q7: Array) -> list[Posture]:
        at, before = self._ik.solve(X_AH, q7), self._ik.solve(X_AH_before, q7)
        found = []
        for way in (0, 1):
            q, q_before = at.q[at.pose == way], before.q[before.pose == way]
            if len(q) and len(q_before):
                travel = np.abs(q[:, None] - q_before).max(axis=-1)
                nearest = travel.argmin(axis=1)
                near = travel.min(axis=1) <= self._settings.joint_travel
                found += [Posture(way, q[k], q_before[nearest[k]]) for k in np.flatnonzero(near)]
        return _by_distance(found, self._home)


class NumericPostures:
    """Levenberg-Marquardt from the postures of a fixed table whose hand poses are nearest, so that
    what is found depends on the grasp alone."""

    def __init__(self, arm: ArmKinematics, home: Array, settings: ReachSettings) -> None:
        self._arm = arm
        self._home = home
        self._settings = settings
        lower, upper = arm.lower + settings.limit_margin, arm.upper - settings.limit_margin
        rng = rng_from("burg_drake postures", settings.postures)
        q = rng.uniform(lower, upper, (settings.postures, len(lower)))
        q[0] = home
        X_AH, _ = arm.forward(q)
        self._q = q
        self._p = X_AH[:, :3, 3].copy()
        self._R = X_AH[:, :3, :3].reshape(-1, 9)

    def rounds(self, X_AH: Array, X_AH_before: Array) -> Iterator[list[Posture]]:
        """See `PostureSearch`."""
        used = 0
        for starts in self._settings.starts:
            way, start = self._nearest(X_AH, used, starts)
            used += starts
            yield self._postures(X_AH, X_AH_before, way, start)

    def _nearest(self, X_AH: Array, skip: int, count: int) -> tuple[NDArray[np.int_], Array]:
        """The postures with hand poses closest to two wanted ones (2, 4, 4), without the first
        `skip`: (count,) index of the pose and (count, n) arm positions."""
        cosine = 0.5 * (X_AH[:, :3, :3].reshape(2, 9) @ self._R.T - 1.0)
        offset = self._p - X_AH[0, :3, 3]  # swapping the fingers leaves the hand's origin in place
        squared = (
            np.arccos(np.clip(cosine, -1.0, 1.0)) ** 2 + (offset**2).sum(axis=1) / LENGTH_SCALE**2
        )
        order = np.argsort(squared, axis=None, kind="stable")[skip : skip + count]
        return order // len(self._q), self._q[order % len(self._q)]

    def _postures(
        self, X_AH: Array, X_AH_before: Array, way: NDArray[np.int_], start: Array
    ) -> list[Posture]:
        """Inverse kinematics at the grasp from (N, n) starts, and from there at the pregrasp."""
        q, met = self._solve(X_AH[way], start)
        way, q = way[met], q[met]
        if not len(q):
            return []
        q_before, met = self._solve(X_AH_before[way], q)
        met &= np.abs(q_before - q).max(axis=1) <= self._settings.joint_travel
        found = [Posture(int(way[k]), q[k], q_before[k]) for k in np.flatnonzero(met)]
        return _by_distance(found, self._home)

    def _solve(self, goal: Array, start: Array) -> tuple[Array, NDArray[np.bool_]]:
        return solve_ik(
            self._arm,
            goal,
            start,
            iterations=self._settings.iterations,
            tolerance=self._settings.tolerance,
            margin=self._settings.limit_margin,
        )


def _by_distance(postures: list[Posture], home: Array) -> list[Posture]:
    return sorted(postures, key=lambda posture: float(np.abs(posture.q_before - home).max()))
