"""The approach of the hand alone: straight in, open; what is in its way is pushed, or stops it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from trial_world import CENTRE, QUICK, from_above, make_station

from burg_drake.core import Array, Outcome, Pose, Stage, grasp_from_axes, swap_fingers
from burg_drake.evaluation import trial_verdict
from burg_drake.scene import Scene
from burg_drake.simulation import Execution, HandTrial, TrialResult, TrialSettings
from burg_drake.station import GraspMotion, Obstacle, Station

APPROACH = TrialSettings(approach=True)
GRASPS = [from_above(0.05, y=y, yaw=yaw) for y, yaw in ((0.0, 0.0), (0.03, 0.0), (-0.02, 0.3))]
LONG = GraspMotion(standoff=0.30)
"""Leaves room between the hand at the pregrasp and at the grasp for what is in neither."""
LEVEL = grasp_from_axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.04))
"""A grasp of the post from -y, 40 mm above the table."""
FINGER = 0.0476
"""Middle of the open finger from the middle of the hand [m]: half of .080 and of .0152."""
TIP = 0.0095
"""How far the fingers reach beyond the origin of G [m]: .0584 + .04525 + .0185 / 2 - .1034."""
BLOCK = 0.05
"""Size of the block [m]."""
REAR = 0.03
"""Where the face of what is in the way is that the finger meets, in y [m]."""


def trial(scene: Scene, station: Station | None = None, **settings: object) -> HandTrial:
    asked = replace(APPROACH, **settings)
    return HandTrial(scene, station or make_station(), engine=QUICK, settings=asked)


@pytest.fixture(scope="module")
def box(make_scene: Callable[..., Scene]) -> HandTrial:
    return trial(make_scene(("box", 0.3, 0.2, 0.0)))


def assert_alike(one: TrialResult, other: TrialResult) -> None:
    assert one.outcome is other.outcome
    for name, tolerance in (("slip", 2e-4), ("tilt", 3e-3), ("lift", 5e-4), ("pad_force", 0.05)):
        first, second = getattr(one.margins, name), getattr(other.margins, name)
        assert first == pytest.approx(second, abs=tolerance), name


@pytest.mark.parametrize("friction", [0.15, 0.5])
def test_a_clear_approach_makes_no_difference(
    box: HandTrial, box_trial: HandTrial, friction: float
) -> None:
    for X_OG in GRASPS:
        result = box.run("box", X_OG, friction=friction)
        assert_alike(box_trial.run("box", X_OG, friction=friction), result)
        assert (result.pushed, result.touched) == ({"box": 0.0}, "")
        assert result.margins.pushed == 0.0


def test_the_hand_stands_at_the_grasp_before_it_closes_from_all_open(
    box: HandTrial, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After as long as a lift of the same length takes, and as much again to come to rest."""
    close, seen = Execution.close, []

    def look_and_close(execution: Execution) -> Outcome | None:
        plant = box.diagram.plant
        context = plant.GetMyContextFromRoot(box.context)
        fingers = [joint.GetOnePosition(context) for joint in box.hand.joints]
        seen.append((box.hand.X_WG(context), fingers, box.context.get_time()))
        return close(execution)

    monkeypatch.setattr(Execution, "close", look_and_close)
    box.run("box", CENTRE)
    ((X_WG, fingers, time),) = seen
    np.testing.assert_allclose(X_WG, box.X_WG("box", CENTRE), atol=1e-5)
    np.testing.assert_allclose(np.abs(fingers), 0.04, atol=1e-4)
    assert time == pytest.approx(APPROACH.time_of(GraspMotion().standoff), abs=0.03)


@pytest.mark.parametrize("time_step", [0.001, 0.003, 0.004])
def test_the_hand_comes_to_the_grasp_whatever_the_time_step(
    make_scene: Callable[..., Scene], monkeypatch: pytest.MonkeyPatch, time_step: float
) -> None:
    """Also where looks are no whole number of steps apart."""
    scene, engine = make_scene(("box", 0.3, 0.2, 0.0)), replace(QUICK, time_step=time_step)
    stepped = HandTrial(scene, make_station(), engine=engine, settings=APPROACH)
    seen: list[Array] = []

    def look(execution: Execution) -> Outcome:
        plant = stepped.diagram.plant
        seen.append(stepped.hand.X_WG(plant.GetMyContextFromRoot(stepped.context)))
        return Outcome.NO_CONTACT

    monkeypatch.setattr(Execution, "close", look)
    stepped.run("box", CENTRE)
    np.testing.assert_allclose(seen[0], stepped.X_WG("box", CENTRE), atol=1e-5)


@pytest.mark.parametrize("lift_direction", [(0.0, 0.0, 1.0), (0.0, -0.6, 0.8)])
def test_retreat_and_lift_go_on_from_the_grasp(
    make_scene: Callable[..., Scene], lift_direction: tuple[float, float, float]
) -> None:
    scene = make_scene(("box", 0.3, 0.2, 0.0))
    motion = GraspMotion(
        standoff=0.06, retreat=0.05, lift_height=0.1, lift_direction=lift_direction
    )
    with_approach = trial(scene, motion=motion).run("box", CENTRE)
    without = trial(scene, motion=motion, approach=False).run("box", CENTRE)
    assert without.outcome is Outcome.LIFTED
    assert without.margins.lift == pytest.approx(0.15, abs=0.002)
    assert_alike(without, with_approach)


def test_the_same_bits_again_and_alike_in_a_turned_world_or_with_swapped_fingers(
    box: HandTrial, make_scene: Callable[..., Scene]
) -> None:
    X_OG = GRASPS[1]
    first = box.run("box", X_OG, friction=0.15)
    assert box.run("box", GRASPS[0]).outcome is Outcome.LIFTED
    assert box.run("box", X_OG, friction=0.15) == first
    assert_alike(first, box.run("box", swap_fingers(X_OG), friction=0.15))
    turned = make_station(X_WS=Pose((0.4, -0.1, 0.0), rpy_deg=(0.0, 0.0, 37.0)))
    other = trial(make_scene(("box", 0.3, 0.2, 0.0)), turned)
    assert_alike(first, other.run("box", X_OG, friction=0.15))


# --- what stands in the way ---------------------------------------------------------------------


def in_the_way(side: float = 1.0) -> tuple[float, float]:
    """Where a block stands in front of a finger, in x and y."""
    return 0.3 + side * FINGER, REAR + BLOCK / 2


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_light_block_in_the_way_of_a_finger_is_pushed_to_where_its_tip_ends(
    make_scene: Callable[..., Scene], side: float
) -> None:
    scene = make_scene(("post", 0.3, 0.2, 0.0), ("block", *in_the_way(side), 0.0))
    without = trial(scene, motion=LONG, approach=False).run("post", LEVEL)
    assert (without.outcome, without.pushed, without.touched) == (Outcome.LIFTED, {}, "")
    result = trial(scene, motion=LONG).run("post", LEVEL)
    assert result.pushed["block"] == pytest.approx(0.2 + TIP - REAR, abs=1e-3)
    assert result.margins.pushed == result.pushed["block"]
    assert result.displacements["block"] >= result.pushed["block"]
    assert result.margins.others_moved == result.displacements["block"]
    assert result.pushed["post"] == 0.0
    assert result.touched.endswith("finger vs block")
    assert result.outcome is Outcome.LIFTED_DISTURBED


def test_pushing_is_the_same_with_all_objects_free(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene(("post", 0.3, 0.2, 0.0), ("block", *in_the_way(), 0.0))
    lazy, full = (
        HandTrial(
            scene, make_station(), engine=QUICK, settings=replace(APPROACH, motion=LONG), lock=lock
        ).run("post", LEVEL)
        for lock in (True, False)
    )
    assert lazy.outcome is full.outcome
    assert lazy.pushed["block"] == pytest.approx(full.pushed["block"], abs=2e-4)


def fixed(p_WB: tuple[float, float, float]) -> Station:
    return make_station(obstacles={"rail": Obstacle(X_WB=Pose(p_WB), size=(BLOCK,) * 3)})


def test_a_fixed_box_in_the_way_blocks(make_scene: Callable[..., Scene]) -> None:
    """When the tip comes there while it accelerates from rest."""
    x, y = in_the_way()
    station = fixed((x, y, BLOCK / 2))
    scene = make_scene(("post", 0.3, 0.2, 0.0))
    assert trial(scene, station, motion=LONG, approach=False).run("post", LEVEL).outcome.held
    result = trial(scene, station, motion=LONG).run("post", LEVEL)
    assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "rail")
    assert result.touched.endswith("finger vs rail")
    way = REAR - TIP - (0.2 - LONG.standoff)  # in the half in which it accelerates
    assert way < LONG.standoff / 2
    meets = np.sqrt(2.0 * way / APPROACH.acceleration)
    assert result.margins.end_time == pytest.approx(meets, abs=2.0 * APPROACH.poll)
    assert result.pushed == {"post": 0.0}
    assert np.isnan(result.margins.slip)


def test_what_is_in_the_open_hand_at_the_pregrasp_is_told_without_a_step(
    make_scene: Callable[..., Scene],
) -> None:
    y = 0.2 - LONG.standoff
    scene = make_scene(("post", 0.3, 0.2, 0.0))
    result = trial(scene, fixed((0.3 + FINGER, y, BLOCK / 2)), motion=LONG).run("post", LEVEL)
    assert (result.outcome, result.blocker) == (Outcome.HAND_COLLISION_APPROACH, "rail")
    assert result.margins.end_time == 0.0 and result.margins.overlap > 0.005
    assert trial_verdict(result).stage is Stage.REACHABLE


def test_a_pregrasp_below_the_table(make_scene: Callable[..., Scene]) -> None:
    """The hand is above the table at the grasp, and comes to it from below."""
    scene = make_scene(("post", 0.3, 0.2, 0.0))
    rising: Array = grasp_from_axes((1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.0, -0.012, 0.12))
    assert trial(scene, approach=False).run("post", rising).outcome is Outcome.LIFTED
    result = trial(scene).run("post", rising)
    assert (result.outcome, result.blocker) == (Outcome.HAND_COLLISION_APPROACH, "table")


def test_the_grasp_itself_is_screened_first(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene(("post", 0.3, 0.2, 0.0))
    result = trial(scene, fixed((0.3 + FINGER, 0.2, BLOCK / 2)), motion=LONG).run("post", LEVEL)
    assert (result.outcome, result.blocker) == (Outcome.COLLISION_BACKGROUND, "rail")


def test_without_a_standoff_there_is_no_approach(
    box_trial: HandTrial, make_scene: Callable[..., Scene]
) -> None:
    scene = make_scene(("box", 0.3, 0.2, 0.0))
    result = trial(scene, motion=GraspMotion(standoff=0.0)).run("box", CENTRE)
    assert result == box_trial.run("box", CENTRE)
