"""Smooth joint paths along which the hand goes straight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from burg_drake.core import Array
from burg_drake.motion.ik import ArmKinematics, rotation_vector, solve_ik
from burg_drake.motion.timing.corners import IsFree, distance_to_polyline

SPACING = 0.01
"""Largest distance of the spline's knots [m]."""
FINE_SPACING = 0.0025
"""The same where the hand would be too far from the line between them: it strays with the fourth
power."""
BETWEEN = 4
"""Rows for each knot at which a path is looked at."""
SMOOTHING = (1e2, 1e4, np.inf)
"""Weights of the second differences of knots against their displacement: a path is bent over 3
knots, 10, or all of them."""
ITERATIONS, TOLERANCE = 20, 1e-9
"""Of the steps that bring knots to the line [m and rad]."""
LEVER = 0.1
"""Distance from the hand at which its turn counts as a deviation [m]."""


@dataclass(frozen=True, eq=False)
class LinePath:
    """A straight segment of the hand's path, with an arm that does not go straight in joint space.

    Attributes:
        rows: (K, n) joint positions along it.
        X_AH: (K, 4, 4) hand poses there.
        travel: (K,) rising: how far the hand is from the first row [m].
        kinematics: the arm, with limits that leave the margin, or reach to the rows.
    """

    rows: Array
    X_AH: Array
    travel: Array
    kinematics: ArmKinematics

    @classmethod
    def of(cls, rows: Array, kinematics: ArmKinematics, limit_margin: float = 0.0) -> LinePath:
        """Through the rows (K, n), with a distance to keep from the joints' limits [rad or m]."""
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
        """The hand's way [m]."""
        return float(self.travel[-1])

    def paths(self, smoother: bool) -> Iterator[CubicSpline]:
        """Joint positions by the path length of the hand [m]: first a spline that is close to the
        rows; then, if they are wanted, smoother and smoother ones; last one that is closer to the
        line.
        """
        wanted = [(SPACING, 0.0), *((SPACING, weight) for weight in SMOOTHING if smoother)]
        for spacing, weight in (*wanted, (FINE_SPACING, 0.0)):
            path = self._path(spacing, weight)
            if path is not None:
                yield path

    def _path(self, spacing: float, weight: float) -> CubicSpline | None:
        """A spline with its knots on the line; None if the arm does not get there."""
        count = max(4, int(np.ceil(self.length / spacing))) + 1
        share = np.linspace(0.0, 1.0, count)[:, None]
        travel = share[:, 0] * self.length
        straight = self.rows[0] + share * (self.rows[-1] - self.rows[0])
        near = np.stack([np.interp(travel, self.travel, joint) for joint in self.rows.T], axis=1)
        X_AH = np.repeat(self.X_AH[:1], count, axis=0)
        X_AH[:, :3, 3] += share * (self.X_AH[-1, :3, 3] - self.X_AH[0, :3, 3])
        knots = straight.copy()
        if np.isfinite(weight):
            knots[1:-1] += _bent_less((near - straight)[1:-1], weight)
        knots[0], knots[-1] = self.rows[0], self.rows[-1]
        knots[1:-1], met = solve_ik(
            self.kinematics, X_AH[1:-1], knots[1:-1], iterations=ITERATIONS, tolerance=TOLERANCE
        )
        return CubicSpline(travel, knots) if met.all() else None

    def is_good(
        self, path: CubicSpline, straightness: float, deviation: float, is_free: IsFree | None
    ) -> bool:
        """Whether a path keeps to the joint limits, the line of the hand, and what is free.

        Args:
            path: one of `paths`.
            straightness: farthest from the straight line [m].
            deviation: farthest from the rows' polyline [rad], if there is no check.
            is_free: the check, or None.
        """
        low, high = extremes(path)
        if (low < self.kinematics.lower).any() or (high > self.kinematics.upper).any():
            return False
        q = path(np.linspace(0.0, self.length, BETWEEN * (len(path.x) - 1) + 1))
        X_AH = self.kinematics.forward(q)[0]
        if line_error(X_AH, self.X_AH[0], self.X_AH[-1]) > straightness:
            return False
        if is_free is None:
            return bool(distance_to_polyline(q, self.rows).max() <= deviation)
        return is_free(q)


def _bent_less(offset: Array, weight: float) -> Array:
    """(count, n) points between two fixed ones at 0, with less of second differences: least
    squares, by a matrix with two diagonals to either side."""
    if weight == 0.0:
        return offset
    count = len(offset)
    bend = np.diff(np.eye(count + 2), 2, axis=0)[:, 1:-1]
    A = np.eye(count) + weight * bend.T @ bend
    upper = [np.pad(np.diag(A, k), (k, 0)) for k in (2, 1, 0)]
    return np.asarray(solveh_banded(upper, offset))


def extremes(path: CubicSpline) -> tuple[Array, Array]:
    """(n,) smallest and (n,) largest values of n splines: at knots, or where a cubic turns."""
    a, b, c, d = path.c
    with np.errstate(all="ignore"):
        s = -b - np.copysign(np.sqrt(b * b - 3.0 * a * c), b)
        turns = np.nan_to_num([s / (3.0 * a), c / s], nan=0.0)
    u = np.clip(turns, 0.0, np.diff(path.x)[:, None])
    inner = d + u * (c + u * (b + u * a))
    values = np.concatenate([path(path.x), *inner])
    return values.min(axis=0), values.max(axis=0)


def line_error(X_AH: Array, X_A0: Array, X_A1: Array) -> float:
    """Largest distance of hand poses (N, 4, 4) from the straight line between two poses [m]; a turn
    away from the first counts with a lever of `LEVER`."""
    segment = X_A1[:3, 3] - X_A0[:3, 3]
    offset = X_AH[:, :3, 3] - X_A0[:3, 3]
    along = offset @ segment / max(float(segment @ segment), np.finfo(float).tiny)
    gap = np.linalg.norm(offset - np.clip(along, 0.0, 1.0)[:, None] * segment, axis=1)
    turn = np.linalg.norm(rotation_vector(X_AH[:, :3, :3] @ X_A0[:3, :3].T), axis=1)
    return float(np.maximum(gap, LEVER * turn).max())
