"""What stands above hand or target is met in the lift, though a trial may end early."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from trial_world import CENTRE, QUICK, from_above, make_station

from burg_drake.core import Outcome, Pose
from burg_drake.scene import Instance
from burg_drake.simulation import HandTrial, TrialResult
from burg_drake.station import Obstacle
from tests.thorough import thorough

UNDECIDED = 0.6
"""A trial in free air is decided before this [s]."""


def shelf(height: float, y: float) -> dict[str, Obstacle]:
    """A board of 20 mm, its underside at a height, from y to y + 0.2 m, over the whole width."""
    return {
        "shelf": Obstacle(X_WB=Pose((0.3, y + 0.1, height + 0.01)), size=(0.6, 0.2, 0.02)),
    }


def both(make_scene, *instances, X_OG=CENTRE, **obstacles) -> tuple[TrialResult, TrialResult]:
    """The trial that may end early, and the one that is simulated to its end."""
    engine = QUICK
    early, whole = (
        HandTrial(make_scene(*instances), make_station(**obstacles), engine=e).run("box", X_OG)
        for e in (engine, replace(engine, whole_trial=True))
    )
    assert early.outcome is whole.outcome
    return early, whole


@pytest.mark.thorough
def test_a_shelf_above_the_end_of_the_target_turns_it_in_the_hand(make_scene) -> None:
    """It covers the box beyond the hand, which itself passes."""
    early, whole = both(make_scene, ("box", 0.3, 0.2, 0.0), obstacles=shelf(0.25, 0.235))
    assert early.margins.end_time > UNDECIDED
    assert early.margins.tilt > np.deg2rad(30.0)
    assert early.margins.tilt == pytest.approx(whole.margins.tilt, rel=0.05)


@pytest.mark.parametrize("height", [thorough(0.30), 0.45])
def test_a_shelf_in_the_way_of_the_hand_ends_the_trial(make_scene, height: float) -> None:
    """The hand's top is 0.112 m above the grasp frame, which starts at 0.05 m."""
    for result in both(make_scene, ("box", 0.3, 0.2, 0.0), obstacles=shelf(height, 0.1)):
        assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "shelf")
        assert result.margins.lift == pytest.approx(height - 0.162, abs=0.006)


def test_a_block_that_stands_a_hair_above_another_goes_with_it(make_scene) -> None:
    """The fingers centre the box, which pushes a row of two blocks, and a third one on the last."""
    scene = make_scene(
        ("box", 0.3, 0.2, 0.0),
        Instance(name="near", object="block", X_SO=Pose((0.357, 0.21, 0.0))),
        Instance(name="behind", object="block", X_SO=Pose((0.409, 0.215, 0.0))),
        Instance(name="above", object="block", X_SO=Pose((0.420, 0.215, 0.0501))),
    )
    X_OG = from_above(0.065, x=0.006)
    locked, free = (
        HandTrial(scene, make_station(), lock=lock, engine=QUICK).run("box", X_OG)
        for lock in (True, False)
    )
    assert locked.outcome is free.outcome is Outcome.LIFTED
    for result in (locked, free):
        assert result.displacements["above"] > 0.0005


@pytest.mark.thorough
def test_a_shelf_above_all_is_no_obstacle(make_scene) -> None:
    early, _ = both(make_scene, ("box", 0.3, 0.2, 0.0), obstacles=shelf(0.60, 0.1))
    assert early.outcome is Outcome.LIFTED
    assert early.margins.end_time < UNDECIDED


def test_a_neighbour_that_lies_on_a_shelf_in_the_way_is_knocked_down(make_scene) -> None:
    """A block on the shelf reaches over its edge, and the rising box takes it along."""
    block = Instance(object="block", X_SO=Pose((0.3, 0.245, 0.20)))
    early, whole = both(
        make_scene, ("box", 0.3, 0.2, 0.0), block, X_OG=from_above(0.05, y=-0.02),
        obstacles=shelf(0.18, 0.248),
    )  # fmt: skip
    assert early.margins.others_moved == pytest.approx(whole.margins.others_moved, rel=0.01)
    assert early.margins.end_time > UNDECIDED
    assert early.displacements["block"] > 0.01


@pytest.mark.thorough
def test_a_neighbour_beside_the_way_stays_asleep(make_scene) -> None:
    block = Instance(object="block", X_SO=Pose((0.3, 0.29, 0.20)))
    early, _ = both(
        make_scene, ("box", 0.3, 0.2, 0.0), block, X_OG=from_above(0.05, y=-0.02),
        obstacles=shelf(0.18, 0.265),
    )  # fmt: skip
    assert early.outcome is Outcome.LIFTED
    assert early.margins.end_time < UNDECIDED
    assert early.displacements == {"block": 0.0}
