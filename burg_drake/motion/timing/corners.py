"""Fast motions along polylines in joint space, with corners rounded where that is free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from burg_drake.core import Array
from burg_drake.motion.ik import ArmLimits
from burg_drake.motion.timing.cubics import Cubics, DoubleS, smoothed

IsFree = Callable[[Array], bool]
"""Whether the arm collides nowhere along rows (R, n), straight from row to row."""

RISES = np.geomspace(0.2, 2.0, 12)
"""Windows of the average that are tried, relative to the time to full speed; more than 1 helps
where a joint turns back."""
RAMPS = (1.0, 2.0)
"""The same for the second window; changes of jerk can add up where corners are close."""
SHARES = (0.0, 0.5)
"""Pauses at a corner that are tried, relative to the one at which it is met exactly."""
STEP = 0.02
"""Distance of rows that are checked, for the fastest joint [rad]."""
FINER = 8
"""Rows for each of them at which the distance from the polyline is measured."""
STILL = 0.001
"""Duration of a motion that goes nowhere [s]."""


def time_polyline(
    q: Array,
    limits: ArmLimits,
    *,
    deviation: float,
    is_free: IsFree | None = None,
    least: Array | None = None,
) -> Cubics:
    """Moves along a polyline, at rest at both ends.

    Args:
        q: (M, n) waypoints.
        limits: not to be exceeded.
        deviation: farthest from the polyline, as Euclidean distance of joint positions [rad].
        is_free: the check of what leaves the polyline. A corner where it fails is cut less, or the
            arm stops there; it does at all if there is no check.
        least: (M - 1,) least time to spend on each segment [s].

    Returns:
        The motion; straight between two waypoints.
    """
    moves = np.abs(np.diff(q, axis=0)).max(axis=1) > 0.0
    least = np.zeros(len(q) - 1) if least is None else least
    q, least = np.concatenate([q[:1], q[1:][moves]]), least[moves]
    if len(q) == 1:
        return Cubics.from_jerk_steps(q[0], np.array([0.0, STILL]), np.zeros((2, q.shape[1])))
    stops = Cubics.joined([_straight(q[k : k + 2], limits, least[k]) for k in range(len(least))])
    if is_free is None or len(q) == 2:
        return stops
    rounded = _rounded(q, limits, least, deviation, is_free)
    return min(stops, rounded, key=lambda motion: motion.duration)


def _rounded(
    q: Array, limits: ArmLimits, least: Array, deviation: float, is_free: IsFree
) -> Cubics:
    """At rest at those corners alone that may not be rounded."""
    if len(q) == 2:
        return _straight(q, limits, least[0])
    level = np.zeros(len(q) - 2, int)
    while level.max() < len(SHARES):
        path = _fastest(q, limits, least, np.take(SHARES, level))
        corners = range(len(level))
        cut = [k for k in corners if not path.is_good(k, deviation, is_free)]
        if not cut:
            return path.motion
        level[cut] += 1
    ends = [0, *(np.flatnonzero(level == len(SHARES)) + 1).tolist(), len(q) - 1]
    return Cubics.joined(
        [_rounded(q[i : k + 1], limits, least[i:k], deviation, is_free) for i, k in pairwise(ends)]
    )


def _straight(q: Array, limits: ArmLimits, least: float) -> Cubics:
    length = np.abs(q[1] - q[0])
    profile = DoubleS.of(
        1.0 / max(least, (length / limits.velocity).max()),
        1.0 / (length / limits.acceleration).max(),
        1.0 / (length / limits.jerk).max(),
    )
    unit = profile.over(q[1] - q[0])
    return Cubics(unit.t, unit.q + q[0], unit.v, unit.a, unit.j)


@dataclass(frozen=True, eq=False)
class _TimedPolyline:
    """A polyline in motion.

    Attributes:
        q: (M, n) waypoints.
        motion: along them.
        arrival, departure: (M - 2,) when corners begin and cease to matter [s].
    """

    q: Array
    motion: Cubics
    arrival: Array
    departure: Array

    def is_good(self, corner: int, deviation: float, is_free: IsFree) -> bool:
        """Whether the motion stays near a corner, and free."""
        start, end = self.arrival[corner], self.departure[corner]
        velocity = self.motion.peaks()[0].max()
        count = int(np.ceil((end - start) * velocity / STEP)) + 1
        rows = self.motion.at(np.linspace(start, end, FINER * count + 1))[0]
        farthest = distance_to_polyline(rows, self.q).max()
        return farthest <= 0.999 * deviation and is_free(rows[::FINER])


def _fastest(q: Array, limits: ArmLimits, least: Array, share: Array) -> _TimedPolyline:
    """The fastest of the windows tried; `share` (M - 2,) is how exactly corners are met."""
    length = np.abs(np.diff(q, axis=0))
    V, A, J = (
        (length / m).max(axis=1) for m in (limits.velocity, limits.acceleration, limits.jerk)
    )
    V = np.maximum(V, least)
    full = float((limits.velocity / limits.acceleration).max())
    build = float((limits.acceleration / limits.jerk).max())
    best, shortest = None, np.inf
    for ramp in build * np.array(RAMPS):
        for rise in full * RISES:
            travel = np.maximum.reduce([V, A / rise, J / (rise * ramp)])
            windows = DoubleS(float(travel.sum()), float(rise), float(ramp))
            dwell = share * (rise + ramp)
            motion = smoothed(q, travel, windows, dwell)
            factor = limits.time_scale(motion.peaks())
            if least.any():
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
