"""The whole arm executes plans: beside the hand alone, statics, symmetries, what is in the way."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest
from arm_world import HOME, LIFT, make_arm_station, straight_plan, timed
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from trial_world import BOX_MASS, CENTRE, FORCE, GRAVITY, POST, QUICK, from_above

from burg_drake.core import Array, InvalidInputError, Outcome, Pose, make_pose, rotation_from_rpy
from burg_drake.motion import ArmLimits, Plan, PlanOrigin
from burg_drake.scene import Scene
from burg_drake.simulation import (
    ArmTrial,
    BodyContact,
    Execution,
    HandTrial,
    RobotContactWatch,
    TrialResult,
)
from burg_drake.station import DEFAULT_JOINT_STIFFNESS, GraspMotion, Obstacle, build_station_diagram
from tests.thorough import thorough

WHOLE = replace(QUICK, whole_trial=True)
SWAP = np.diag([-1.0, -1.0, 1.0, 1.0])
BESIDE = from_above(0.06, y=-0.03)
"""Off the middle of the box."""
SWEEP = 0.8
"""The base joint turns so far on the way to the grasp, in `sweeping` [rad]."""
IN_THE_WAY = (0.12, 0.0)
"""Where the forearm passes then [m]."""

MakeScene = Callable[..., Scene]


@pytest.fixture(scope="module")
def box_scene(make_scene: MakeScene) -> Scene:
    return make_scene(("box", 0.3, 0.2, 0.0))


@pytest.fixture(scope="module")
def arm_trial(box_scene: Scene) -> ArmTrial:
    """The box alone."""
    return ArmTrial(box_scene, make_arm_station(), engine=QUICK)


@pytest.fixture(scope="module")
def whole_trial(box_scene: Scene, arm_trial: ArmTrial) -> ArmTrial:
    """The same, never decided early."""
    clearance = arm_trial.clearance
    return ArmTrial(box_scene, make_arm_station(), engine=WHOLE, clearance=clearance)


@pytest.fixture(scope="module")
def hand_trial(box_scene: Scene) -> HandTrial:
    return HandTrial(box_scene, make_arm_station(), engine=QUICK)


@pytest.fixture(scope="module")
def crowd(make_scene: MakeScene) -> ArmTrial:
    """The box, and a post that the forearm sweeps away."""
    return ArmTrial(
        make_scene(("box", 0.3, 0.2, 0.0), ("post", *IN_THE_WAY, 0.0)),
        make_arm_station(),
        engine=QUICK,
    )


@pytest.fixture(scope="module")
def centred(arm_trial: ArmTrial) -> TrialResult:
    return execute(arm_trial, CENTRE)


@pytest.fixture(scope="module")
def beside(arm_trial: ArmTrial) -> TrialResult:
    return execute(arm_trial, BESIDE)


@pytest.fixture(scope="module")
def pushed(crowd: ArmTrial) -> TrialResult:
    """On the way to the box the post is swept away."""
    return crowd.run("box", CENTRE, sweeping(crowd))


def execute(trial: ArmTrial, X_OG: Array, **overrides: float) -> TrialResult:
    """Straight to a grasp of the box and straight up."""
    return trial.run("box", X_OG, straight_plan(trial, trial.X_WG("box", X_OG)), **overrides)


def sweeping(trial: ArmTrial) -> Plan:
    """To the middle of the box with a turn about the base, in place of the straight segment."""
    plan = straight_plan(trial, trial.X_WG("box", CENTRE))
    q = np.repeat(plan.approach.q[-1:], 5, axis=0)
    q[:, 0] -= np.linspace(SWEEP, 0.0, 5)
    return replace(plan, approach=timed(q, 1.5))


def exact(result: TrialResult) -> dict[str, str]:
    """All that a trial returns, to the bit."""
    moved = {f"moved {name}": value for name, value in result.displacements.items()}
    pushed = {f"pushed {name}": value for name, value in result.pushed.items()}
    numbers = asdict(result.margins) | moved | pushed
    words = {"outcome": str(result.outcome), "blocker": result.blocker, "touched": result.touched}
    return words | {name: float(value).hex() for name, value in numbers.items()}


# --- beside the hand alone ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("X_OG", "overrides"),
    [
        (CENTRE, {}),
        (from_above(0.066, y=0.01, yaw=0.1), {"friction": 0.02}),
        thorough(from_above(0.06, y=-0.03), {"mass": 0.9}),
        (from_above(0.16), {}),
        (from_above(0.03), {}),
    ],
    ids=["lifted", "slips", "heavier and off its centre", "above it", "collides"],
)
def test_ends_as_the_hand_alone_does(arm_trial, hand_trial, X_OG: Array, overrides) -> None:
    alone = hand_trial.run("box", X_OG, **overrides)
    result = execute(arm_trial, X_OG, **overrides)
    assert result.outcome is alone.outcome
    for name in ("overlap", "clearance"):
        assert getattr(result.margins, name) == getattr(alone.margins, name)
    if alone.outcome.held:
        assert result.margins.lift == pytest.approx(alone.margins.lift, abs=0.002)
        assert result.margins.slip == pytest.approx(alone.margins.slip, abs=0.002)
        assert result.margins.tilt == pytest.approx(alone.margins.tilt, abs=0.02)


@pytest.mark.thorough
def test_goes_back_and_then_up_as_the_hand_alone_does(
    arm_trial, whole_trial, box_scene: Scene
) -> None:
    motion = GraspMotion(retreat=0.1)
    hand = HandTrial(box_scene, make_arm_station(), engine=QUICK, motion=motion)
    tilted = from_above(0.07) @ make_pose(rotation_from_rpy((0.3, 0.0, 0.0)))  # about its closing
    alone = hand.run("box", tilted)
    plan = straight_plan(arm_trial, arm_trial.X_WG("box", tilted), retreat=motion.retreat)
    result = arm_trial.run("box", tilted, plan)
    assert result.outcome is alone.outcome is Outcome.LIFTED
    assert result.margins.lift == pytest.approx(0.1 + LIFT, abs=0.004)
    assert result.margins.lift == pytest.approx(alone.margins.lift, abs=0.002)
    assert result.margins.slip == pytest.approx(alone.margins.slip, abs=0.002)
    whole = whole_trial.run("box", tilted, plan)
    assert whole.outcome is result.outcome
    assert whole.margins.end_time > result.margins.end_time + 1.0  # which was decided on the way
    assert whole.margins.lift == pytest.approx(result.margins.lift, abs=0.001)
    assert whole.margins.slip == pytest.approx(result.margins.slip, abs=0.001)
    assert result.margins.tracking_error <= whole.margins.tracking_error < 0.004
    gap = replace(plan, retreat=replace(plan.retreat, q=plan.retreat.q + 0.1))
    with pytest.raises(
        InvalidInputError, match=r"retreat starts 0\.1 rad from the end of its approach"
    ):
        arm_trial.run("box", tilted, gap)


def test_margins_of_a_lift(centred: TrialResult) -> None:
    margins = centred.margins
    assert margins.pad_force == pytest.approx(FORCE, rel=0.01)
    assert margins.lift == pytest.approx(LIFT, abs=0.002)
    assert 0.0 < margins.tracking_error < 0.004
    assert 0.0 < margins.tracking_distance < 0.004
    assert margins.pushed == 0.0


def test_a_transfer_is_executed_and_looked_at_so_often_that_nothing_passes(
    box_scene: Scene, arm_trial: ArmTrial, centred, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From look to look of a fast transfer the hand moves by less than a small object's size."""
    trial = ArmTrial(
        box_scene, make_arm_station(), engine=QUICK, transfer=True, clearance=arm_trial.clearance
    )
    plan = straight_plan(trial, trial.X_WG("box", CENTRE))
    plan = replace(plan, transfer=timed(np.linspace(HOME, plan.approach.q[0], 5), 1.2))
    places: list[Array] = []
    advance = Execution.advance

    def watched(execution: Execution, steps: int | None = None) -> float:
        now = advance(execution, steps)
        if now <= plan.transfer.duration:
            plant_context = trial.diagram.plant.GetMyContextFromRoot(trial.context)
            places.append(trial.hand.X_WG(plant_context)[:3, 3])
        return now

    monkeypatch.setattr(Execution, "advance", watched)
    result = trial.run("box", CENTRE, plan)
    assert result.outcome is centred.outcome is Outcome.LIFTED
    assert result.margins.end_time - centred.margins.end_time == pytest.approx(1.2, abs=0.011)
    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert ways.sum() > 0.2
    assert ways.max() < 0.005
    assert ways.max() > 0.005 / round(trial.settings.poll / trial.diagram.engine.time_step)


# --- statics ------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_the_load_turns_the_joints_against_their_servos(whole_trial: ArmTrial) -> None:
    """Held at rest: stiffness times deviation balances the box's weight, by virtual work. On the
    way the lag is as large as `largest_lag` says."""
    trial = whole_trial
    plan = straight_plan(trial, trial.X_WG("box", CENTRE))
    for mass in (BOX_MASS, 1.5):
        result = trial.run("box", CENTRE, plan, friction=0.9, mass=mass)
        assert result.outcome is Outcome.LIFTED
        lag = largest_lag(trial, plan, mass)
        assert result.margins.tracking_distance == pytest.approx(lag, rel=0.1)
    plant = trial.diagram.plant
    context = plant.GetMyContextFromRoot(trial.context)
    box = plant.get_body(trial.diagram.free["box"])
    p_WCo = plant.EvalBodyPoseInWorld(context, box).multiply(box.default_com())
    X_WH = trial.hand.X_WH(context)
    p_HCo = X_WH[:3, :3].T @ (p_WCo - X_WH[:3, 3])
    world = plant.world_frame()
    J = plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, trial.hand.body.body_frame(), p_HCo, world, world
    )
    columns = [joint.velocity_start() for joint in trial.diagram.arm_joints]
    torque = DEFAULT_JOINT_STIFFNESS * (plan.lift.q[-1] - trial.hand.q(context))
    assert torque == pytest.approx(mass * GRAVITY * J[2, columns], abs=0.02)
    assert np.abs(torque).max() > 5.0
    actuation = trial.diagram.diagram.GetOutputPort("arm.actuation").Eval(trial.context)
    assert actuation == pytest.approx(torque, abs=0.05)


def largest_lag(trial: ArmTrial, plan: Plan, mass: float) -> float:
    """Rigid-body dynamics over stiffness: what the links' inertia and, on the way up, the box ask
    for turns the joints against their servos by as much [m]."""
    plant = trial.diagram.plant
    context, world = plant.CreateDefaultContext(), plant.world_frame()
    where = [joint.position_start() for joint in trial.diagram.arm_joints]
    moving = [joint.velocity_start() for joint in trial.diagram.arm_joints]
    p_HG, positions, lag = trial.hand.document.X_HG.translation, plant.GetPositions(context), 0.0
    for way, load in ((plan.approach, 0.0), (plan.lift, mass)):
        for q, a in zip(way.q[::20], way.a[::20], strict=True):
            positions[where] = q
            plant.SetPositions(context, positions)
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, trial.hand.body.body_frame(), p_HG, world, world
            )[:, moving]
            torque = plant.CalcMassMatrix(context)[np.ix_(moving, moving)] @ a
            torque += load * J.T @ (J @ a + [0.0, 0.0, GRAVITY])
            lag = max(lag, float(np.linalg.norm(J @ (torque / DEFAULT_JOINT_STIFFNESS))))
    return lag


def test_a_torque_is_limited(arm_trial: ArmTrial) -> None:
    """A jump of the command saturates the joints at Franka's limits; what they get accelerates the
    arm as the equations of motion say."""
    built = build_station_diagram(arm_trial.diagram.scene, arm_trial.diagram.station)
    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyContextFromRoot(context)
    home = np.array(built.station.document.arm.home)
    built.diagram.GetInputPort("arm.desired_state").FixValue(context, [*(home + 1.0), *np.zeros(7)])
    built.diagram.GetInputPort("hand.desired_state").FixValue(context, np.zeros(4))
    rows = [joint.velocity_start() for joint in built.arm_joints]
    M = built.plant.CalcMassMatrix(plant_context)
    Simulator(built.diagram, context).AdvanceTo(built.engine.time_step)
    torque = built.diagram.GetOutputPort("arm.actuation").Eval(context)
    assert torque == pytest.approx([87.0] * 4 + [12.0] * 3)
    v = built.plant.GetVelocities(plant_context)
    assert (M @ v)[rows] == pytest.approx(torque * built.engine.time_step, rel=0.01)


def test_feedforward_adds_to_the_servos(arm_trial: ArmTrial) -> None:
    """At rest the servos balance it: by stiffness times deviation."""
    built = build_station_diagram(arm_trial.diagram.scene, arm_trial.diagram.station)
    context = built.diagram.CreateDefaultContext()
    home = np.array(built.station.document.arm.home)
    extra = np.array([9.0, -6.0, 3.0, 5.0, -2.0, 2.0, 4.0])
    built.diagram.GetInputPort("arm.desired_state").FixValue(context, [*home, *np.zeros(7)])
    built.diagram.GetInputPort("arm.feedforward").FixValue(context, extra)
    built.diagram.GetInputPort("hand.desired_state").FixValue(context, np.zeros(4))
    Simulator(built.diagram, context).AdvanceTo(0.6)
    q = built.diagram.GetOutputPort("arm.state").Eval(context)[:7]
    assert DEFAULT_JOINT_STIFFNESS * (q - home) == pytest.approx(extra, abs=0.02)
    assert built.diagram.GetOutputPort("arm.actuation").Eval(context) == pytest.approx(
        0.0, abs=0.05
    )


# --- symmetries ---------------------------------------------------------------------------------


def test_swapped_fingers_make_no_difference(box_scene: Scene) -> None:
    """Up to the torques of the arm, which holds the hand in another posture, and may come to rest,
    by which a trial is decided, at another look."""
    trial = ArmTrial(box_scene, make_arm_station(), engine=WHOLE)
    beside = execute(trial, BESIDE)
    plan = straight_plan(trial, trial.X_WG("box", BESIDE) @ SWAP)
    other = trial.run("box", BESIDE, plan)
    assert beside.outcome is other.outcome is Outcome.LIFTED
    for name, tolerance in (("slip", 2e-4), ("tilt", 3e-3), ("lift", 5e-4), ("pad_force", 0.05)):
        first, second = getattr(beside.margins, name), getattr(other.margins, name)
        assert first == pytest.approx(second, abs=tolerance), name


def test_where_the_world_points_makes_no_difference(box_scene: Scene, beside: TrialResult) -> None:
    turned = ArmTrial(box_scene, make_arm_station(angle=0.65), engine=QUICK)
    other = execute(turned, BESIDE)
    assert beside.outcome is other.outcome is Outcome.LIFTED
    assert beside.margins.end_time == other.margins.end_time
    for name in ("slip", "tilt", "lift", "pad_force", "tracking_error", "tracking_distance"):
        first, second = getattr(beside.margins, name), getattr(other.margins, name)
        assert first == pytest.approx(second, rel=0.02, abs=2e-5), name


# --- what stands in the way ---------------------------------------------------------------------


def test_a_link_pushes_an_object_over(crowd: ArmTrial, pushed: TrialResult) -> None:
    result = pushed
    assert re.fullmatch(r"panda_link\d vs post", result.touched)
    assert result.pushed["post"] > 0.02
    assert result.margins.pushed == max(result.pushed.values())
    assert result.displacements["post"] >= result.pushed["post"]
    assert result.margins.others_moved == result.displacements["post"]
    assert result.outcome not in (Outcome.LIFTED, Outcome.BLOCKED)
    straight = execute(crowd, CENTRE)
    assert (straight.outcome, straight.touched) == (Outcome.LIFTED, "")
    assert straight.pushed == {"box": 0.0, "post": 0.0}


def test_a_link_is_stopped_by_what_is_fixed(box_scene: Scene) -> None:
    x, y = IN_THE_WAY
    pole = Obstacle(X_WB=Pose((x, y, POST[2] / 2)), size=POST)
    trial = ArmTrial(box_scene, make_arm_station(obstacles={"pole": pole}), engine=QUICK)
    result = trial.run("box", CENTRE, sweeping(trial))
    assert result.outcome is Outcome.BLOCKED
    assert re.fullmatch(r"panda_link\d vs pole", result.blocker)
    assert result.touched == result.blocker
    assert execute(trial, CENTRE).outcome is Outcome.LIFTED


@pytest.mark.thorough
def test_a_roof_stops_the_lift(box_scene: Scene) -> None:
    roof = Obstacle(X_WB=Pose((0.41, 0.2, 0.35)), size=(0.025, 0.1, 0.02))
    trial = ArmTrial(box_scene, make_arm_station(obstacles={"roof": roof}), engine=QUICK)
    result = execute(trial, CENTRE)
    assert result.outcome is Outcome.BLOCKED
    assert result.blocker.endswith("roof")
    assert 0.05 < result.margins.lift < 0.15


@pytest.mark.thorough
def test_what_is_fixed_is_met_while_the_target_is_held(box_scene: Scene) -> None:
    """The arm is told to turn about its base after the lift."""
    pole = Obstacle(X_WB=Pose((0.3, 0.35, 0.5)), size=(0.04, 0.04, 0.4))
    station = make_arm_station(obstacles={"pole": pole})
    trial = ArmTrial(box_scene, station, engine=WHOLE)
    plan = straight_plan(trial, trial.X_WG("box", CENTRE))
    execution = trial.begin("box", plan)
    assert (execution.approach(), execution.close(), execution.lift()) == (None, None, None)
    trial.world.command("arm", np.append(plan.lift.q[-1] + 0.2 * np.eye(7)[0], np.zeros(7)))
    assert execution.hold() is Outcome.BLOCKED
    assert execution.result(Outcome.BLOCKED).blocker.endswith("pole")


def test_what_the_hand_touches_at_the_grasp_and_after(crowd: ArmTrial) -> None:
    """It may touch target and table, and nothing else; a link may touch nothing at all."""
    diagram = crowd.complete_world.diagram
    bodies = {name: index for index, name in diagram.body_names.items()}
    finger, link = bodies["panda_leftfinger"], bodies["panda_link7"]
    free, table = diagram.free, diagram.table
    for one, other, arrived, touched in (
        (finger, free["box"], True, ""),
        (finger, table, True, ""),
        (finger, free["post"], True, "panda_leftfinger vs post"),
        (link, free["box"], True, "panda_link7 vs box"),
        (finger, free["box"], False, "panda_leftfinger vs box"),
    ):
        for pair in ((one, other), (other, one)):
            touches = RobotContactWatch(diagram, crowd.complete_world.hand.links, free["box"])
            assert touches.update([BodyContact(*pair, np.zeros(3))], arrived) == ""
            assert touches.first == touched


def test_a_finger_pushes_the_target_away(arm_trial: ArmTrial) -> None:
    """The hand comes from the side at the height of the grasp, and the finger ahead moves the box:
    by its way, less the gap that it begins with. It is 26 mm thick at its mount."""
    way, gap = 0.14, 0.14 - 0.04 - 0.026 - 0.03
    plan = straight_plan(arm_trial, arm_trial.X_WG("box", CENTRE))
    rows = [plan.approach.q[-1]]
    for x in np.linspace(0.0, -way, 8)[1:]:
        X_WG = arm_trial.X_WG("box", from_above(0.05, x=x))
        rows.insert(0, straight_plan(arm_trial, X_WG, rows[0]).approach.q[-1])
    assert np.abs(np.diff(rows, axis=0)).max() < 0.4
    result = arm_trial.run("box", CENTRE, replace(plan, approach=timed(np.array(rows), 2.0)))
    assert re.fullmatch(r"panda_(left|right)finger vs box", result.touched)
    assert result.pushed["box"] == pytest.approx(way - gap, abs=0.001)
    assert result.outcome is Outcome.CLOSED_EMPTY


def test_the_hand_is_stopped_by_the_table(arm_trial: ArmTrial) -> None:
    """On the way to a grasp in free air the fingertips are pushed into the table."""
    X_OG = from_above(0.05, y=0.12)
    plan = straight_plan(arm_trial, arm_trial.X_WG("box", X_OG))
    low = straight_plan(arm_trial, arm_trial.X_WG("box", from_above(-0.01, y=0.12))).approach.q[-1]
    q = plan.approach.q[-1]
    result = arm_trial.run("box", X_OG, replace(plan, approach=timed(np.array([q, low, q]), 2.0)))
    assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "table")
    assert result.touched in ("panda_leftfinger vs table", "panda_rightfinger vs table")


# --- the same bits ------------------------------------------------------------------------------


def test_the_same_bits_whatever_was_executed_before(crowd: ArmTrial, pushed: TrialResult) -> None:
    def slips(trial: ArmTrial) -> dict[str, str]:
        return exact(execute(trial, from_above(0.066, y=0.01), friction=0.02, mass=0.5))

    new = ArmTrial(crowd.diagram.scene, make_arm_station(), engine=QUICK)
    assert slips(new) == slips(crowd)
    assert exact(new.run("box", CENTRE, sweeping(new))) == exact(pushed)


def test_after_a_trial_that_failed(
    arm_trial: ArmTrial, centred: TrialResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The state turns into NaN in the middle of a trial, after which no more can be told."""
    advance = Execution.advance

    def corrupt(execution: Execution, steps: int | None = None) -> float:
        now = advance(execution, steps)
        if now > 1.0:
            state = arm_trial.context.get_mutable_discrete_state().get_mutable_vector()
            state.SetFromVector(np.full(state.size(), np.nan))
        return now

    with monkeypatch.context() as patch:
        patch.setattr(Execution, "advance", corrupt)
        failed = execute(arm_trial, CENTRE)
    assert failed.outcome is Outcome.SIMULATION_FAILED
    assert failed.reason
    assert exact(execute(arm_trial, CENTRE)) == exact(centred)


# --- plans that do not fit ----------------------------------------------------------------------


def test_a_plan_for_something_else_is_refused(arm_trial: ArmTrial) -> None:
    plan = straight_plan(arm_trial, arm_trial.X_WG("box", CENTRE))
    with pytest.raises(InvalidInputError, match=r"ends 20\.0 mm and 0\.0 degrees"):
        arm_trial.run("box", from_above(0.07), plan)
    later = replace(plan.lift, q=plan.lift.q + 0.1)
    with pytest.raises(
        InvalidInputError, match=r"lift starts 0\.1 rad from the end of its approach"
    ):
        arm_trial.run("box", CENTRE, replace(plan, lift=later))
    short = replace(plan.lift, q=plan.lift.q[:, :6], v=plan.lift.v[:, :6], a=plan.lift.a[:, :6])
    with pytest.raises(InvalidInputError, match=r"lift has 6 joints, but the arm .* has 7"):
        arm_trial.run("box", CENTRE, replace(plan, lift=short))
    scene, station = arm_trial.diagram.scene, arm_trial.diagram.station
    origin = PlanOrigin(
        joints=tuple(joint.name() for joint in arm_trial.diagram.arm_joints),
        limits=ArmLimits(*(np.full(7, limit) for limit in (-9.0, 9.0, 9.0, 9.0, 9.0, 9.0))),
        station=station.name,
        station_content=station.content,
        scene="elsewhere",
        scene_content="12ab",
        instance="box",
        X_WG=arm_trial.X_WG("box", CENTRE),
    )
    with pytest.raises(InvalidInputError) as error:
        arm_trial.run("box", CENTRE, replace(plan, origin=origin))
    assert str(error.value) == (
        f"the plan is for scene 'elsewhere' (content 12ab), not for {scene.name!r} (content"
        f" {scene.content[:12]}); plan its grasp here"
    )


def test_a_station_without_an_arm_is_refused(box_scene: Scene) -> None:
    station = make_arm_station()
    without = replace(station, document=replace(station.document, arm=None), arm_model=None)
    with pytest.raises(InvalidInputError, match="has no arm"):
        ArmTrial(box_scene, without)


def test_the_box_weighs_what_the_tests_say(box_scene: Scene) -> None:
    assert box_scene.entry("box").mass_properties.mass == pytest.approx(BOX_MASS)
