"""What turned or slid too far in the hand does not count as lifted, whenever that is decided."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trial_world import QUICK, from_above, make_station

from burg_drake.core import Array, Outcome, Pose, inverse, make_pose
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import NO_GRIP_LIMITS, GripMotion, HandTrial, TrialResult, TrialSettings
from tests.thorough import thorough

OFF_CENTRE = from_above(0.02, y=0.05)
"""A grasp 50 mm off the middle of the bar."""
FRICTIONS = (0.1, 0.14, 0.18, 0.25, 0.5)
"""The bar hangs down in the hand with the first ones, and stays level with the last one."""


@pytest.fixture(scope="module")
def run(make_scene: Callable[..., Scene]) -> Callable[..., TrialResult]:
    scene = make_scene(("bar", 0.3, 0.2, 0.0))

    def run(friction: float, whole: bool = False, **limits: float) -> TrialResult:
        settings = replace(TrialSettings(), **{**NO_GRIP_LIMITS, **limits})
        engine = replace(QUICK, whole_trial=whole)
        trial = HandTrial(scene, make_station(), engine=engine, settings=settings)
        return trial.run("bar", OFF_CENTRE, friction=friction)

    return run


@pytest.fixture(scope="module")
def unlimited(run: Callable[..., TrialResult]) -> dict[float, TrialResult]:
    """To their ends, whatever happens in the hand."""
    return {mu: run(mu, whole=True) for mu in FRICTIONS}


def test_how_far_a_swinging_bar_slides_does_not_depend_on_its_origin(
    make_scene: Callable[..., Scene],
) -> None:
    settings, slips = replace(TrialSettings(), hold_time=0.3, **NO_GRIP_LIMITS), []
    for name, offset in (("bar", 0.0), ("far_bar", 0.3)):
        scene = make_scene(Instance(object=name, X_SO=Pose((0.3, 0.2 - offset, 0.0))))
        trial = HandTrial(scene, make_station(), engine="standard", settings=settings)
        X_OG = make_pose(p_AB=(0.0, offset, 0.0)) @ from_above(0.02, y=0.11)
        slips.append(trial.run(name, X_OG, friction=0.15).margins.slip)
    assert 0.0015 < slips[0] == pytest.approx(slips[1], rel=0.02)


@pytest.mark.thorough
def test_without_limits_all_that_is_held_is_lifted(unlimited: dict[float, TrialResult]) -> None:
    tilts = [result.margins.tilt for result in unlimited.values()]
    assert tilts == sorted(tilts, reverse=True)
    assert tilts[0] > math.radians(35.0) and tilts[-1] < math.radians(1.0)
    assert {result.outcome for result in unlimited.values()} == {Outcome.LIFTED}


@pytest.mark.parametrize("name", ["tilt", "slip"])
@pytest.mark.parametrize(
    "friction", [mu if mu in (0.14, 0.25) else thorough(mu) for mu in FRICTIONS]
)
def test_each_limit_decides_between_lifted_and_turned(
    run: Callable[..., TrialResult], unlimited: dict[float, TrialResult], friction: float, name: str
) -> None:
    """A trial that may end early, with limits just below and above what the whole one ends with."""
    end = getattr(unlimited[friction].margins, name)
    for share, outcome in ((0.97, Outcome.LIFTED_TURNED), (1.03, Outcome.LIFTED)):
        result = run(friction, **{f"{name}_limit": share * end})
        assert result.outcome is outcome, share
        assert result.outcome.held


def test_a_limit_near_by_has_the_trial_go_on_and_one_far_off_does_not(
    run: Callable[..., TrialResult], unlimited: dict[float, TrialResult]
) -> None:
    free, end = run(0.18), unlimited[0.18].margins
    far = run(0.18, tilt_limit=2.0 * end.tilt, slip_limit=1.0)
    assert far == free  # the same bits
    near = run(0.18, tilt_limit=1.0001 * free.margins.tilt)
    assert near.margins.end_time > free.margins.end_time


def test_disturbed_as_well_it_is_turned(make_scene: Callable[..., Scene]) -> None:
    """The end of the bar that stays down, as the other one is lifted, has a block on it."""
    on_top = Instance(object="block", X_SO=Pose((0.3, 0.32, 0.04)))
    scene = make_scene(("bar", 0.3, 0.2, 0.0), on_top)
    settings = TrialSettings(tilt_limit=math.radians(3.0), disturbance=0.001)
    trial = HandTrial(scene, make_station(), engine=QUICK, settings=settings)
    result = trial.run("bar", from_above(0.02, y=-0.06), friction=0.1)
    assert result.margins.others_moved > settings.disturbance
    assert result.outcome is Outcome.LIFTED_TURNED


SETTINGS = TrialSettings(tilt_limit=0.5, slip_limit=0.02)


def creeping(
    angle: float, slip: float, a_look: float, settings: TrialSettings = SETTINGS
) -> GripMotion:
    """A target that has turned and slid by so much since the grip, and turns on, by so much from
    look to look [rad]."""

    def at(angle: float) -> Array:
        c, s = math.cos(angle), math.sin(angle)
        R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        return make_pose(R, (0.0, slip, 0.0))

    motion = GripMotion(settings, np.eye(4))
    motion.grip()
    for k in range(2 * settings.steady_polls, -1, -1):
        motion.record(at(angle - k * a_look), others_rest=True)
    return motion


@pytest.mark.parametrize(
    ("share", "stays"), [(-1.01, True), (-0.9, False), (0.9, False), (1.01, True)]
)
def test_what_creep_may_still_add(share: float, stays: bool) -> None:
    """A second of 100 looks adds a hundred times the angle of one."""
    a_look = 1e-4
    assert creeping(0.5 + share * 100 * a_look, 0.0, a_look).is_verdict_stable(1.0) is stays
    assert creeping(0.5 + share * 100 * a_look, 0.0, 0.0).is_verdict_stable(1.0)


def test_whatever_a_target_turns_about_it_stays_where_that_was_foretold() -> None:
    """Constant turning about random lines, beyond the moment at which it was decided."""
    rng = np.random.default_rng(5)
    told = {True: 0, False: 0}
    for _ in range(400):
        turn, slide = rng.normal(0.0, 2e-4, 3), rng.normal(0.0, 4e-6, 3)
        about, start = rng.normal(0.0, 0.02, 3), rng.normal(0.0, 0.011, 3)
        offset = Rotation.from_rotvec(rng.normal(0.0, 0.28, 3)).as_matrix()
        motion = GripMotion(SETTINGS, np.eye(4))
        motion.grip()
        n = 2 * SETTINGS.steady_polls
        beyond = []
        for k in range(n + 100):
            if k == n:
                decided = motion.is_verdict_stable(1.0)
            R = Rotation.from_rotvec(k * turn).as_matrix()
            X_W = make_pose(R, about - R @ about + k * slide)
            motion.record(X_W @ make_pose(offset, start), others_rest=True)
            beyond.append(motion.is_beyond_limits)
        told[decided] += 1
        assert not decided or len({*beyond[n - 1 :]}) == 1
    assert min(told.values()) > 50


def test_no_limit_is_none_for_a_target_that_hangs_upside_down() -> None:
    settings = replace(SETTINGS, **NO_GRIP_LIMITS)
    motion = creeping(math.pi - 1e-3, 0.5, 1e-4, settings)
    assert motion.is_verdict_stable(10.0) and not motion.is_beyond_limits


def test_before_the_grip_nothing_is_beyond() -> None:
    motion = GripMotion(SETTINGS, np.eye(4))
    motion.record(inverse(make_pose(np.eye(3), (0.0, 0.5, 0.0))), others_rest=True)
    assert all(map(math.isnan, motion.since_grip)) and not motion.is_beyond_limits
