"""The friction that a grasp needs, against what two pads carry."""

from __future__ import annotations

import math

import pytest
from trial_world import FORCE, GRAVITY, QUICK, SLOW, from_above, make_station

from burg_drake.core import InvalidInputError, make_pose
from burg_drake.simulation import FrictionSettings, HandTrial, friction_limit, friction_to_carry

CENTRE = from_above(0.025)
"""At the block's centre of mass."""


@pytest.fixture(scope="module")
def trial(make_scene) -> HandTrial:
    return HandTrial(make_scene(("block", 0.3, 0.2, 0.0)), make_station(), engine=QUICK)


def test_friction_that_carries_weight_and_acceleration(trial: HandTrial) -> None:
    """The hand speeds up to twice its mean speed, 0.3 m in 1.25 s, in half of that time."""
    mass = 0.8
    acceleration = 2 * (0.3 / 1.25) / (1.25 / 2)
    needed = mass * (GRAVITY + acceleration) / (2 * FORCE)
    assert friction_limit(trial, "block", CENTRE, mass=mass) == pytest.approx(needed, rel=0.03)


def test_a_slower_lift_needs_less(make_scene) -> None:
    scene = make_scene(("block", 0.3, 0.2, 0.0))
    slow = HandTrial(scene, make_station(), settings=SLOW)
    needed = 0.5 * (GRAVITY + 0.04) / (2 * FORCE)
    assert friction_to_carry(slow, "block", 0.5) == pytest.approx(needed, rel=1e-6)


def test_beyond_what_is_tried(trial: HandTrial) -> None:
    easy = FrictionSettings(smallest=0.2, largest=0.5)
    assert friction_limit(trial, "block", CENTRE, settings=easy) == 0.0
    beside = CENTRE @ make_pose(p_AB=(0.0, 0.15, 0.0))
    assert friction_limit(trial, "block", beside) == math.inf


def test_bad_settings() -> None:
    with pytest.raises(InvalidInputError, match=r"friction is from 0\.5 to 0\.2;"):
        FrictionSettings(smallest=0.5, largest=0.2)
    with pytest.raises(InvalidInputError, match="tolerance is 0; give more than 0"):
        FrictionSettings(tolerance=0.0)
