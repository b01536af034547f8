"""Trials judged by symmetry, and outcomes whose truth is known by construction."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from trial_world import BOX, CENTRE, FORCE, GRAVITY, PAD, QUICK, from_above, lifting, make_station

from burg_drake.core import InvalidInputError, Outcome, Pose, grasp_from_axes, swap_fingers
from burg_drake.scene import Instance
from burg_drake.simulation import DEFAULT_TRIAL, NO_GRIP_LIMITS, Execution, HandTrial, TrialResult
from burg_drake.station import Obstacle


def margins(result) -> np.ndarray:
    return np.array(list(asdict(result.margins).values()))


def test_centred_grasp_holds_with_the_commanded_force(box_trial: HandTrial) -> None:
    result = box_trial.run("box", CENTRE)
    assert result.outcome is Outcome.LIFTED
    assert result.margins.pad_force == pytest.approx(FORCE, rel=0.01)
    assert result.margins.lift == pytest.approx(0.30, abs=0.001)
    assert result.margins.slip < 0.0005
    assert result.margins.tilt < np.deg2rad(0.1)
    assert result.margins.patch_area == pytest.approx(PAD[0] * PAD[1], rel=0.01)
    assert result.margins.end_time < 0.5  # decided soon after it left the table


def test_the_whole_trial_confirms_what_was_decided_on_the_way(make_scene, box_trial) -> None:
    engine = replace(QUICK, whole_trial=True)
    whole = HandTrial(make_scene(("box", 0.3, 0.2, 0.0)), make_station(), engine=engine)
    for X_OG in (CENTRE, GRASPS[3]):
        early, full = (t.run("box", X_OG) for t in (box_trial, whole))
        assert early.margins.end_time < 0.6 < 1.75 < full.margins.end_time
        assert_same(early, full)


def test_tilt_of_an_eccentric_grasp_falls_with_friction(box_trial: HandTrial) -> None:
    """Gripped 20 mm beside its centre, the box is held against turning by the pads' friction."""
    tilts = [
        box_trial.run("box", from_above(0.05, y=0.02), friction=mu).margins.tilt
        for mu in (0.2, 0.4, 0.8)
    ]
    assert tilts[0] > tilts[1] > tilts[2]
    assert tilts[2] < np.deg2rad(1.0)


def test_dropped_while_holding(make_scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pads lose most of their friction once the box is up."""
    engine = replace(QUICK, whole_trial=True)
    trial = HandTrial(make_scene(("box", 0.3, 0.2, 0.0)), make_station(), engine=engine)
    lift = Execution.lift
    greased = []

    def lift_and_grease(execution: Execution) -> Outcome | None:
        outcome = lift(execution)
        trial.world.set_friction("box", 0.01)
        greased.append(trial.context.get_time())
        return outcome

    monkeypatch.setattr(Execution, "lift", lift_and_grease)
    result = trial.run("box", CENTRE)
    assert result.outcome is Outcome.DROPPED
    # sixty millimetres from the box's top to the pads' lower edge fall free in a tenth of a second
    assert 0.05 < result.margins.end_time - greased[0] < 0.4


@pytest.mark.parametrize(("share", "outcome"), [(0.3, "slipped"), (0.7, "lifted")])
def test_half_of_the_lift_is_lifted(make_scene, share: float, outcome: str) -> None:
    """A post slides through the fingers, which lift it by a known share of their own way.

    Friction that gives it an acceleration a, less than the A of the hand, has it at the hand's
    speed after T A / (a + A), and at rest with the hand after a share 2 a / (a + A) of the lift.
    """
    height, time, mass = 0.1, 0.35, 0.3
    A = 4 * height / time**2
    a = share * A / (2 - share)
    settings = lifting(height, time, **NO_GRIP_LIMITS)
    trial = HandTrial(
        make_scene(("post", 0.3, 0.2, 0.0)), make_station(), settings=settings, engine=QUICK
    )
    sideways = grasp_from_axes((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.2))
    result = trial.run("post", sideways, friction=mass * (GRAVITY + a) / (2 * FORCE))
    assert result.outcome == outcome
    assert result.margins.lift == pytest.approx(share * height, abs=0.01)


def test_what_lies_on_one_finger_in_the_end_is_not_held(
    make_scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gripped from above and below; then the hand opens slowly, and the block stays on a finger."""
    engine = replace(QUICK, whole_trial=True)
    block = Instance(object="block", X_SO=Pose((0.3, 0.2, 0.3)))
    trial = HandTrial(make_scene(block), make_station(), engine=engine)
    lift = Execution.lift
    after: list[Execution] = []

    def lift_and_open(execution: Execution) -> Outcome | None:
        outcome = lift(execution)
        trial.world.command("hand", -0.02 * trial.hand.closing_command())
        after.append(execution)
        return outcome

    monkeypatch.setattr(Execution, "lift", lift_and_open)
    sideways = grasp_from_axes((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.025))
    result = trial.run("block", sideways)
    (execution,) = after
    assert sorted(execution.contact.touching) == [False, True]
    assert result.outcome is Outcome.DROPPED


def test_thin_air(box_trial: HandTrial) -> None:
    result = box_trial.run("box", from_above(0.30))
    assert result.outcome is Outcome.NO_CONTACT
    assert result.margins.lift == pytest.approx(0.0, abs=1e-4)
    assert np.isnan(result.margins.slip)


def test_squeezed_out(make_scene) -> None:
    """Pads that close beside the middle of a slippery ball push it away."""
    trial = HandTrial(make_scene(("ball", 0.3, 0.2, 0.0)), make_station(), engine=QUICK)
    result = trial.run("ball", from_above(0.03, y=0.026), friction=0.05)
    assert result.outcome is Outcome.CLOSED_EMPTY


def test_one_finger_against_an_object_that_does_not_move(make_scene) -> None:
    """20 kg with a coefficient of 1.5 on a table of 0.5 rub with 147 N, more than both fingers'
    80 N: the first finger stops the hand."""
    trial = HandTrial(make_scene(("heavy", 0.3, 0.2, 0.0)), make_station(), engine=QUICK)
    result = trial.run("heavy", from_above(0.05, x=0.006), friction=1.5)
    assert result.outcome is Outcome.ONE_FINGER
    assert result.margins.lift == pytest.approx(0.0, abs=4e-3)  # it sinks in a little


def test_fingers_push_a_light_object_to_the_middle(box_trial: HandTrial) -> None:
    result = box_trial.run("box", from_above(0.05, x=0.006))
    assert result.outcome is Outcome.LIFTED


@pytest.mark.parametrize(
    ("X_OG", "outcome", "blocker", "overlap"),
    [
        # the finger tips are 9.5 mm beyond the grasp frame
        (from_above(-0.01, x=0.15), Outcome.COLLISION_TABLE, "table", 0.0195),
        (from_above(0.05, x=0.03), Outcome.COLLISION_TARGET, "box", None),
        (from_above(0.03, x=-0.15), Outcome.COLLISION_CLUTTER, "block", None),
        (from_above(0.05, y=0.2), Outcome.COLLISION_BACKGROUND, "post", None),
    ],
)
def test_start_collisions(make_scene, X_OG, outcome, blocker, overlap) -> None:
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("block", 0.15 - 0.04, 0.2, 0.0))
    post = Obstacle(X_WB=Pose((0.34, 0.4, 0.1)), size=(0.04, 0.04, 0.2))
    result = HandTrial(scene, make_station(obstacles={"post": post}), engine=QUICK).run("box", X_OG)
    assert (result.outcome, result.blocker) == (outcome, blocker)
    if overlap is None:
        assert result.margins.overlap > 0.001
    else:
        assert result.margins.overlap == pytest.approx(overlap, abs=1e-6)
    assert result.margins.end_time == 0.0


def test_hand_clear_by_a_hair(box_trial: HandTrial) -> None:
    """Pads 40 mm from the middle, a face at 30 mm: 9.9 mm aside is clear, 10.1 mm is not."""
    assert BOX[0] / 2 == 0.03
    X_WO = box_trial.diagram.X_WO("box")
    clear = box_trial.clearance.check("box", X_WO @ from_above(0.05, x=0.0099))
    overlapping = box_trial.clearance.check("box", X_WO @ from_above(0.05, x=0.0101))
    assert clear.outcome is None and clear.overlap == 0.0
    assert overlapping.outcome is Outcome.COLLISION_TARGET
    assert overlapping.overlap == pytest.approx(0.0001, abs=1e-6)


GRASPS = [
    CENTRE,
    from_above(0.06, y=0.01, yaw=0.1),
    from_above(0.07, y=-0.01),
    from_above(0.045, x=0.005, yaw=-0.2),
    from_above(0.075, x=-0.004, y=0.01),
]


def assert_same(one: TrialResult, other: TrialResult) -> None:
    assert one.outcome is other.outcome
    assert one.margins.pad_force == pytest.approx(other.margins.pad_force, rel=1e-3)
    assert one.margins.slip == pytest.approx(other.margins.slip, abs=2e-4)
    assert one.margins.tilt == pytest.approx(other.margins.tilt, abs=np.deg2rad(1.0))
    assert one.margins.lift == pytest.approx(other.margins.lift, abs=2e-3)


@pytest.fixture(scope="module")
def results(box_trial: HandTrial) -> list[TrialResult]:
    """Of these grasps, with little friction."""
    return [box_trial.run("box", X_OG, friction=0.15) for X_OG in GRASPS]


def test_swapped_fingers_are_the_same_grasp(box_trial: HandTrial, results) -> None:
    for X_OG, result in zip(GRASPS, results, strict=True):
        assert_same(result, box_trial.run("box", swap_fingers(X_OG), friction=0.15))


def test_turned_and_moved_world_is_the_same_world(make_scene, results) -> None:
    turned = HandTrial(
        make_scene(("box", 0.3, 0.2, 0.0)),
        make_station(X_WS=Pose((0.4, -0.1, 0.0), rpy_deg=(0.0, 0.0, 37.0))),
        engine=QUICK,
    )
    for X_OG, result in zip(GRASPS, results, strict=True):
        assert_same(result, turned.run("box", X_OG, friction=0.15))


def test_bystanders_do_not_change_a_trial_and_are_not_moved(make_scene, box_trial) -> None:
    crowded = HandTrial(
        make_scene(("box", 0.3, 0.2, 0.0), ("block", 0.55, 0.35, 20.0)),
        make_station(),
        engine=QUICK,
    )
    alone, watched = box_trial.run("box", CENTRE), crowded.run("box", CENTRE)
    assert watched.outcome is alone.outcome
    assert watched.margins.others_moved == 0.0
    np.testing.assert_allclose(margins(watched)[:5], margins(alone)[:5], atol=1e-4)


@pytest.mark.thorough
def test_neighbour_on_top_goes_up_with_the_target(make_scene) -> None:
    block = Instance(object="block", X_SO=Pose((0.3, 0.235, BOX[2])))
    trial = HandTrial(make_scene(("box", 0.3, 0.2, 0.0), block), make_station(), engine=QUICK)
    result = trial.run("box", from_above(0.05, y=-0.03), friction=0.8)
    assert result.outcome is Outcome.LIFTED_DISTURBED
    assert result.displacements == {"block": result.margins.others_moved}
    assert result.margins.others_moved == pytest.approx(0.30, abs=0.02)


def test_neighbours_in_the_way_of_a_finger_are_pushed_as_if_never_locked(make_scene) -> None:
    """The fingers centre the box against them, which pushes a row of two blocks."""
    scene = make_scene(
        ("box", 0.3, 0.2, 0.0),
        Instance(name="near", object="block", X_SO=Pose((0.357, 0.21, 0.0))),
        Instance(name="behind", object="block", X_SO=Pose((0.409, 0.215, 0.0))),
        Instance(name="far", object="block", X_SO=Pose((0.1, 0.35, 0.0))),
    )
    X_OG = from_above(0.065, x=0.006)
    lazy = HandTrial(scene, make_station(), engine=QUICK).run("box", X_OG)
    full = HandTrial(scene, make_station(), lock=False, engine=QUICK).run("box", X_OG)
    assert lazy.outcome is full.outcome is Outcome.LIFTED
    assert lazy.margins.others_moved > 0.002
    np.testing.assert_allclose(margins(lazy)[:6], margins(full)[:6], rtol=0.05, atol=1e-3)
    # What moves just as far as it may is not disturbed; what moves a little further is.
    for allowed, outcome in ((1.0, Outcome.LIFTED), (0.99, Outcome.LIFTED_DISTURBED)):
        settings = replace(DEFAULT_TRIAL, disturbance=allowed * lazy.margins.others_moved)
        trial = HandTrial(scene, make_station(), engine=QUICK, settings=settings)
        assert trial.run("box", X_OG).outcome is outcome


def test_clear_errors(box_trial: HandTrial) -> None:
    with pytest.raises(InvalidInputError, match="'mug' is not a free instance of scene 'test'"):
        box_trial.run("mug", CENTRE)
    with pytest.raises(InvalidInputError, match="X_OG has NaN"):
        box_trial.run("box", np.full((4, 4), np.nan))
