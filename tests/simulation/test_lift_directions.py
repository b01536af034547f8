"""Where the hand goes with the target: in which directions, by closed forms and by symmetry."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from trial_world import CENTRE, FORCE, GRAVITY, QUICK, from_above, lifting, make_station

from burg_drake.core import InvalidInputError, Outcome, Pose, grasp_from_axes, make_pose, rot_z
from burg_drake.scene import Instance
from burg_drake.simulation import HandTrial
from burg_drake.station import FloatingHand, GraspMotion, Obstacle, build_station_diagram
from tests.thorough import thorough

WHOLE = replace(QUICK, whole_trial=True)
IN_THE_AIR = Instance(object="box", X_SO=Pose((0.3, 0.2, 0.6)))
BLOCK = Instance(object="block", X_SO=Pose((0.3, 0.2, 0.6)))
BLOCK_MASS, MIDDLE = 0.1, from_above(0.025)
"""The grasp is at the block's centre of mass."""
FROM_THE_SIDE = grasp_from_axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -0.02, 0.05))
TIME = 0.3
DISTANCE = GRAVITY * TIME**2 / 4
"""Over this distance in this time the hand accelerates and brakes by g [m]."""


@pytest.mark.parametrize("u", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (1e-9, 0, -1), (0.3, -0.5, -0.9)])
def test_the_joint_goes_along_any_direction_and_begins_where_the_hand_is(make_scene, u) -> None:
    built = build_station_diagram(make_scene(("box", 0.3, 0.2, 0.0)), make_station(), robot="hand")
    hand, direction = FloatingHand(built), np.array(u) / np.linalg.norm(u)
    context = built.plant.GetMyMutableContextFromRoot(built.diagram.CreateDefaultContext())
    X_WG = make_pose(rot_z(0.7), (0.1, 0.2, 0.3)) @ from_above(0.1)
    hand.place(context, X_WG, direction_W=np.array((0.6, 0.0, 0.8)))
    hand.lift.set_translation(context, 0.05)
    before = hand.X_WG(context)
    np.testing.assert_allclose(before[:3, 3] - X_WG[:3, 3], (0.03, 0.0, 0.04), atol=1e-12)
    hand.set_lift_direction(context, direction)
    np.testing.assert_allclose(hand.X_WG(context), before, atol=1e-12)
    hand.lift.set_translation(context, 0.2)
    after = hand.X_WG(context)
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], 0.2 * direction, atol=1e-12)
    np.testing.assert_allclose(after[:3, :3], before[:3, :3], atol=1e-12)


def test_a_retreat_straight_up_is_a_lift(make_scene, box_trial: HandTrial) -> None:
    motion = GraspMotion(retreat=0.30, lift_height=0.0)
    retreat = HandTrial(
        make_scene(("box", 0.3, 0.2, 0.0)), make_station(), motion=motion, engine=QUICK
    )
    one, other = (trial.run("box", from_above(0.06, y=0.02)) for trial in (retreat, box_trial))
    assert one.outcome is other.outcome is Outcome.LIFTED
    assert asdict(one.margins) == asdict(other.margins)


def test_a_lift_in_two_parts_is_as_long_as_both(make_scene, box_trial: HandTrial) -> None:
    """The hand stands still between them, in which the box must not jump."""
    motion = GraspMotion(retreat=0.1, lift_height=0.2)
    trial = HandTrial(
        make_scene(("box", 0.3, 0.2, 0.0)), make_station(), motion=motion, engine=QUICK
    )
    result, at_once = trial.run("box", CENTRE), box_trial.run("box", CENTRE)
    assert result.outcome is Outcome.LIFTED
    assert result.margins.lift == pytest.approx(0.30, abs=0.001)
    assert result.margins.slip == pytest.approx(at_once.margins.slip, abs=1e-4)
    assert trial.run("box", CENTRE, lift=0.05).margins.lift == pytest.approx(0.15, abs=0.001)


@pytest.mark.parametrize(
    "u", [(0, 1, 0), (0, -1, 1), thorough((0, 0, -1))], ids=["sideways", "tilted", "down"]
)
def test_friction_bears_weight_and_acceleration(make_scene, u: tuple[float, ...]) -> None:
    """2 mu N = m |g z + a u|, where the hand accelerates by a along u and brakes by as much."""
    direction = np.array(u) / np.linalg.norm(u)
    loads = [np.linalg.norm(s * GRAVITY * direction + (0, 0, GRAVITY)) for s in (1, -1)]
    limit = BLOCK_MASS * max(loads) / (2 * FORCE)
    trial = HandTrial(
        make_scene(BLOCK),
        make_station(),
        settings=replace(lifting(DISTANCE, TIME, hold_time=0.1), motion=None, poll=0.002),
        motion=GraspMotion(lift_height=DISTANCE, lift_direction=u),
    )
    held, lost = (trial.run("block", MIDDLE, friction=share * limit) for share in (1.08, 0.92))
    assert held.outcome is Outcome.LIFTED
    assert held.margins.slip < 0.001
    assert lost.margins.slip > 0.004


@pytest.mark.thorough
def test_what_is_decided_on_a_tilted_lift_is_confirmed_by_the_whole_trial(make_scene) -> None:
    motion = GraspMotion(lift_height=0.2, lift_direction=(0.5, 0.0, 0.5))
    scene, station = make_scene(IN_THE_AIR), make_station()
    early, whole = (
        HandTrial(scene, station, engine=e, motion=motion).run("box", CENTRE)
        for e in (QUICK, WHOLE)
    )
    assert early.outcome is whole.outcome is Outcome.LIFTED
    assert early.margins.end_time < whole.margins.end_time - 0.5
    assert early.margins.lift == pytest.approx(0.2, abs=0.001)
    assert early.margins.lift == pytest.approx(whole.margins.lift, abs=0.001)
    assert early.margins.slip == pytest.approx(whole.margins.slip, abs=2e-4)


def test_it_does_not_matter_how_the_world_is_turned(make_scene) -> None:
    turn = rot_z(0.8)
    X_WS = Pose.from_matrix(make_pose(turn, (0.1, -0.05, 0.0)), quaternion=True)
    direction = np.array((0.3, -0.4, 0.8))
    scene, motion = make_scene(("box", 0.3, 0.2, 30.0)), GraspMotion(retreat=0.05, lift_height=0.1)
    results = [
        HandTrial(scene, make_station(X), motion=replace(motion, lift_direction=tuple(u))).run(
            "box", from_above(0.055, y=0.015)
        )
        for X, u in ((Pose(), direction), (X_WS, turn @ direction))
    ]
    assert {result.outcome for result in results} == {Outcome.LIFTED}
    for name in ("slip", "tilt", "pad_force", "patch_area", "lift", "end_time"):
        one, other = (getattr(result.margins, name) for result in results)
        assert one == pytest.approx(other, rel=0.02, abs=2e-5), name


def board(z: float) -> dict[str, Obstacle]:
    """A board above the box and the hand at its side, that ends 0.1 m before it."""
    return {"shelf": Obstacle(X_WB=Pose((0.3, 0.3, z + 0.01)), size=(0.5, 0.4, 0.02))}


def test_a_retreat_leads_out_from_under_a_board(make_scene) -> None:
    scene, station = make_scene(("box", 0.3, 0.2, 0.0)), make_station(obstacles=board(0.15))
    up, out = (
        HandTrial(scene, station, motion=motion, engine=QUICK).run("box", FROM_THE_SIDE)
        for motion in (GraspMotion(), GraspMotion(retreat=0.2))
    )
    assert (up.outcome, up.blocker) == (Outcome.BLOCKED, "shelf")
    assert out.outcome is Outcome.LIFTED
    assert out.margins.lift == pytest.approx(0.2 + 0.3, abs=0.005)


def test_a_station_says_where_the_hand_goes(make_scene) -> None:
    """Unless the call does: under the board there is room for a lift of 2 cm."""
    scene, station = make_scene(("box", 0.3, 0.2, 0.0)), make_station(obstacles=board(0.15))
    low = replace(station, document=replace(station.document, motion=GraspMotion(lift_height=0.02)))
    trial = HandTrial(scene, low, engine=QUICK)
    result = trial.run("box", FROM_THE_SIDE)
    assert result.outcome is Outcome.LIFTED
    assert result.margins.lift == pytest.approx(0.02, abs=0.001)
    assert trial.run("box", FROM_THE_SIDE, lift=0.3).outcome is Outcome.BLOCKED
    high = HandTrial(scene, low, motion=GraspMotion(), engine=QUICK).run("box", FROM_THE_SIDE)
    assert high.outcome is Outcome.BLOCKED


def test_a_lift_down_through_the_table_is_blocked(make_scene) -> None:
    motion = GraspMotion(lift_direction=(0.0, 0.0, -1.0))
    trial = HandTrial(
        make_scene(("box", 0.3, 0.2, 0.0)), make_station(), motion=motion, engine=QUICK
    )
    result = trial.run("box", CENTRE)
    assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "table")


@pytest.mark.parametrize("lift", [0.0, -0.1, np.inf, np.nan])
def test_a_lift_of_no_length(box_trial: HandTrial, lift: float) -> None:
    with pytest.raises(InvalidInputError, match=r"lift is .* m and retreat 0 m"):
        box_trial.run("box", CENTRE, lift=lift)
