"""Motions along polylines: limits, deviation, and what makes the arm stop at a corner."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from burg_drake.motion import ArmLimits, Cubics, distance_to_polyline, time_polyline


def anything(q: np.ndarray) -> bool:
    return True


def arm(n: int = 7) -> ArmLimits:
    """The Panda's first joints, with jerk that takes 25 ms to build up acceleration."""
    acceleration = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])[:n]
    velocity = np.array([2.175] * 4 + [2.61] * 3)[:n]
    far = np.full(n, 3.0)
    return ArmLimits(-far, far, velocity, acceleration, 40.0 * acceleration, 87.0 + 0.0 * far)


def corners(seed: int, count: int = 4, n: int = 7) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, n))


def dense(motion: Cubics) -> np.ndarray:
    return motion.at(np.linspace(0.0, motion.duration, 2000))[0]


@pytest.mark.parametrize("seed", range(10))
def test_limits_hold_and_one_is_used_up(seed: int) -> None:
    q, limits = corners(seed, 2 + seed % 4), arm()
    for is_free in (anything, None):
        motion = time_polyline(q, limits, deviation=0.2, is_free=is_free)
        assert limits.time_scale(motion.peaks()) == pytest.approx(1.0, abs=1e-6)
        np.testing.assert_allclose(motion.q[[0, -1]], q[[0, -1]], atol=1e-9)
        np.testing.assert_allclose([motion.v[-1], motion.a[-1]], np.zeros((2, 7)), atol=1e-8)
        assert distance_to_polyline(dense(motion), q).max() <= (0.2 if is_free else 1e-9)


def test_one_joint_takes_what_a_double_s_takes() -> None:
    # Joint 1 of the Panda over 2 rad: rises of v/a + a/j, cruise over what is left of the way.
    v, a, j = 2.175, 15.0, 600.0
    motion = time_polyline(np.array([[-1.0], [1.0]]), arm(1), deviation=0.1)
    rise = v / a + a / j
    assert motion.duration == pytest.approx(2.0 * rise + (2.0 - v * rise) / v, rel=1e-9)


def test_rounding_is_faster_than_stopping_and_never_faster_than_the_limits_of_speed() -> None:
    for seed in range(5):
        q, limits = corners(seed), arm()
        stops = time_polyline(q, limits, deviation=0.2).duration
        rounded = time_polyline(q, limits, deviation=0.2, is_free=anything).duration
        bound = (np.abs(np.diff(q[[0, -1]], axis=0)) / limits.velocity).max()
        assert bound < rounded < stops


def test_a_corner_that_may_not_be_cut_is_met_exactly() -> None:
    q = corners(3)

    def is_free(rows: np.ndarray) -> bool:
        """Free along the polyline, and around its second corner."""
        near = np.linalg.norm(rows - q[2], axis=1) < 1.0
        return bool(((distance_to_polyline(rows, q) < 1e-6) | near).all())

    motion = time_polyline(q, arm(), deviation=0.2, is_free=is_free)
    assert is_free(dense(motion))
    nearest = np.linalg.norm(dense(motion)[:, None] - q, axis=2).min(axis=0)
    assert nearest[1] < 1e-3 and nearest[2] > 1e-3
    assert motion.duration < time_polyline(q, arm(), deviation=0.2).duration


def test_less_deviation_takes_longer() -> None:
    q = corners(4)
    times = []
    for deviation in (0.2, 0.05, 1e-6):
        motion = time_polyline(q, arm(), deviation=deviation, is_free=anything)
        assert distance_to_polyline(dense(motion), q).max() <= deviation * (1.0 + 1e-6)
        times.append(motion.duration)
    assert times == sorted(times)


@pytest.mark.parametrize("count", [2, 5])
def test_backwards_takes_the_same_time_along_the_same_way(count: int) -> None:
    q = corners(5, count)
    there = time_polyline(q, arm(), deviation=0.2, is_free=anything)
    back = time_polyline(q[::-1], arm(), deviation=0.2, is_free=anything)
    assert back.duration == pytest.approx(there.duration, rel=1e-9)
    t = np.linspace(0.0, there.duration, 200)
    np.testing.assert_allclose(back.at(there.duration - t)[0], there.at(t)[0], atol=1e-7)


def test_the_order_of_joints_does_not_matter() -> None:
    q, limits, order = corners(6), arm(), np.array([3, 0, 6, 2, 5, 1, 4])
    names = ("lower", "upper", "velocity", "acceleration", "jerk", "torque")
    other = ArmLimits(**{name: getattr(limits, name)[order] for name in names})
    a = time_polyline(q, limits, deviation=0.2, is_free=anything)
    b = time_polyline(q[:, order], other, deviation=0.2, is_free=anything)
    t = np.linspace(0.0, a.duration, 200)
    assert b.duration == pytest.approx(a.duration, rel=1e-12)
    np.testing.assert_allclose(b.at(t)[0], a.at(t)[0][:, order], atol=1e-9)


def test_waypoints_that_are_there_twice_change_nothing() -> None:
    q = corners(7, 3)
    once = time_polyline(q, arm(), deviation=0.2, is_free=anything)
    twice = time_polyline(q[[0, 0, 1, 1, 2]], arm(), deviation=0.2, is_free=anything)
    assert twice.duration == once.duration
    still = time_polyline(q[[0, 0]], arm(), deviation=0.2)
    assert 0.0 < still.duration < 0.01
    np.testing.assert_array_equal(dense(still), np.broadcast_to(q[0], (2000, 7)))


def test_distance_to_a_polyline_by_brute_force() -> None:
    q, rows = corners(8), corners(9, 50)
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    points = np.concatenate([a + share * (b - a) for a, b in pairwise(q)])
    brute = np.linalg.norm(rows[:, None] - points, axis=2).min(axis=1)
    np.testing.assert_allclose(distance_to_polyline(rows, q), brute, atol=1e-5)
