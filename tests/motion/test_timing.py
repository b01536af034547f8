"""Whole motions of a Panda, on lines by its closed form with the last joint held or stepped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, inverse, rotation_from_rpy
from burg_drake.motion import (
    ArmKinematics,
    ArmLimits,
    ArmPath,
    PandaIk,
    PathChecks,
    Plan,
    TimingSettings,
    Trajectory,
    time_motion,
)
from burg_drake.scene import Scene, load_scene
from burg_drake.simulation import DEFAULT_TRIAL
from burg_drake.station import build_station_diagram, load_station

HOME = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
ANYTHING = PathChecks(*[lambda q: True] * 3)
STRAIGHT = 0.0005
"""What the hand may be beside the line [m]."""


@pytest.fixture(scope="module")
def panda() -> tuple[ArmKinematics, ArmLimits]:
    station = load_station("panda_tabletop")
    scene = load_scene("tabletop_six")
    empty = Scene(replace(scene.document, instances=(), background=()), scene.library, scene.path)
    diagram = build_station_diagram(empty, station, weld_objects=True)
    kinematics = ArmKinematics.of(diagram)
    return kinematics, ArmLimits.of(diagram, kinematics)


def line(
    ik: PandaIk, X: np.ndarray, step: np.ndarray, count: int, q7: np.ndarray, near: np.ndarray
) -> np.ndarray:
    """Rows a constant step apart, each on the branch nearest to the row before."""
    poses = np.repeat(X[None], count, axis=0)
    poses[:, :3, 3] += np.arange(count)[:, None] * step
    found = ik.solve(poses, np.broadcast_to(q7, (count,))[:, None])
    rows = []
    for k in range(count):
        choice = found.q[found.pose == k]
        near = choice[np.abs(choice - near).max(axis=1).argmin()]
        rows.append(near)
    assert np.abs(np.diff(rows, axis=0)).max() < 0.3
    return np.array(rows)


def arm_path(
    arm: ArmKinematics,
    place: tuple[float, float, float] = (0.4, 0.2, 0.2),
    rpy: tuple[float, float, float] = (0.0, 0.0, -0.4),
    *,
    stepped: float = 0.0,
    corner: bool = False,
) -> ArmPath:
    """Down to a place and up again; q7 is the home posture's, or changes by `stepped` halfway."""
    ik = PandaIk.of(arm)
    assert ik is not None
    X = arm.forward(HOME[None])[0][0]
    X[:3, :3] = rotation_from_rpy(rpy) @ X[:3, :3]
    X[:3, 3] = place
    before = X.copy()
    before[:3, 3] -= 0.1 * X[:3, 2]
    approach = line(ik, before, 0.01 * X[:3, 2], 11, HOME[6], HOME)
    q7 = HOME[6] + stepped * np.clip((np.arange(31) - 10) / 5.0, 0.0, 1.0)
    lift = line(ik, X, np.array([0.0, 0.0, 0.01]), 31, q7, approach[-1])
    middle = [0.5 * (HOME + approach[0]) + 0.3] if corner else []
    return ArmPath(X, np.array([HOME, *middle, approach[0]]), approach, lift)


def hand(arm: ArmKinematics, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) places of the hand, and (T,) angles by which it has turned since the start."""
    X = arm.forward(trajectory.q)[0]
    R = inverse(X[:1])[:, :3, :3] @ X[:, :3, :3]
    cosine = (np.trace(R, axis1=1, axis2=2) - 1.0) / 2.0
    return X[:, :3, 3], np.arccos(np.clip(cosine, -1.0, 1.0))


def assert_runs(plan: Plan, limits: ArmLimits) -> None:
    """By differences of the samples alone, without the code's own peaks."""
    for part in (plan.transfer, plan.approach, plan.lift):
        h = 1e-3
        np.testing.assert_allclose(np.diff(part.t), h, atol=1e-12)
        v, a, j = (np.abs(np.diff(part.q, k, axis=0)).max(axis=0) / h**k for k in (1, 2, 3))
        assert (v <= limits.velocity * (1.0 + 1e-6)).all()
        assert (a <= limits.acceleration * (1.0 + 1e-6)).all()
        assert (j <= limits.jerk * (1.0 + 1e-6)).all()
        assert (part.q >= limits.lower).all() and (part.q <= limits.upper).all()
        for state in (part.v, part.a):
            assert np.abs(state[[0, -1]]).max() == 0.0
        # The trapezoidal rule; a jerk of 20 / 0.03 that turns to the opposite between two samples
        # errs by 2 j h^2 / 8.
        np.testing.assert_allclose(
            np.diff(part.v, axis=0), 0.5 * h * (part.a[1:] + part.a[:-1]), atol=2e-4
        )
        np.testing.assert_allclose(
            np.diff(part.q, axis=0), 0.5 * h * (part.v[1:] + part.v[:-1]), atol=1e-6
        )


@pytest.mark.parametrize("checks", [ANYTHING, None], ids=["checked", "unchecked"])
@pytest.mark.parametrize("corner", [False, True])
def test_a_panda_can_run_it(
    panda: tuple[ArmKinematics, ArmLimits], checks: PathChecks | None, corner: bool
) -> None:
    arm, limits = panda
    given = arm_path(arm, corner=corner)
    plan = time_motion(given, limits, arm, checks=checks)
    assert_runs(plan, limits)
    for part, path in ((plan.transfer, given.transfer), (plan.lift, given.lift)):
        np.testing.assert_array_equal(part.q[[0, -1]], path[[0, -1]])
    np.testing.assert_array_equal(plan.transfer.q[-1], plan.approach.q[0])
    np.testing.assert_array_equal(plan.approach.q[-1], plan.lift.q[0])


def test_the_hand_goes_straight_and_does_not_turn(panda: tuple[ArmKinematics, ArmLimits]) -> None:
    arm, limits = panda
    plan = time_motion(arm_path(arm), limits, arm)
    for part in (plan.approach, plan.lift):
        p, turn = hand(arm, part)
        way = (p[-1] - p[0]) / np.linalg.norm(p[-1] - p[0])
        beside = p - p[0] - ((p - p[0]) @ way)[:, None] * way
        assert np.linalg.norm(beside, axis=1).max() < STRAIGHT / 10.0
        assert turn.max() < 1e-4


@pytest.mark.parametrize("is_free", [None, lambda rows: True], ids=["unchecked", "checked"])
def test_the_hand_keeps_within_half_of_its_clearance(
    panda: tuple[ArmKinematics, ArmLimits], is_free: Callable[[np.ndarray], bool] | None
) -> None:
    """On a lift that almost stretches the arm, whose joints bend sharply over the hand's way."""
    arm, limits = panda
    ik = PandaIk.of(arm)
    assert ik is not None
    given = arm_path(arm, (0.56, 0.1, 0.4))
    fine = line(ik, given.X_WG, np.array([0.0, 0.0, 0.001]), 301, HOME[6], given.approach[-1])
    gaps = {}
    for clearance in (2e-3, 2e-4, 5e-5, np.nan):
        motion = replace(given, lift=fine, clearance=clearance)
        plan = time_motion(motion, limits, arm, checks=PathChecks(lift=is_free))
        places, turns = hand(arm, plan.lift)
        gaps[clearance] = np.abs(places[:, :2] - places[0, :2]).max() + 0.1 * turns.max()
    assert 1e-4 < gaps[2e-3] < 1e-3  # so that it matters to the others
    for clearance in (2e-4, 5e-5):
        assert gaps[clearance] < clearance / 2.0
    assert gaps[np.nan] < 1e-4


def test_the_lift_is_as_gentle_as_that_of_the_hand_alone(
    panda: tuple[ArmKinematics, ArmLimits],
) -> None:
    """Half of 1.25 s with 4 * 0.30 / 1.25^2 upwards, half downwards, and 30 ms to build it up."""
    arm, limits = panda
    lift = time_motion(arm_path(arm), limits, arm).lift
    z = hand(arm, lift)[0][:, 2]
    acceleration = np.diff(z, 2) / 1e-6
    assert acceleration.max() == pytest.approx(4 * 0.30 / 1.25**2, rel=0.01)
    assert acceleration.min() == pytest.approx(-4 * 0.30 / 1.25**2, rel=0.01)
    assert z[-1] - z[0] == pytest.approx(0.30, abs=1e-9)
    assert lift.duration == pytest.approx(1.25 + 0.03, abs=0.002)
    assert TimingSettings().lift_time == DEFAULT_TRIAL.lift_time


def test_a_shorter_lift_has_the_same_acceleration_and_a_retreat_no_more(
    panda: tuple[ArmKinematics, ArmLimits],
) -> None:
    """0.07 m with 4 * 0.30 / 1.25^2 up and down, ramps of 30 ms on top; likewise backwards."""
    arm, limits = panda
    given = arm_path(arm)
    plan = time_motion(replace(given, lift=given.lift[:8]), limits, arm)
    assert plan.lift.duration == pytest.approx(1.25 * np.sqrt(0.07 / 0.30) + 0.03, abs=0.002)
    back = time_motion(replace(given, retreat=given.approach[::-1]), limits, arm).retreat
    assert back is not None
    assert back.duration == pytest.approx(0.4 + 0.25 / 0.75 + 0.03, abs=0.002)


def test_the_approach_has_its_speed(panda: tuple[ArmKinematics, ArmLimits]) -> None:
    # 0.1 m at 0.25 m/s takes 0.4 s, and 0.25 / 0.75 s to get there, and 30 ms more.
    arm, limits = panda
    approach = time_motion(arm_path(arm), limits, arm).approach
    speed = np.linalg.norm(np.diff(hand(arm, approach)[0], axis=0), axis=1) / 1e-3
    assert speed.max() == pytest.approx(0.25, rel=0.01)
    assert approach.duration == pytest.approx(0.4 + 0.25 / 0.75 + 0.03, abs=0.002)


def test_a_step_of_the_redundant_joint_is_smoothed_where_that_is_free(
    panda: tuple[ArmKinematics, ArmLimits],
) -> None:
    arm, limits = panda
    given = arm_path(arm, stepped=0.3)
    as_it_is = time_motion(given, limits, arm).lift
    smooth = time_motion(given, limits, arm, checks=ANYTHING).lift
    refused = time_motion(
        given, limits, arm, checks=replace(ANYTHING, lift=lambda q: bool(len(q) < 3))
    )
    assert_runs(refused, limits)
    assert smooth.duration < as_it_is.duration - 1.0
    p, turn = hand(arm, smooth)
    assert np.abs(p[:, :2] - p[0, :2]).max() < STRAIGHT and turn.max() < STRAIGHT / 0.1


def test_what_leaves_the_path_is_shown_to_the_check(
    panda: tuple[ArmKinematics, ArmLimits],
) -> None:
    arm, limits = panda
    seen: dict[str, list[np.ndarray]] = {"transfer": [], "approach": [], "lift": []}

    def seeing(name: str):
        return lambda q: seen[name].append(q) or True

    checks = PathChecks(*map(seeing, seen))
    plan = time_motion(arm_path(arm, corner=True), limits, arm, checks=checks)
    for name in ("approach", "lift"):
        rows = seen[name][-1]
        distance = np.abs(getattr(plan, name).q[:, None] - rows).max(axis=2).min(axis=1)
        assert distance.max() < 0.01  # half of the rows' spacing
    corner = seen["transfer"][-1]
    given = arm_path(arm, corner=True).transfer[1]
    assert np.abs(np.diff(corner, axis=0)).max() < 0.05
    assert np.linalg.norm(plan.transfer.q - given, axis=1).min() > 0.0


def test_half_the_speed_is_twice_the_time(panda: tuple[ArmKinematics, ArmLimits]) -> None:
    arm, limits = panda
    full = time_motion(arm_path(arm), limits, arm)
    half = time_motion(arm_path(arm), limits, arm, settings=TimingSettings(speed=0.5))
    for name in ("transfer", "approach", "lift"):
        a, b = getattr(full, name), getattr(half, name)
        assert b.duration == pytest.approx(2.0 * a.duration, abs=0.003)
        np.testing.assert_allclose(b.at(2.0 * a.t), a.q, atol=0.005)


def test_an_arm_too_slow_for_the_hand_s_speed_takes_longer(
    panda: tuple[ArmKinematics, ArmLimits],
) -> None:
    arm, limits = panda
    slow = replace(limits, velocity=limits.velocity / 4.0)
    plan = time_motion(arm_path(arm), slow, arm)
    assert_runs(plan, slow)
    assert plan.lift.duration > 1.5
    used = np.abs(np.diff(plan.lift.q, axis=0)).max(axis=0) / 1e-3 / slow.velocity
    assert used.max() == pytest.approx(0.97, abs=0.01)


def test_no_approach_and_no_lift(panda: tuple[ArmKinematics, ArmLimits]) -> None:
    arm, limits = panda
    there = arm_path(arm)
    still = replace(there, approach=there.approach[[0, 0]], lift=there.approach[:1])
    plan = time_motion(still, limits, arm)
    for part in (plan.approach, plan.lift):
        assert len(part.t) >= 2 and (part.q == there.approach[0]).all() and (part.v == 0.0).all()


def test_a_path_beyond_the_limits(panda: tuple[ArmKinematics, ArmLimits]) -> None:
    arm, limits = panda
    given = arm_path(arm)
    beyond = given.transfer.copy()
    beyond[1, 3] = 0.5
    with pytest.raises(InvalidInputError, match=r"transfer of the path has joint 4"):
        time_motion(replace(given, transfer=beyond), limits, arm)


@pytest.mark.parametrize("checks", [ANYTHING, None], ids=["checked", "unchecked"])
def test_the_margin_to_joint_limits_is_kept_between_waypoints(
    panda: tuple[ArmKinematics, ArmLimits], checks: PathChecks | None
) -> None:
    """Limits lie as tight about all waypoints as the margin allows; Drake's trajectory is looked
    at every 0.1 ms."""
    arm, limits = panda
    given, margin = arm_path(arm, stepped=0.4), 0.01
    given = replace(given, retreat=given.approach[::-1], lift=given.lift)
    waypoints = np.concatenate([given.transfer, given.approach, given.lift])
    low, high = waypoints.min(axis=0), waypoints.max(axis=0)
    tight = {"lower": low - margin, "upper": high + margin}
    arm, limits = replace(arm, **tight), replace(limits, **tight)

    def beyond(limit_margin: float) -> float:
        plan = time_motion(given, limits, arm, checks=checks, limit_margin=limit_margin)
        drake = plan.to_drake()
        q = np.array([drake.value(t)[:, 0] for t in np.arange(0.0, plan.duration, 1e-4)])
        return float(max((low - q).max(), (q - high).max()))

    assert beyond(margin) < 1e-6  # cubic interpolation between samples
    assert beyond(0.0) > 1e-4


def test_what_no_time_is_enough_for(panda: tuple[ArmKinematics, ArmLimits]) -> None:
    arm, limits = panda
    given = arm_path(arm)
    lost = given.lift.copy()
    lost[7, 2] = np.nan
    with pytest.raises(InvalidInputError, match="lift of the path has joint 3 at nan"):
        time_motion(replace(given, lift=lost), limits, arm)


@pytest.mark.parametrize(
    ("name", "value"), [("speed", 1.5), ("velocity_share", 2.0), ("rate", 0.0), ("lift_time", -1.0)]
)
def test_settings_out_of_range(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=f"{name} of a motion is {value:g}; give"):
        TimingSettings(**{name: value})
