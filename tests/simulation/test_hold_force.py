"""Tugging and shaking a block between two pads, against statics."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from trial_world import FORCE, GRAVITY, QUICK, from_above, make_station

from burg_drake.core import InvalidInputError, Outcome, Pose, UnknownNameError
from burg_drake.scene import Instance, load_scene
from burg_drake.simulation import (
    Grip,
    HandTrial,
    HoldForces,
    LoadSettings,
    TrialResult,
    shake,
    take_grip,
    tug,
)
from burg_drake.station import load_station

CENTRE = from_above(0.025)
"""At the block's centre of mass."""
MASS = 0.3
WEIGHT = MASS * GRAVITY
FRICTION = 0.3
CARRIED = 2 * FRICTION * FORCE
"""What two pads carry by friction [N]."""
FINE = LoadSettings(tolerance=0.02)
LIMITS = {
    # Both fingers hang on one drive of 2 N. A load F along the closing direction leaves them where
    # they are, N + F/2 on one side and N - F/2 on the other, until the second lets go at F = 2 N.
    "+x": 2 * FORCE,
    "-x": 2 * FORCE,
    # sideways and downwards at once
    "+y": math.sqrt(CARRIED**2 - WEIGHT**2),
    "-y": math.sqrt(CARRIED**2 - WEIGHT**2),
    # z approaches, which is downwards here
    "+z": CARRIED - WEIGHT,
    "-z": CARRIED + WEIGHT,
}


@pytest.fixture(scope="module")
def trial(make_scene) -> HandTrial:
    return HandTrial(make_scene(("block", 0.3, 0.2, 0.0)), make_station(), engine=QUICK)


def grip_of(trial: HandTrial, mass: float = MASS) -> Grip:
    grip = take_grip(trial, "block", CENTRE, friction=FRICTION, mass=mass)
    assert isinstance(grip, Grip)
    return grip


@pytest.fixture(scope="module")
def tugged(trial: HandTrial) -> HoldForces:
    return tug(grip_of(trial), FINE)


@pytest.mark.parametrize("direction", LIMITS)
def test_tug_to_the_limit_of_statics(tugged: HoldForces, direction: str) -> None:
    assert tugged.forces[direction] == pytest.approx(LIMITS[direction], rel=0.03)


def test_units_and_the_weakest_direction(tugged: HoldForces) -> None:
    assert tugged.weight == pytest.approx(WEIGHT, rel=1e-6)
    assert tugged.lowest_limit == ("+z", tugged.accelerations["+z"])
    assert tugged.lowest_limit[1] == pytest.approx((CARRIED - WEIGHT) / WEIGHT, rel=0.03)


def test_any_order_gives_the_same_bits(trial: HandTrial, tugged: HoldForces) -> None:
    backwards = tug(grip_of(trial), FINE, directions=["-z", "+y", "+x"])
    assert len(backwards.accelerations) == 3
    assert backwards.accelerations.items() <= tugged.accelerations.items()


def test_a_trial_after_a_tug_is_as_if_there_had_been_none(trial: HandTrial) -> None:
    scene, station = trial.diagram.scene, trial.diagram.station
    fresh = HandTrial(scene, station, engine=QUICK).run("block", CENTRE)
    grip = grip_of(trial)
    assert not grip.bears_load(lambda t: np.array([0.0, 0.0, 1e3]), 0.2, 0.005)
    assert repr(trial.run("block", CENTRE)) == repr(fresh)  # NaN is not equal to itself


def test_a_slow_shake_is_borne_as_far_as_statics_says(trial: HandTrial) -> None:
    """When hardly any sliding is allowed, the peaks of the load are like tugs."""
    strict = LoadSettings(slide=2e-4, tolerance=0.02)
    shaken = shake(grip_of(trial), strict, axes="z").forces
    assert shaken["z"] == pytest.approx(LIMITS["+z"], rel=0.03)


@pytest.mark.thorough
def test_a_fast_shake_is_borne_better_than_a_slow_one(trial: HandTrial) -> None:
    """In a shorter period the box slides less far before it is carried back."""
    grip = grip_of(trial)
    slow = shake(grip, LoadSettings(frequency=5.0), axes="y").accelerations["y"]
    more = LoadSettings(frequency=20.0, smallest=1.1 * slow, largest=1.2 * slow)
    assert shake(grip, more, axes="y").accelerations["y"] >= 1.1 * slow


def test_beyond_what_is_tried(trial: HandTrial) -> None:
    grip = grip_of(trial)
    for low, high, found in ((0.5, 5.0, math.inf), (40.0, 50.0, 0.0)):
        tugged = tug(grip, LoadSettings(smallest=low, largest=high))
        assert set(tugged.accelerations.values()) == {found}


def test_a_heavier_box_is_held_against_less(trial: HandTrial) -> None:
    """The force is the same, but for the weight."""
    grip = grip_of(trial, mass=1.0)
    found = tug(grip, FINE, directions=["+z"])
    assert found.weight == pytest.approx(9.81)
    assert found.forces["+z"] == pytest.approx(CARRIED - 9.81, rel=0.03)


def test_what_stands_around_does_not_matter(trial: HandTrial, tugged, make_scene) -> None:
    """A block beside the gripped one would be hit by it."""
    crowded = HandTrial(
        make_scene(
            ("block", 0.3, 0.2, 0.0),
            Instance(name="beside", object="block", X_SO=Pose((0.3, 0.252, 0.0))),
        ),
        make_station(),
        engine=QUICK,
    )
    found = tug(grip_of(crowded), FINE, directions=["-y"])
    assert found.forces["-y"] == pytest.approx(tugged.forces["-y"], rel=0.02)


@pytest.mark.thorough  # `test_alone` tells pieces from hulls
def test_hard_parts_of_a_hand_meet_a_bowl_and_not_its_hull(tmp_path: Path) -> None:
    """The fingers over the pads stay clear of the bowl, and would meet its hull within `slide`."""
    panda = load_station("panda_tabletop")
    shutil.copytree(panda.hand_model.parent, tmp_path / "panda")
    model = tmp_path / "panda" / panda.hand_model.name
    before, *parts = model.read_text().split("<collision ")
    soft = "<drake:compliant_hydroelastic/>"
    hard = [part if part.startswith('name="pad"') else part.replace(soft, "") for part in parts]
    model.write_text("<collision ".join([before, *hard]))
    scene, limits = load_scene("tabletop_six"), []
    rim = from_above(scene.entry("bowl").upper[2] - 0.004, 0.0, 0.07, yaw=math.pi / 2)
    for station in (panda, replace(panda, hand_model=model)):
        trial = HandTrial(scene, station, engine=QUICK)
        grip = take_grip(trial, "bowl", rim)
        assert isinstance(grip, Grip)
        assert (trial.world is trial.complete_world) == (station is not panda)
        limits.append(tug(grip, directions=["-z"]).accelerations["-z"])
    assert limits[1] == limits[0]


def test_what_is_not_held_has_no_grip(trial: HandTrial) -> None:
    result = take_grip(trial, "block", CENTRE, friction=0.01)
    assert isinstance(result, TrialResult)
    assert result.outcome is Outcome.SLIPPED


def test_bad_settings() -> None:
    with pytest.raises(InvalidInputError, match="loads are from 5 to 1 g"):
        LoadSettings(smallest=5.0, largest=1.0)
    with pytest.raises(InvalidInputError, match="frequency is 0; give more than 0"):
        LoadSettings(frequency=0.0)


def test_unknown_direction(trial: HandTrial) -> None:
    with pytest.raises(UnknownNameError, match="direction 'x' does not exist"):
        tug(grip_of(trial), directions=["x"])
