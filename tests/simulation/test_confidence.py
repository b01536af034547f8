"""Confidence in verdicts: it falls towards Coulomb's limit, and is the same from all sides."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from trial_world import BOX_MASS, FORCE, GRAVITY, from_above, make_station

from burg_drake.core import CONTESTED_CONFIDENCE, Margins, Outcome, Pose, make_pose, rot_z
from burg_drake.objects import ObjectEntry, load_library
from burg_drake.scene import Scene
from burg_drake.simulation import (
    DEFAULT_TRIAL,
    OUTCOMES_WITHOUT_VERDICT,
    PAD_FRICTION_LEVER,
    GripLoad,
    HandTrial,
    Population,
    calibration,
    confidence,
    confidence_from_signs,
    grip_signs,
)
from burg_drake.station import ENGINES

LOAD = BOX_MASS * (GRAVITY + DEFAULT_TRIAL.acceleration)
LIMIT = LOAD / (2 * FORCE)
"""Smallest friction with which the pads lift the box."""
GRIP = GripLoad(friction=0.5, force=FORCE, mass=BOX_MASS, acceleration=0.0, lever=0.0)


@pytest.fixture(scope="module")
def trial(make_scene: Callable[..., Scene]) -> HandTrial:
    return HandTrial(make_scene(("box", 0.3, 0.2, 0.0)), make_station())


def sure(trial: HandTrial, friction: float) -> float:
    """Confidence in the verdict on the box."""
    found = trial.run("box", from_above(0.05), friction=friction).confidence
    assert found is not None and 0.0 <= found <= 1.0
    return found


def test_what_is_far_from_the_limit_is_sure(trial: HandTrial) -> None:
    near = [sure(trial, share * LIMIT) for share in (0.98, 1.02)]
    far = [sure(trial, share * LIMIT) for share in (0.4, 5.0)]
    assert min(far) > 0.95
    assert min(near) < CONTESTED_CONFIDENCE
    assert max(near) < min(far) - 0.015


def test_the_same_with_fingers_swapped_and_the_world_turned(
    make_scene: Callable[..., Scene], trial: HandTrial
) -> None:
    friction = 1.1 * LIMIT
    swapped = from_above(0.05) @ make_pose(rot_z(np.pi))
    other = trial.run("box", swapped, friction=friction).confidence
    turned = make_station(Pose.from_matrix(make_pose(rot_z(2.0), (0.4, 0.1, 0.0)), quaternion=True))
    world = HandTrial(make_scene(("box", 0.3, 0.2, 0.0)), turned)
    expected = sure(trial, friction)
    assert other == pytest.approx(expected, abs=0.02)
    assert sure(world, friction) == pytest.approx(expected, abs=0.02)


def test_the_way_to_the_grasp_does_not_count(
    make_scene: Callable[..., Scene], trial: HandTrial
) -> None:
    settings = dataclasses.replace(DEFAULT_TRIAL, approach=True)
    approaching = HandTrial(make_scene(("box", 0.3, 0.2, 0.0)), make_station(), settings=settings)
    for share in (0.7, 1.3, 3.0):
        expected = sure(trial, share * LIMIT)
        assert sure(approaching, share * LIMIT) == pytest.approx(expected, abs=0.01)


def test_an_engine_with_settings_of_its_own_has_none(
    make_scene: Callable[..., Scene], trial: HandTrial
) -> None:
    own = dataclasses.replace(ENGINES["screening"], time_step=0.004)
    scene = make_scene(("box", 0.3, 0.2, 0.0))
    assert HandTrial(scene, make_station(), engine=own).run("box", from_above(0.06)).confidence is (
        None
    )
    assert confidence(own, Outcome.LIFTED, Margins(), GRIP) is None
    collided = trial.run("box", from_above(-0.01))
    assert collided.outcome.stage.value == "clear" and collided.confidence is None


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("held", [True, False])
def test_each_preset_is_calibrated(engine: str, held: bool) -> None:
    """Trials in parallel have the curves of those one by one."""
    curves = calibration()[ENGINES[engine].serial.name, held]
    signs = grip_signs(Margins(), GRIP)
    assert curves.keys() <= signs.keys()
    for curve in curves.values():
        assert list(curve.knots) == sorted(set(curve.knots))
        assert len(curve.knots) == len(curve.logits)


@pytest.mark.parametrize("outcome", [o for o in Outcome if o.stage.value == "executed"])
def test_every_outcome_of_a_trial_has_one(outcome: Outcome) -> None:
    found = confidence_from_signs("standard", outcome, grip_signs(Margins(), GRIP))
    assert (found is None) is (outcome in OUTCOMES_WITHOUT_VERDICT)


def test_the_load_by_hand() -> None:
    """A mass of 2 kg, 30 mm beside the closing axis, in pads that press with 40 N."""
    X_WG = make_pose(rot_z(np.pi / 2), (0.1, 0.2, 0.3))  # closes along y
    load = GripLoad.of(
        X_WG,
        np.array([0.13, 0.25, 0.28]),
        friction=0.5,
        force=40.0,
        mass=2.0,
        acceleration=0.19,
    )
    assert load.lever == pytest.approx(0.03)
    assert load.carried == pytest.approx(2.0 * 10.0 / 40.0)
    assert load.turned == pytest.approx(0.5 * 0.03 / PAD_FRICTION_LEVER)
    slippery = dataclasses.replace(load, friction=0.0)
    assert math.isfinite(slippery.carried) and slippery.carried > load.carried


@pytest.mark.parametrize("share", [0.5, 0.8, 1.25, 2.0])
def test_the_limit_is_as_far_away_from_both_sides(share: float) -> None:
    """Half and double of what friction carries are alike, and never below 0; what turns more than
    it pulls, and what is far, count as far."""
    carries = 2.0 * GRIP.friction * GRIP.force
    load = dataclasses.replace(GRIP, mass=share * carries / GRAVITY)
    expected = abs(math.log10(share))
    assert grip_signs(Margins(), load)["limit"] == pytest.approx(expected)
    beside = dataclasses.replace(
        load, lever=0.75 * PAD_FRICTION_LEVER
    )  # 3, 4 and 5 parts of one triangle
    signs = grip_signs(Margins(), beside)
    assert signs["turned"] == pytest.approx(signs["carried"] + math.log10(0.75))
    assert signs["limit"] == pytest.approx(min(0.4, abs(math.log10(1.25 * share))))
    for far in (
        dataclasses.replace(load, lever=1.5 * PAD_FRICTION_LEVER),
        dataclasses.replace(load, mass=1e-3),
    ):
        assert grip_signs(Margins(), far)["limit"] == 0.4


def test_what_was_not_measured_counts_as_nothing() -> None:
    signs = grip_signs(Margins(end_time=0.4), GRIP)
    assert all(map(math.isfinite, signs.values()))
    assert signs["lift"] == signs["patch_area"] == 0.0


@pytest.fixture
def can() -> ObjectEntry:
    """A can of 0.35 kg, 68 mm wide and 102 mm high."""
    return load_library("household").entry("can")


def resized(entry: ObjectEntry, *size: float) -> ObjectEntry:
    return dataclasses.replace(entry, lower=(0.0, 0.0, 0.0), upper=size)


def test_objects_unlike_those_of_the_fit_are_told_by_what_differs(can: ObjectEntry) -> None:
    fitted = Population(
        objects=2, max_mass=1.5, min_thickness=0.004, min_length=0.022, max_length=0.26
    )
    assert str(fitted) == (
        "objects of up to 1.5 kg that are at least 4 mm thick and 22 to 260 mm long"
    )
    assert fitted.differences(can) == []
    heavy = dataclasses.replace(can.mass_properties, mass=3.2)
    anvil = dataclasses.replace(can, mass_properties=heavy)
    assert fitted.differences(anvil) == ["3.2 kg is heavier"]
    assert fitted.differences(resized(can, 0.05, 0.0021, 0.08)) == ["2.1 mm is thinner"]
    assert fitted.differences(resized(can, 0.02, 0.02, 0.0215)) == ["21.5 mm is shorter"]
    broom = resized(anvil, 1.2, 0.03, 0.03)
    assert fitted.differences(broom) == ["3.2 kg is heavier", "1200 mm is longer"]
    assert fitted.differences(resized(can, 0.26, 0.1, 0.004)) == []  # as at the ends


def test_the_built_in_objects_are_like_those_of_the_fit() -> None:
    population = Population.of_calibration()
    assert population.objects >= 40
    for name, entry in load_library("household").objects.items():
        assert population.differences(entry) == [], name
