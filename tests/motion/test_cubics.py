"""Double-S profiles against durations derived by hand, derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.motion import Cubics, DoubleS, smooth_polyline


def checked(profile: DoubleS, v: float, a: float, j: float) -> Cubics:
    """The motion over a unit, which keeps the limits and arrives at rest."""
    motion = profile.over(np.ones(1))
    for peak, limit in zip(motion.peaks(), (v, a, j), strict=True):
        assert peak[0] <= limit * (1.0 + 1e-9)
    assert motion.duration == pytest.approx(profile.duration, rel=1e-12)
    end = [x[-1, 0] for x in (motion.q, motion.v, motion.a)]
    np.testing.assert_allclose(end, [1.0, 0.0, 0.0], atol=1e-9)
    return motion


def test_with_cruise_way_is_speed_times_duration_less_one_rise() -> None:
    # Speed and acceleration are reached: rising takes v/a + a/j and covers half of v times that, as
    # the profile of the speed is symmetric about its middle; so does braking. With L = 1:
    # 1 = v (v/a + a/j) + v t_cruise, and the whole takes 2 (v/a + a/j) + t_cruise.
    v, a, j = 0.5, 2.0, 20.0
    rise = v / a + a / j
    cruise = (1.0 - v * rise) / v
    profile = DoubleS.of(v, a, j)
    assert profile.duration == pytest.approx(2.0 * rise + cruise, rel=1e-12)
    velocity, acceleration, jerk = checked(profile, v, a, j).peaks()
    np.testing.assert_allclose([velocity[0], acceleration[0], jerk[0]], [v, a, j], rtol=1e-9)


def test_without_cruise_the_top_speed_follows_from_the_way() -> None:
    # Acceleration is reached, speed is not: 1 = p (p/a + a/j) for the peak p, which is
    # p = (-a^2/j + sqrt(a^4/j^2 + 4 a)) / 2, and the whole takes 2 (p/a + a/j).
    v, a, j = 50.0, 2.0, 20.0
    p = (-(a**2) / j + (a**4 / j**2 + 4.0 * a) ** 0.5) / 2.0
    profile = DoubleS.of(v, a, j)
    assert profile.duration == pytest.approx(2.0 * (p / a + a / j), rel=1e-12)
    velocity, acceleration, _ = checked(profile, v, a, j).peaks()
    np.testing.assert_allclose([velocity[0], acceleration[0]], [p, a], rtol=1e-9)


def test_with_jerk_alone_there_are_four_equal_parts() -> None:
    # Neither is reached: four parts of length h with jerk +j, -j, -j, +j cover 2 j h^3.
    j = 20.0
    profile = DoubleS.of(50.0, 50.0, j)
    assert profile.duration == pytest.approx(4.0 * (1.0 / (2.0 * j)) ** (1.0 / 3.0), rel=1e-12)
    assert checked(profile, 50.0, 50.0, j).peaks()[2][0] == pytest.approx(j, rel=1e-9)


def test_speed_without_full_acceleration() -> None:
    # Speed is reached before full acceleration is: each rise has two parts of sqrt(v/j).
    v, a, j = 0.5, 50.0, 20.0
    part = (v / j) ** 0.5
    profile = DoubleS.of(v, a, j)
    assert profile.duration == pytest.approx(4.0 * part + (1.0 - 2.0 * v * part) / v, rel=1e-12)
    checked(profile, v, a, j)


def test_more_of_any_limit_never_takes_longer() -> None:
    rng = np.random.default_rng(0)
    for v, a, j in np.exp(rng.uniform(-3.0, 5.0, (200, 3))):
        profile = DoubleS.of(v, a, j)
        checked(profile, v, a, j)
        for more in ((1.1 * v, a, j), (v, 1.1 * a, j), (v, a, 1.1 * j)):
            assert DoubleS.of(*more).duration <= profile.duration * (1.0 + 1e-12)


@pytest.fixture
def wiggle() -> Cubics:
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 3))
    return smooth_polyline(q, np.array([0.3, 0.2, 0.4, 0.1]), DoubleS(0.0, 0.25, 0.05), np.zeros(3))


def test_derivatives_are_those_of_differences(wiggle: Cubics) -> None:
    h = 1e-5
    t = np.random.default_rng(2).uniform(h, wiggle.duration - h, 500)
    middle, ahead, behind = wiggle.at(t), wiggle.at(t + h), wiggle.at(t - h)
    for k in range(3):
        difference = (ahead[k] - behind[k]) / (2.0 * h)
        scale = np.abs(middle[k + 1]).max()
        smooth = np.abs(wiggle.t[:, None] - t).min(axis=0) > 2.0 * h  # no knot in between
        np.testing.assert_allclose(difference[smooth], middle[k + 1][smooth], atol=1e-3 * scale)


def test_peaks_are_those_of_dense_samples(wiggle: Cubics) -> None:
    samples = wiggle.at(np.linspace(0.0, wiggle.duration, 100_001))[1:]
    for peak, sample in zip(wiggle.peaks(), samples, strict=True):
        np.testing.assert_allclose(peak, np.abs(sample).max(axis=0), rtol=1e-3)


def test_smoothing_is_the_mean_over_both_windows() -> None:
    q = np.array([[0.0], [1.0], [0.5]])
    travel, rise, ramp = np.array([0.4, 0.3]), 0.2, 0.05
    motion = smooth_polyline(q, travel, DoubleS(0.0, rise, ramp))
    h = 1e-4  # the polyline over time, delayed by half of both windows, averaged by brute force
    time = np.arange(-0.5, 1.5, h)
    line = np.interp(time, [0.0, 0.4, 0.7], q[:, 0])
    for window in (rise, ramp):
        kernel = np.ones(round(window / h)) / round(window / h)
        line = np.convolve(line, kernel)[: len(time)]
    inside = (time > 0.0) & (time < motion.duration)
    np.testing.assert_allclose(motion.at(time[inside])[0][:, 0], line[inside], atol=5e-4)


def test_a_stop_as_long_as_the_windows_meets_the_waypoint() -> None:
    q = np.array([[0.0, 0.0], [1.0, 0.2], [0.5, 1.0]])
    motion = smooth_polyline(q, np.array([0.4, 0.3]), DoubleS(0.0, 0.2, 0.05), np.array([0.25]))
    at, v, a, _ = motion.at(np.array([0.4 + 0.25]))
    np.testing.assert_allclose(at[0], q[1], atol=1e-12)
    np.testing.assert_allclose([v[0], a[0]], np.zeros((2, 2)), atol=1e-9)


def test_reversed_in_time_it_is_the_same_way_back(wiggle: Cubics) -> None:
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 3))
    back = smooth_polyline(q[::-1], np.array([0.1, 0.4, 0.2, 0.3]), DoubleS(0.0, 0.25, 0.05))
    t = np.linspace(0.0, wiggle.duration, 333)
    np.testing.assert_allclose(back.at(back.duration - t)[0], wiggle.at(t)[0], atol=1e-9)
