"""Fast motions along polylines in joint space, with corners rounded where that is free."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from burg_drake.core import Array
from burg_drake.motion.joint_limits import ArmLimits


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
        """Integrates a piecewise constant jerk, from rest at `q0`.

        Args:
            q0: (n,) start position.
            t: (K + 1,) times of the steps [s], in any order.
            steps: (K + 1, n) changes of the jerk at these times; they add up to 0.
        """
        order = np.argsort(t, kind="stable")
        t = t[order] - t[order[0]]
        h = np.diff(t)[:, None]
        j = np.cumsum(steps[order], axis=0)[:-1]
        a = _running_sums(np.zeros_like(q0), h * j)
        v = _running_sums(np.zeros_like(q0), h * (a[:-1] + h * j / 2.0))
        q = _running_sums(q0, h * (v[:-1] + h * (a[:-1] / 2.0 + h * j / 6.0)))
        return cls(t, q, v, a, j)

    @classmethod
    def joined(cls, parts: Sequence[Cubics]) -> Cubics:
        """Concatenates motions; each begins at rest where the one before ends at rest."""
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
        """The same path in `factor` times the time."""
        return Cubics(
            self.t * factor, self.q, self.v / factor, self.a / factor**2, self.j / factor**3
        )

    def peaks(self) -> tuple[Array, Array, Array]:
        """(n,) each: largest absolute velocity, acceleration and jerk."""
        h = np.diff(self.t)[:, None]
        # Knots less than 1 ns apart are the same knot, computed in two ways.
        a, j = self.a[:-1], np.where(h > 1e-9, self.j, 0.0)
        turns = np.divide(-a, j, out=np.zeros_like(j), where=j != 0.0)  # where a velocity peaks
        turns = np.where((turns > 0.0) & (turns < h), turns, 0.0)
        inside = self.v[:-1] + turns * (a + turns * j / 2.0)
        velocity = np.maximum(np.abs(self.v).max(axis=0), np.abs(inside).max(axis=0))
        return velocity, np.abs(self.a).max(axis=0), np.abs(j).max(axis=0)


def _running_sums(start: Array, increments: Array) -> Array:
    """(K + 1, n) sums of (K, n) increments, beginning with `start`."""
    return np.cumsum(np.concatenate([start[None], increments]), axis=0)


@dataclass(frozen=True)
class DoubleS:
    """The fastest motion over a unit length from rest to rest: a linear ramp of positions, smoothed
    by two moving averages.

    It equals the usual profile of seven phases (Biagiotti and Melchiorri, "Trajectory Planning for
    Automatic Machines and Robots", 2008, section 3.4). As a cascade of averages it also applies to
    paths with corners (the same, "FIR filters for online trajectory planning with time- and
    frequency-domain specifications", Control Engineering Practice 20, 2012).

    Attributes:
        travel: time of the unit length at constant speed, 1 over the top speed [s].
        rise: window of the first average: top speed over largest acceleration [s].
        ramp: window of the second average: largest acceleration over jerk [s].
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
        """The motion with limits [1/s, 1/s^2, 1/s^3], all above 0 and finite."""
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
        return smooth_polyline(
            np.stack([np.zeros_like(length), length]), np.array([self.travel]), self
        )


def smooth_polyline(
    q: Array, travel: Array, windows: DoubleS, dwell: Array | None = None
) -> Cubics:
    """A polyline at constant speed on each segment, averaged over two windows, one after the other.

    Every position and velocity is a weighted mean of those of the polyline within half of both
    windows around it, and so stays within their range. A stop at a waypoint that is as long as both
    windows makes the motion pass through it exactly.

    Args:
        q: (M, n) waypoints.
        travel: (M - 1,) time on each segment [s].
        windows: the windows `rise` and `ramp`.
        dwell: (M - 2,) time to stop at each inner waypoint [s]; no stops if None.
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


IsFree = Callable[[Array], bool]
"""Whether the arm is free along rows (R, n), straight from row to row."""


def time_polyline(
    q: Array,
    limits: ArmLimits,
    *,
    deviation: float,
    is_free: IsFree | None = None,
    min_times: Array | None = None,
) -> Cubics:
    """Times a motion along a polyline, at rest at both ends.

    Args:
        q: (M, n) waypoints.
        limits: limits of the joints; none is exceeded.
        deviation: largest Euclidean distance of joint positions from the polyline [rad].
        is_free: collision check of rounded corners. A corner where it fails is cut less, or the arm
            stops there. Without a check the arm stops at all corners.
        min_times: (M - 1,) shortest time on each segment [s].

    Returns:
        The motion; straight between two waypoints.
    """
    moves = np.abs(np.diff(q, axis=0)).max(axis=1) > 0.0
    min_times = np.zeros(len(q) - 1) if min_times is None else min_times
    q, min_times = np.concatenate([q[:1], q[1:][moves]]), min_times[moves]
    if len(q) == 1:
        # A motion that goes nowhere takes 1 ms.
        return Cubics.from_jerk_steps(q[0], np.array([0.0, 0.001]), np.zeros((2, q.shape[1])))
    stops = Cubics.joined(
        [_time_straight(q[k : k + 2], limits, min_times[k]) for k in range(len(min_times))]
    )
    if is_free is None or len(q) == 2:
        return stops
    rounded = _time_rounded(q, limits, min_times, deviation, is_free)
    return min(stops, rounded, key=lambda motion: motion.duration)


def _time_rounded(
    q: Array, limits: ArmLimits, min_times: Array, deviation: float, is_free: IsFree
) -> Cubics:
    """Times a motion that stops only at corners that cannot be rounded."""
    pause_shares = (0.0, 0.5)  # Shares of the pause with which the motion meets a corner exactly.
    if len(q) == 2:
        return _time_straight(q, limits, min_times[0])
    level = np.zeros(len(q) - 2, int)
    while level.max() < len(pause_shares):
        path = _fastest_polyline(q, limits, min_times, np.take(pause_shares, level))
        corners = range(len(level))
        cut = [k for k in corners if not path.is_good(k, deviation, is_free)]
        if not cut:
            return path.motion
        level[cut] += 1
    ends = [0, *(np.flatnonzero(level == len(pause_shares)) + 1).tolist(), len(q) - 1]
    return Cubics.joined(
        [
            _time_rounded(q[i : k + 1], limits, min_times[i:k], deviation, is_free)
            for i, k in pairwise(ends)
        ]
    )


def _time_straight(q: Array, limits: ArmLimits, min_time: float) -> Cubics:
    length = np.abs(q[1] - q[0])
    profile = DoubleS.of(
        1.0 / max(min_time, (length / limits.velocity).max()),
        1.0 / (length / limits.acceleration).max(),
        1.0 / (length / limits.jerk).max(),
    )
    unit = profile.over(q[1] - q[0])
    return Cubics(unit.t, unit.q + q[0], unit.v, unit.a, unit.j)


@dataclass(frozen=True, eq=False)
class _TimedPolyline:
    """A timed motion along a polyline.

    Attributes:
        q: (M, n) waypoints.
        motion: the motion along the waypoints.
        arrival, departure: (M - 2,) times at which corners begin and end to affect the motion [s].
    """

    q: Array
    motion: Cubics
    arrival: Array
    departure: Array

    def is_good(self, corner: int, deviation: float, is_free: IsFree) -> bool:
        """Whether the motion at a corner is free and within `deviation` of the polyline."""
        finer_rows = 8  # Rows per checked row at which the deviation is measured.
        start, end = self.arrival[corner], self.departure[corner]
        velocity = self.motion.peaks()[0].max()
        # Between two checked rows the fastest joint moves by at most 0.02 rad.
        count = int(np.ceil((end - start) * velocity / 0.02)) + 1
        rows = self.motion.at(np.linspace(start, end, finer_rows * count + 1))[0]
        farthest = distance_to_polyline(rows, self.q).max()
        return farthest <= 0.999 * deviation and is_free(rows[::finer_rows])


def _fastest_polyline(
    q: Array, limits: ArmLimits, min_times: Array, share: Array
) -> _TimedPolyline:
    """The fastest motion over several windows. Pauses at the corners are `share` (M - 2,) of the
    windows' lengths."""
    # Ratios of the first window to the time to full speed. Above 1 helps where a joint turns back.
    rise_factors = np.geomspace(0.2, 2.0, 12)
    # Ratios of the second window to the time to full acceleration. Jerk can add up where corners
    # are close.
    ramp_factors = (1.0, 2.0)
    length = np.abs(np.diff(q, axis=0))
    V, A, J = (
        (length / m).max(axis=1) for m in (limits.velocity, limits.acceleration, limits.jerk)
    )
    V = np.maximum(V, min_times)
    full_speed_time = float((limits.velocity / limits.acceleration).max())
    full_acceleration_time = float((limits.acceleration / limits.jerk).max())
    best, shortest = None, np.inf
    for ramp in full_acceleration_time * np.array(ramp_factors):
        for rise in full_speed_time * rise_factors:
            travel = np.maximum.reduce([V, A / rise, J / (rise * ramp)])
            windows = DoubleS(float(travel.sum()), float(rise), float(ramp))
            dwell = share * (rise + ramp)
            motion = smooth_polyline(q, travel, windows, dwell)
            factor = limits.time_scale(motion.peaks())
            if min_times.any():
                factor = max(factor, 1.0)
            if motion.duration * factor < shortest:
                shortest = motion.duration * factor
                arrival = np.cumsum(travel)[:-1] + np.cumsum(dwell) - dwell
                departure = arrival + dwell + rise + ramp
                best = motion.time_scaled(factor), arrival * factor, departure * factor
    assert best is not None
    return _TimedPolyline(q, *best)


def distance_to_polyline(rows: Array, q: Array) -> Array:
    """(R,) Euclidean distances of rows (R, n) to the polyline through q (M, n)."""
    start, segment = q[:-1], np.diff(q, axis=0)
    length = np.maximum((segment**2).sum(axis=1), np.finfo(float).tiny)
    offset = rows[:, None] - start
    along = np.clip((offset * segment).sum(axis=2) / length, 0.0, 1.0)
    gap = offset - along[..., None] * segment
    return np.asarray(np.sqrt((gap**2).sum(axis=2)).min(axis=1))
