"""Perturbed repeats: what is drawn, and what becomes of it."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from trial_world import FORCE, GRAVITY, QUICK, from_above, make_station

from burg_drake.core import InvalidInputError, Outcome, inverse, make_pose, rotation_angle
from burg_drake.simulation import (
    HandTrial,
    Noise,
    PerturbedTrial,
    SuccessRate,
    perturb,
    success_rate,
)

CENTRE = from_above(0.025)
"""At the block's centre of mass."""
NONE = Noise(translation=0.0, rotation=0.0, mass=0.0, friction=0.0)


def draw(noise: Noise, repeat: int = 0, seed: int = 0, grasp: str = "a") -> PerturbedTrial:
    return perturb(CENTRE, 0.3, 0.5, noise, seed=seed, grasp=grasp, repeat=repeat)


@pytest.fixture(scope="module")
def trial(make_scene) -> HandTrial:
    return HandTrial(make_scene(("block", 0.3, 0.2, 0.0)), make_station(), engine=QUICK)


def test_deviations_are_those_asked_for() -> None:
    """1000 draws: a standard deviation is known to 1 / sqrt(2000), thrice that is 7 %."""
    noise = Noise(translation=0.004, rotation=0.05, mass=0.1, friction=0.2)
    drawn = [draw(noise, repeat) for repeat in range(1000)]
    X_GG = inverse(CENTRE) @ np.array([d.X_OG for d in drawn])
    assert X_GG[:, :3, 3].std(axis=0) == pytest.approx(np.full(3, 0.004), rel=0.07)
    assert np.abs(X_GG[:, :3, 3].mean(axis=0)).max() < 4 * 0.004 / math.sqrt(1000)
    # the square of the angle is the sum of three squares
    squared = rotation_angle(X_GG[:, :3, :3]) ** 2
    assert math.sqrt(squared.mean() / 3) == pytest.approx(0.05, rel=0.07)
    assert np.log([d.mass / 0.3 for d in drawn]).std() == pytest.approx(0.1, rel=0.07)
    assert np.log([d.friction / 0.5 for d in drawn]).std() == pytest.approx(0.2, rel=0.07)
    values = np.column_stack([X_GG[:, :3, 3], [(d.mass, d.friction) for d in drawn]])
    off_diagonal = np.corrcoef(values.T)[~np.eye(5, dtype=bool)]
    assert np.abs(off_diagonal).max() < 0.13


def test_draws_follow_from_seed_grasp_and_number() -> None:
    same, other = (
        draw(Noise(), 3),
        [draw(Noise(), 4), draw(Noise(), 3, 1), draw(Noise(), 3, 0, "b")],
    )
    np.testing.assert_array_equal(draw(Noise(), 3).X_OG, same.X_OG)
    assert all(not np.allclose(o.X_OG, same.X_OG) and o.mass != same.mass for o in other)


def test_larger_deviations_are_the_same_errors_scaled() -> None:
    one, two = (
        draw(Noise(translation=0.001, rotation=0.0)),
        draw(Noise(translation=0.002, rotation=0.0)),
    )
    shift = [(inverse(CENTRE) @ d.X_OG)[:3, 3] for d in (one, two)]
    np.testing.assert_allclose(shift[1], 2 * shift[0])
    assert one.mass == two.mass


def test_no_noise_is_the_plain_trial(trial: HandTrial) -> None:
    nothing = draw(NONE)
    assert nothing.X_OG is CENTRE and nothing.mass is None and nothing.friction is None
    for X_OG in (CENTRE, CENTRE @ make_pose(p_AB=(0.0, 0.15, 0.0))):
        plain = trial.run("block", X_OG)
        rate = success_rate(trial, "block", X_OG, NONE, repeats=3)
        assert rate.outcomes == {plain.outcome: 3}
        assert rate.probability == (1.0 if plain.outcome is Outcome.LIFTED else 0.0)


def test_noise_of_the_pose_makes_hands_collide(trial: HandTrial) -> None:
    """The open hand has 15 mm of room on either side of the block, so that an error of 50 mm along
    the closing direction collides in most cases."""
    rate = success_rate(trial, "block", CENTRE, Noise(translation=0.05, rotation=0.0), repeats=20)
    assert rate.trials == 20
    assert rate.outcomes[Outcome.COLLISION_TARGET] > 5
    assert rate.lifted < 5


def test_noise_of_friction_about_the_limit_decides(trial: HandTrial) -> None:
    """The block weighs what the pads carry with the library's friction: above it the hand lifts,
    below it the block slips."""
    mu = trial.diagram.scene.entry("block").friction
    mass = 2 * mu * FORCE / (GRAVITY + 4 * 0.3 / 1.25**2)
    noise = Noise(translation=0.0, rotation=0.0, mass=0.0, friction=0.3)
    seen = set()
    for repeat in range(6):
        drawn = perturb(CENTRE, mass, mu, noise, seed=0, grasp="limit", repeat=repeat)
        assert drawn.friction is not None and drawn.mass is None
        if abs(drawn.friction / mu - 1) > 0.03:
            result = trial.run("block", drawn.X_OG, friction=drawn.friction, mass=mass)
            assert (result.outcome is Outcome.LIFTED) == (drawn.friction > mu)
            seen.add(result.outcome)
    assert len(seen) == 2


def test_rates() -> None:
    rate = SuccessRate(
        Counter({Outcome.LIFTED: 15, Outcome.LIFTED_DISTURBED: 100, Outcome.SLIPPED: 33})
    )
    assert (rate.trials, rate.lifted) == (148, 15)
    # R. G. Newcombe, Statistics in Medicine 17 (1998), Table I, method 3
    assert rate.interval == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert math.isnan(SuccessRate(Counter()).probability)


def test_bad_arguments(trial: HandTrial) -> None:
    with pytest.raises(InvalidInputError, match=r"noise of the mass is -0\.1; give 0 or more"):
        Noise(mass=-0.1)
    with pytest.raises(InvalidInputError, match="repeats is 0; give 1 or more"):
        success_rate(trial, "block", CENTRE, repeats=0)
