"""Motions of piecewise constant jerk: exact evaluation, and exact peaks of the derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array

ROUNDING = 1e-9
"""Knots this close are one that was computed in two ways [s]."""


@dataclass(frozen=True, eq=False)
class Cubics:
    """Piecewise cubic polynomials of n coordinates over time, with continuous acceleration.

    Attributes:
        t: (K + 1,) knots, rising from 0 [s].
        q, v, a: (K + 1, n) position and its first two derivatives at the knots.
        j: (K, n) third derivative after each knot but the last.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    j: Array

    @classmethod
    def from_jerk_steps(cls, q0: Array, t: Array, steps: Array) -> Cubics:
        """From rest at `q0`.

        Args:
            q0: (n,) where it starts.
            t: (K + 1,) times of the steps [s], in any order.
            steps: (K + 1, n) by how much the jerk changes there; adds up to 0.
        """
        order = np.argsort(t, kind="stable")
        t = t[order] - t[order[0]]
        h = np.diff(t)[:, None]
        j = np.cumsum(steps[order], axis=0)[:-1]
        a = _running(np.zeros_like(q0), h * j)
        v = _running(np.zeros_like(q0), h * (a[:-1] + h * j / 2.0))
        q = _running(q0, h * (v[:-1] + h * (a[:-1] / 2.0 + h * j / 6.0)))
        return cls(t, q, v, a, j)

    @classmethod
    def joined(cls, parts: Sequence[Cubics]) -> Cubics:
        """One after the other; each begins at rest where the one before has come to rest."""
        start = np.cumsum([0.0] + [part.duration for part in parts])
        t, q, v, a = (
            np.concatenate([x[:-1] for x in knots] + [knots[-1][-1:]])
            for knots in (
                [part.t + time for part, time in zip(parts, start[:-1], strict=True)],
                *([getattr(part, name) for part in parts] for name in "qva"),
            )
        )
        return cls(t, q, v, a, np.concatenate([part.j for part in parts]))

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return float(self.t[-1])

    def at(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Position, velocity, acceleration and jerk, each (T, n), at times (T,) [s]."""
        k = np.searchsorted(self.t, time, side="right") - 1
        k = np.clip(k, 0, len(self.j) - 1)
        u = (np.clip(time, 0.0, self.t[-1]) - self.t[k])[:, None]
        q, v, a, j = self.q[k], self.v[k], self.a[k], self.j[k]
        return (
            q + u * (v + u * (a / 2.0 + u * j / 6.0)),
            v + u * (a + u * j / 2.0),
            a + u * j,
            j,
        )

    def time_scaled(self, factor: float) -> Cubics:
        """The same way in `factor` times the time."""
        return Cubics(
            self.t * factor, self.q, self.v / factor, self.a / factor**2, self.j / factor**3
        )

    def peaks(self) -> tuple[Array, Array, Array]:
        """(n,) each: largest absolute velocity, acceleration and jerk."""
        h = np.diff(self.t)[:, None]
        a, j = self.a[:-1], np.where(h > ROUNDING, self.j, 0.0)
        turns = np.divide(-a, j, out=np.zeros_like(j), where=j != 0.0)  # where a velocity peaks
        turns = np.where((turns > 0.0) & (turns < h), turns, 0.0)
        inside = self.v[:-1] + turns * (a + turns * j / 2.0)
        velocity = np.maximum(np.abs(self.v).max(axis=0), np.abs(inside).max(axis=0))
        return velocity, np.abs(self.a).max(axis=0), np.abs(j).max(axis=0)


def _running(start: Array, increments: Array) -> Array:
    """(K + 1, n) sums of (K, n) increments, beginning with `start`."""
    return np.cumsum(np.concatenate([start[None], increments]), axis=0)


@dataclass(frozen=True)
class DoubleS:
    """The fastest motion over a unit of way from rest to rest: a ramp of positions that two moving
    averages make smooth.

    It is what others compose of seven phases (Biagiotti and Melchiorri, "Trajectory Planning for
    Automatic Machines and Robots", 2008, section 3.4); as a cascade of averages it carries over to
    ways with corners (the same, "FIR filters for online trajectory planning with time- and
    frequency-domain specifications", Control Engineering Practice 20, 2012).

    Attributes:
        travel: time of the way at constant speed, 1 over the top speed [s].
        rise: window of the first average: top speed over largest acceleration [s].
        ramp: window of the second one: largest acceleration over jerk [s].
    """

    travel: float
    rise: float
    ramp: float

    @property
    def duration(self) -> float:
        """Time from rest to rest [s]."""
        return self.travel + self.rise + self.ramp

    @classmethod
    def of(cls, velocity: float, acceleration: float, jerk: float) -> DoubleS:
        """From the limits [1/s, 1/s^2, 1/s^3], all above 0 and finite."""
        ramp = acceleration / jerk
        rise = velocity / acceleration
        if rise < ramp:  # the largest acceleration is not reached
            rise = ramp = (velocity / jerk) ** 0.5
        if rise + ramp <= 1.0 / velocity:
            return cls(1.0 / velocity, rise, ramp)
        # The top speed is not reached: travel = rise + ramp.
        ramp = acceleration / jerk
        rise = (ramp**2 / 4.0 + 1.0 / acceleration) ** 0.5 - ramp / 2.0
        if rise < ramp:
            rise = ramp = (0.5 / jerk) ** (1.0 / 3.0)
        return cls(rise + ramp, rise, ramp)

    def over(self, length: Array) -> Cubics:
        """The motion of n coordinates from 0 over `length` (n,)."""
        return smoothed(np.stack([np.zeros_like(length), length]), np.array([self.travel]), self)


def smoothed(q: Array, travel: Array, windows: DoubleS, dwell: Array | None = None) -> Cubics:
    """A polyline at constant speed on each segment, averaged over two windows, one after the other.

    Every position is a weighted mean of those of the polyline within half of both windows around
    it, and so is every velocity: neither leaves the range of the polyline's. After a stop at a
    waypoint that is as long as both windows the polyline is met exactly.

    Args:
        q: (M, n) waypoints.
        travel: (M - 1,) time on each segment [s].
        windows: `rise` and `ramp`.
        dwell: (M - 2,) time to stop at each inner waypoint [s]; none if not given.
    """
    rate = np.diff(q, axis=0) / travel[:, None]
    stop = np.cumsum(travel)
    if dwell is not None:
        stop[1:] += np.cumsum(dwell)
    change = np.concatenate([stop - travel, stop])  # times at which the speed changes
    steps = np.concatenate([rate, -rate]) / (windows.rise * windows.ramp)
    rise, ramp = windows.rise, windows.ramp
    t = np.concatenate([change, change + ramp, change + rise, change + rise + ramp])
    return Cubics.from_jerk_steps(q[0], t, np.concatenate([steps, -steps, -steps, steps]))
