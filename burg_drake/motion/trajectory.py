"""Trajectories of an arm, and the origin of a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from burg_drake.core import Array

if TYPE_CHECKING:
    from pydrake.trajectories import PiecewisePolynomial

    from burg_drake.motion.joint_limits import ArmLimits


class Motion(Protocol):
    """Positions of n joints as functions of time."""

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""

    def at(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Position, velocity, acceleration and jerk, each (T, n), at times (T,) [s]."""

    def time_scaled(self, factor: float) -> Motion:
        """The same path in `factor` times the time."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Arm positions over time, at rest at both ends.

    Attributes:
        t: (T,) rising from 0 [s]; T is at least 2.
        q, v, a: (T, n) positions [rad], velocities [rad/s] and accelerations [rad/s^2].
    """

    t: Array
    q: Array
    v: Array
    a: Array

    @classmethod
    def of(cls, motion: Motion, start: Array, end: Array, rate: float) -> Trajectory:
        """Samples a motion, rounded to 12 decimals, so that it is written fast.

        Args:
            motion: a motion from rest to rest; it is stretched to a whole number of samples.
            start, end: (n,) exact first and last positions.
            rate: samples per second.
        """
        count = max(1, int(np.ceil(motion.duration * rate - 1e-6)))
        t = np.arange(count + 1) / rate
        motion = motion.time_scaled(t[-1] / motion.duration)
        q, v, a = (round_to_grid(x) for x in motion.at(t)[:3])
        q[0], q[-1] = start, end
        v[[0, -1]] = a[[0, -1]] = 0.0
        return cls(t, q, v, a)

    @classmethod
    def rest(cls, q: Array, duration: float, rate: float) -> Trajectory:
        """Rests at q (n,) for a duration [s]."""
        t = np.arange(max(1, int(np.ceil(duration * rate - 1e-6))) + 1) / rate
        still = np.zeros((len(t), len(q)))
        return cls(t, still + q, still, still)

    @classmethod
    def joined(cls, parts: Sequence[Trajectory]) -> Trajectory:
        """Concatenates trajectories; the last row of one is the first row of the next."""
        t, rows = [parts[0].t], [slice(None)] + [slice(1, None)] * (len(parts) - 1)
        for part in parts[1:]:
            t.append(round_to_grid(t[-1][-1] + part.t[1:]))
        q, v, a = (
            np.concatenate([getattr(p, name)[row] for p, row in zip(parts, rows, strict=True)])
            for name in ("q", "v", "a")
        )
        return cls(np.concatenate(t), q, v, a)

    def __repr__(self) -> str:
        samples, joints = self.q.shape
        return f"Trajectory({samples} samples of {joints} joints, {self.duration:.2f} s)"

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return float(self.t[-1])

    @property
    def rate(self) -> float:
        """Samples per second. For evenly spaced samples and rates of up to six decimals, `t` is
        `arange(T) / rate` bit by bit."""
        rate = 1.0 / float(self.t[1])
        near = round(rate, 6)
        return near if near and 1.0 / near == self.t[1] else rate

    def at(self, time: float | Array) -> Array:
        """Positions (..., n) at times (...) [s], by cubic polynomials between the samples, clamped
        to the ends."""
        when = np.clip(np.asarray(time, dtype=float), 0.0, self.duration)
        k = np.clip(np.searchsorted(self.t, when, side="right") - 1, 0, len(self.t) - 2)
        h = (self.t[k + 1] - self.t[k])[..., None]
        u = (when - self.t[k])[..., None] / h
        ahead = self.q[k + 1] - self.q[k]
        start, end = h * self.v[k] - ahead, ahead - h * self.v[k + 1]
        return np.asarray(self.q[k] + u * (ahead + (1.0 - u) * ((1.0 - u) * start + u * end)))

    def peaks(self) -> tuple[Array, Array, Array]:
        """(n,) each: largest absolute velocity, acceleration and jerk of the samples.

        They are finite differences of positions, velocities and accelerations, as a controller
        computes them; velocities and accelerations also include the samples themselves.
        """
        h = np.diff(self.t)[:, None]
        rates = [np.abs(np.diff(x, axis=0) / h).max(axis=0) for x in (self.q, self.v, self.a)]
        velocity = np.maximum(rates[0], np.abs(self.v).max(axis=0))
        return velocity, np.maximum(rates[1], np.abs(self.a).max(axis=0)), rates[2]

    def to_drake(self) -> PiecewisePolynomial:
        """Cubic polynomials between the samples, for Drake's `TrajectorySource`."""
        from pydrake.trajectories import PiecewisePolynomial

        motion: PiecewisePolynomial = PiecewisePolynomial.CubicHermite(self.t, self.q.T, self.v.T)
        return motion


MOTION_PHASES = ("transfer", "approach", "close", "retreat", "lift")
"""Phases of a plan in order. The arm rests while the hand closes; the retreat is optional."""


@dataclass(frozen=True, eq=False)
class PlanOrigin:
    """Scene, station and grasp that a plan is for.

    Attributes:
        joints: names of the n joints, in the order of the trajectories' columns.
        limits: limits of these joints.
        station, scene: names.
        station_content, scene_content: content hashes of station and scene.
        instance: the target in the scene; empty if there is none.
        X_WG: (4, 4) the grasp in the world, with the chosen finger assignment.
    """

    joints: tuple[str, ...]
    limits: ArmLimits
    station: str
    station_content: str
    scene: str
    scene_content: str
    instance: str
    X_WG: Array


def round_to_grid(values: Array) -> Array:
    """Rounds to 12 decimals; numbers larger than 9000 do not change.

    Up to 9000, the text and the number have the same bits after a round trip, as both are the
    floating-point number nearest to the same decimal.
    """
    grid_scale = 1e12  # steps in a unit: a thousandth of a nanometre or nanoradian
    small = np.abs(values) <= 9000.0
    units = np.rint(np.where(small, values, 0.0) * grid_scale)
    return np.where(small, units / grid_scale + 0.0, values)  # no negative zeros
