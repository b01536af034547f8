"""Motions of the hand along a straight line: the joint path is smooth in the path length of the
hand, and the hand has its own limits of speed and acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from burg_drake.core import Array
from burg_drake.motion.ik import ArmKinematics, ArmLimits
from burg_drake.motion.timing.corners import IsFree, time_polyline
from burg_drake.motion.timing.cubics import Cubics, DoubleS
from burg_drake.motion.timing.line_path import LinePath
from burg_drake.motion.timing.timing_settings import TimingSettings

POLYLINE_DEVIATION = 0.002
"""How far a line's polyline may be left at its corners, where no smooth path will do [rad]."""
TRIES = 5
"""Top speeds of the hand that are tried where the joints cannot follow."""
SLACK = 0.998
"""Share of the limits that is used, as peaks are looked for at single times ..."""
COARSER = 4
"""... this many times as far apart as the samples of a plan, which are looked at again."""


@dataclass(frozen=True)
class HandSpeed:
    """Limits of the hand along a line.

    Attributes:
        speed: [m/s].
        acceleration: [m/s^2].
        ramp: time to build it up [s].
    """

    speed: float
    acceleration: float
    ramp: float

    def over(self, length: float, share: float = 1.0) -> Cubics:
        """The way (n = 1) over time along a line [m], with a share of the speed."""
        acceleration = self.acceleration / length
        profile = DoubleS.of(share * self.speed / length, acceleration, acceleration / self.ramp)
        return profile.over(np.array([length]))


@dataclass(frozen=True, eq=False)
class PathMotion:
    """A motion along a path that is given by the path length of the hand.

    Attributes:
        path: joint positions (n,) over the way [m], with continuous second derivatives.
        profile: the way over time, n = 1.
    """

    path: CubicSpline
    profile: Cubics

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return self.profile.duration

    def time_scaled(self, factor: float) -> PathMotion:
        """The same way in `factor` times the time."""
        return PathMotion(self.path, self.profile.time_scaled(factor))

    def at(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Position, velocity, acceleration and jerk, each (T, n), at times (T,) [s]."""
        s, v, a, j = self.profile.at(time)
        length = np.clip(s[:, 0], 0.0, self.path.x[-1])
        q, q1, q2, q3 = (self.path(length, order) for order in range(4))
        return q, q1 * v, q2 * v**2 + q1 * a, q3 * v**3 + 3.0 * q2 * v * a + q1 * j

    def peaks(self, rate: float) -> tuple[Array, Array, Array]:
        """(n,) each: largest absolute velocity, acceleration and jerk."""
        time = np.linspace(0.0, self.duration, int(self.duration * rate) + 2)
        v, a, j = (np.abs(x).max(axis=0) for x in self.at(time)[1:])
        return v, a, j


def time_line(
    rows: Array,
    kinematics: ArmKinematics,
    limits: ArmLimits,
    hand: HandSpeed,
    settings: TimingSettings,
    *,
    is_free: IsFree | None = None,
    limit_margin: float = 0.0,
) -> PathMotion | Cubics:
    """Moves along a line, at rest at both ends.

    The path is a cubic spline close to the rows, with the hand on the line. Where the joints cannot
    follow the hand's speed along it, and a check is given, smoother ones are tried; where the hand
    is not straight enough between the spline's knots, one with more of them. Then the hand is
    slowed down. Where no spline will do, the arm follows the polyline of the rows, which may mean
    stops.

    Args:
        rows: (K, n) joint positions at waypoints of the line.
        kinematics: the arm.
        limits: of its joints.
        hand: limits of the hand.
        settings: tolerances.
        is_free: the check of all but the polyline of the rows.
        limit_margin: distance to keep from the joints' limits [rad or m], where the rows do.
    """
    line = LinePath.of(rows, kinematics, limit_margin)
    if line.length > 0.0:
        slow: list[PathMotion] = []
        for path in line.paths(smoother=is_free is not None):
            motion, full = _fastest(path, hand, limits, settings.rate / COARSER)
            if not full:
                slow.append(motion)
            elif line.is_good(path, settings.straightness, settings.line_deviation, is_free):
                return motion
        for motion in sorted(slow, key=lambda motion: motion.duration):
            if line.is_good(motion.path, settings.straightness, settings.line_deviation, is_free):
                return motion
    least = np.diff(line.travel) / max(hand.speed, np.finfo(float).tiny)
    return time_polyline(rows, limits, deviation=POLYLINE_DEVIATION, is_free=is_free, least=least)


def _fastest(
    path: CubicSpline, hand: HandSpeed, limits: ArmLimits, rate: float
) -> tuple[PathMotion, bool]:
    """The fastest motion found along a path, and whether the hand has its full speed."""
    length = float(path.x[-1])
    best = PathMotion(path, hand.over(length))
    time_scale = limits.time_scale(best.peaks(rate)) / SLACK
    if time_scale <= 1.0:
        return best, True
    best = best.time_scaled(time_scale)
    for share in np.geomspace(1.0, 1.0 / time_scale, TRIES)[1:]:
        motion = PathMotion(path, hand.over(length, float(share)))
        if motion.duration < best.duration:
            factor = limits.time_scale(motion.peaks(rate)) / SLACK
            motion = motion.time_scaled(max(1.0, factor))
            best = min(best, motion, key=lambda candidate: candidate.duration)
    return best, False
