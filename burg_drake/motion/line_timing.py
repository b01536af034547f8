"""Motions of the hand along a straight line, within the limits of the joints and of the hand.

The joint path is smooth in the path length of the hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from burg_drake.core import Array
from burg_drake.motion.joint_limits import ArmLimits
from burg_drake.motion.motion_settings import TimingSettings
from burg_drake.motion.numeric_ik import ArmKinematics, rotation_vector, solve_ik
from burg_drake.motion.polyline_timing import (
    Cubics,
    DoubleS,
    IsFree,
    distance_to_polyline,
    time_polyline,
)


@dataclass(frozen=True, eq=False)
class LinePath:
    """A straight segment of the hand's path, given by arm positions.

    Attributes:
        rows: (K, n) joint positions along it.
        X_AH: (K, 4, 4) hand poses at the rows.
        travel: (K,) path length of the hand from the first row [m].
        kinematics: the arm; its limits include the margin, but never exclude a row.
    """

    rows: Array
    X_AH: Array
    travel: Array
    kinematics: ArmKinematics

    @classmethod
    def of(cls, rows: Array, kinematics: ArmKinematics, limit_margin: float = 0.0) -> LinePath:
        """The segment through the rows (K, n), with a margin to the joint limits [rad or m]."""
        kinematics = replace(
            kinematics,
            lower=np.minimum(kinematics.lower + limit_margin, rows.min(axis=0)),
            upper=np.maximum(kinematics.upper - limit_margin, rows.max(axis=0)),
        )
        X_AH = kinematics.forward(rows)[0]
        steps = np.linalg.norm(np.diff(X_AH[:, :3, 3], axis=0), axis=1)
        return cls(rows, X_AH, np.append(0.0, np.cumsum(steps)), kinematics)

    @property
    def length(self) -> float:
        """Path length of the hand [m]."""
        return float(self.travel[-1])

    def paths(self, smoother: bool) -> Iterator[CubicSpline]:
        """Splines of joint positions over the path length of the hand [m].

        First one close to the rows; then, if `smoother`, increasingly smooth ones; last one that is
        closer to the line.
        """
        max_spacing = 0.01  # Metres between knots of the spline.
        # Metres between knots of the last spline, which is closer to the line.
        fine_spacing = 0.0025
        # Weights of the knots' second differences: they smooth over 3 knots, 10, or all.
        smoothing_weights = (1e2, 1e4, np.inf)
        weights = (0.0, *smoothing_weights) if smoother else (0.0,)
        for spacing, weight in (*((max_spacing, w) for w in weights), (fine_spacing, 0.0)):
            path = self._path(spacing, weight)
            if path is not None:
                yield path

    def _path(self, spacing: float, weight: float) -> CubicSpline | None:
        """A spline with its knots on the line; None if the arm does not reach a knot."""
        count = max(4, int(np.ceil(self.length / spacing))) + 1
        share = np.linspace(0.0, 1.0, count)[:, None]
        travel = share[:, 0] * self.length
        straight = self.rows[0] + share * (self.rows[-1] - self.rows[0])
        near = np.stack([np.interp(travel, self.travel, joint) for joint in self.rows.T], axis=1)
        X_AH = np.repeat(self.X_AH[:1], count, axis=0)
        X_AH[:, :3, 3] += share * (self.X_AH[-1, :3, 3] - self.X_AH[0, :3, 3])
        knots = straight.copy()
        if np.isfinite(weight):
            knots[1:-1] += _smooth_offsets((near - straight)[1:-1], weight)
        knots[0], knots[-1] = self.rows[0], self.rows[-1]
        knots[1:-1], met = solve_ik(
            self.kinematics, X_AH[1:-1], knots[1:-1], iterations=20, tolerance=1e-9
        )
        return CubicSpline(travel, knots) if met.all() else None

    def is_good(
        self, path: CubicSpline, straightness: float, deviation: float, is_free: IsFree | None
    ) -> bool:
        """Whether a path keeps the joint limits, the hand's line, and is free.

        Args:
            path: one of `paths`.
            straightness: largest distance from the straight line [m].
            deviation: largest distance from the rows' polyline if `is_free` is None [rad].
            is_free: the collision check, or None.
        """
        low, high = spline_extremes(path)
        if (low < self.kinematics.lower).any() or (high > self.kinematics.upper).any():
            return False
        q = path(np.linspace(0.0, self.length, 4 * (len(path.x) - 1) + 1))
        X_AH = self.kinematics.forward(q)[0]
        if line_error(X_AH, self.X_AH[0], self.X_AH[-1]) > straightness:
            return False
        if is_free is None:
            return bool(distance_to_polyline(q, self.rows).max() <= deviation)
        return is_free(q)


def _smooth_offsets(offset: Array, weight: float) -> Array:
    """Smooths offsets (count, n) between two fixed points at 0 by least squares with weighted
    second differences (a pentadiagonal matrix)."""
    if weight == 0.0:
        return offset
    count = len(offset)
    bend = np.diff(np.eye(count + 2), 2, axis=0)[:, 1:-1]
    A = np.eye(count) + weight * bend.T @ bend
    upper = [np.pad(np.diag(A, k), (k, 0)) for k in (2, 1, 0)]
    return np.asarray(solveh_banded(upper, offset))


def spline_extremes(path: CubicSpline) -> tuple[Array, Array]:
    """(n,) smallest and (n,) largest values of n splines, at knots or extrema of the cubics."""
    a, b, c, d = path.c
    with np.errstate(all="ignore"):
        s = -b - np.copysign(np.sqrt(b * b - 3.0 * a * c), b)
        turns = np.nan_to_num([s / (3.0 * a), c / s], nan=0.0)
    u = np.clip(turns, 0.0, np.diff(path.x)[:, None])
    inner = d + u * (c + u * (b + u * a))
    values = np.concatenate([path(path.x), *inner])
    return values.min(axis=0), values.max(axis=0)


def line_error(X_AH: Array, X_A0: Array, X_A1: Array) -> float:
    """Largest distance of hand poses (N, 4, 4) from the straight line between two poses [m]; a
    rotation away from the first pose counts with a lever of 10 cm."""
    lever = 0.1  # Metres from the hand at which its rotation counts as a deviation.
    segment = X_A1[:3, 3] - X_A0[:3, 3]
    offset = X_AH[:, :3, 3] - X_A0[:3, 3]
    along = offset @ segment / max(float(segment @ segment), np.finfo(float).tiny)
    gap = np.linalg.norm(offset - np.clip(along, 0.0, 1.0)[:, None] * segment, axis=1)
    turn = np.linalg.norm(rotation_vector(X_AH[:, :3, :3] @ X_A0[:3, :3].T), axis=1)
    return float(np.maximum(gap, lever * turn).max())


@dataclass(frozen=True)
class HandSpeed:
    """Limits of the hand along a line.

    Attributes:
        speed: [m/s].
        acceleration: [m/s^2].
        ramp: time to build up the acceleration [s].
    """

    speed: float
    acceleration: float
    ramp: float

    def over(self, length: float, share: float = 1.0) -> Cubics:
        """Path length (n = 1) over time along a line of `length` [m], at a share of the speed."""
        acceleration = self.acceleration / length
        profile = DoubleS.of(share * self.speed / length, acceleration, acceleration / self.ramp)
        return profile.over(np.array([length]))


@dataclass(frozen=True, eq=False)
class PathMotion:
    """A motion along a path that is given by the path length of the hand.

    Attributes:
        path: joint positions (n,) over path length [m], with continuous second derivatives.
        profile: path length over time, n = 1.
    """

    path: CubicSpline
    profile: Cubics

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return self.profile.duration

    def time_scaled(self, factor: float) -> PathMotion:
        """The same path in `factor` times the time."""
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
    """Times a motion along a line, at rest at both ends.

    The path is a cubic spline close to the rows, with the hand on the line. If the joints cannot
    follow the hand's speed, smoother splines are tried (only with a check); if the hand deviates
    too far between the knots, a spline with more knots. Then the hand is slowed down. If no spline
    is good enough, the arm follows the polyline of the rows, which may mean stops.

    Args:
        rows: (K, n) joint positions at waypoints of the line.
        kinematics: the arm.
        limits: limits of its joints.
        hand: limits of the hand.
        settings: tolerances.
        is_free: the collision check of everything but the polyline of the rows.
        limit_margin: distance to keep from the joint limits [rad or m], if the rows keep it.
    """
    line = LinePath.of(rows, kinematics, limit_margin)
    if line.length > 0.0:
        slow: list[PathMotion] = []
        for path in line.paths(smoother=is_free is not None):
            # Peaks are evaluated at every fourth sample of a plan.
            motion, full = _fastest_line_motion(path, hand, limits, settings.rate / 4)
            if not full:
                slow.append(motion)
            elif line.is_good(path, settings.straightness, settings.line_deviation, is_free):
                return motion
        for motion in sorted(slow, key=lambda motion: motion.duration):
            if line.is_good(motion.path, settings.straightness, settings.line_deviation, is_free):
                return motion
    min_times = np.diff(line.travel) / max(hand.speed, np.finfo(float).tiny)
    # Without a good smooth path, corners are cut by 0.002 rad.
    return time_polyline(rows, limits, deviation=0.002, is_free=is_free, min_times=min_times)


def _fastest_line_motion(
    path: CubicSpline, hand: HandSpeed, limits: ArmLimits, rate: float
) -> tuple[PathMotion, bool]:
    """The fastest motion found along a path, and whether the hand has its full speed."""
    limit_share = 0.998  # Share of the limits that is used. Peaks are sampled at single times.
    length = float(path.x[-1])
    best = PathMotion(path, hand.over(length))
    time_scale = limits.time_scale(best.peaks(rate)) / limit_share
    if time_scale <= 1.0:
        return best, True
    best = best.time_scaled(time_scale)
    for share in np.geomspace(1.0, 1.0 / time_scale, 5)[1:]:
        motion = PathMotion(path, hand.over(length, float(share)))
        if motion.duration < best.duration:
            factor = limits.time_scale(motion.peaks(rate)) / limit_share
            motion = motion.time_scaled(max(1.0, factor))
            best = min(best, motion, key=lambda candidate: candidate.duration)
    return best, False
