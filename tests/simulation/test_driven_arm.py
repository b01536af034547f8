"""A driven arm that holds and lifts things: what it feels of them, and plans that it plays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from arm_world import HOME, LIFT, make_arm_station, straight_plan
from pydrake.math import RigidTransform
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from trial_world import BOX_MASS, CENTRE, FORCE, GRAVITY

from burg_drake.core import Array, InvalidInputError, Outcome
from burg_drake.motion import ArmLimits, Plan, PlanOrigin, Reach, Trajectory
from burg_drake.scene import Scene
from burg_drake.simulation import ArmTrial
from burg_drake.station import (
    ENGINES,
    ArmControl,
    MountedHand,
    Station,
    StationDiagram,
    build_station_diagram,
)
from tests.thorough import thorough

MakeScene = Callable[..., Scene]
ASIDE, BELOW = 0.015, 0.02
"""Where the box's middle is, from between the pads: across the closing direction, and along the
approach [m]."""


@pytest.fixture(scope="module")
def scene(make_scene: MakeScene) -> Scene:
    return make_scene(("box", 0.3, 0.2, 0.0))


@pytest.fixture(scope="module")
def station() -> Station:
    return make_arm_station()


@pytest.fixture(scope="module")
def built(scene: Scene, station: Station) -> StationDiagram:
    return build_station_diagram(scene, station, drivers=True)


@pytest.fixture(scope="module")
def plan(scene: Scene, station: Station) -> Plan:
    """To the box, up with it; for this scene and station."""
    trial = ArmTrial(scene, station)
    found = straight_plan(trial, trial.X_WG("box", CENTRE))
    joints = tuple(joint.name() for joint in trial.diagram.arm_joints)
    ones = np.ones(7)
    limits = ArmLimits(-3.0 * ones, 3.0 * ones, ones, ones, ones, ones)
    origin = PlanOrigin(
        joints, limits, station.name, station.content, scene.name, scene.content, "box", np.eye(4)
    )
    return replace(found, close_time=0.6, opening=0.08, origin=origin)


@pytest.mark.parametrize("limit", [FORCE, 20.0])
def test_a_held_box_hangs_on_wrist_and_joints(built: StationDiagram, limit: float) -> None:
    """Its weight and lever arm at the wrist, and by virtual work in every joint."""
    context = built.diagram.CreateDefaultContext()
    plant, hand = built.plant, MountedHand(built)
    plant_context = plant.GetMyMutableContextFromRoot(context)
    hand.place(plant_context, np.array(HOME), closed=0.24)
    box = plant.get_body(built.free["box"])
    X_GO = np.eye(4)
    X_GO[:3, :3] = np.diag([1.0, -1.0, -1.0])
    X_GO[:3, 3] = (0.0, ASIDE, BELOW + 0.04)
    X_WO = RigidTransform(hand.X_WG(plant_context) @ X_GO)
    plant.SetFreeBodyPose(plant_context, box, X_WO)
    built.diagram.GetInputPort("hand.position").FixValue(context, [0.0])
    built.diagram.GetInputPort("hand.force_limit").FixValue(context, [limit])
    Simulator(built.diagram, context).AdvanceTo(0.6)

    p_WCo = plant.EvalBodyPoseInWorld(plant_context, box).multiply(box.default_com())
    assert p_WCo == pytest.approx(X_WO.multiply(box.default_com()), abs=5e-3)
    weight_W = np.array([0.0, 0.0, -BOX_MASS * GRAVITY])
    X_WH = hand.X_WH(plant_context)
    p_HCo, weight_H = X_WH[:3, :3].T @ (p_WCo - X_WH[:3, 3]), X_WH[:3, :3].T @ weight_W
    wrist = built.diagram.GetOutputPort("wrist.force_torque").Eval(context)
    assert wrist[3:] == pytest.approx(weight_H, abs=0.01 * BOX_MASS * GRAVITY)
    moment = np.cross(p_HCo, weight_H)
    assert np.linalg.norm(moment) == pytest.approx(BOX_MASS * GRAVITY * ASIDE, rel=0.1)
    assert wrist[:3] == pytest.approx(moment, abs=0.01 * np.linalg.norm(moment))

    world = plant.world_frame()
    J = plant.CalcJacobianTranslationalVelocity(
        plant_context, JacobianWrtVariable.kV, hand.body.body_frame(), p_HCo, world, world
    )
    columns = [joint.velocity_start() for joint in built.arm_joints]
    expected = weight_W @ J[:, columns]
    assert np.abs(expected).max() > 1.0
    torque = built.diagram.GetOutputPort("arm.external_torque").Eval(context)
    assert torque == pytest.approx(expected, abs=0.01 * np.abs(expected).max())
    force = built.diagram.GetOutputPort("hand.force_measured").Eval(context)
    assert force == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize(("kind", "lag"), [("impedance", 2e-3), thorough("inverse_dynamics", 4e-3)])
def test_a_plan_is_played_and_lifts_the_box(
    scene: Scene, station: Station, plan: Plan, kind: str, lag: float
) -> None:
    """From its start time on; with a phase that this project does not know, in between."""
    arm = replace(station.document.arm, control=ArmControl(kind=kind))  # type: ignore[arg-type, type-var]
    controlled = replace(station, document=replace(station.document, arm=arm))
    built = build_station_diagram(scene, controlled, drivers=True, engine=ENGINES["screening"])
    start, phases = 0.3, dict(plan.phases)
    pause = replace(phases["close"], t=phases["close"].t / 4.0)
    phases = {"transfer": phases["transfer"], "pause": _at(pause, plan.transfer), **phases}

    class Longer:
        """A plan of another make."""

        opening, origin = 0.07, None

        def __init__(self) -> None:
            self.phases = phases

        def require_for(self, scene: Scene, station: Station) -> None:
            raise AssertionError("nobody knows")

    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyContextFromRoot(context)
    built.diagram.GetInputPort("plan").FixValue(context, Longer())
    built.diagram.GetInputPort("plan.start_time").FixValue(context, [start])
    simulator = Simulator(built.diagram, context)
    simulator.AdvanceTo(start)
    assert built.diagram.GetOutputPort("arm.position_measured").Eval(context) == pytest.approx(HOME)
    distance = []
    for name, phase in phases.items():
        for part in (0.25, 0.5, 0.75, 1.0):
            simulator.AdvanceTo(start + part * phase.duration)
            q = built.diagram.GetOutputPort("arm.position_measured").Eval(context)
            assert q == pytest.approx(phase.at(part * phase.duration), abs=lag), (name, part)
        start += phase.duration
        distance.append(built.diagram.GetOutputPort("hand.state_measured").Eval(context)[0])
    assert distance[:3] == pytest.approx([0.07] * 3, abs=1e-4)
    assert distance[3:] == pytest.approx([0.06] * 2, abs=1e-3)
    simulator.AdvanceTo(start + 0.1)
    box = built.plant.get_body(built.free["box"])
    height = built.plant.EvalBodyPoseInWorld(plant_context, box).translation()[2]
    assert height == pytest.approx(LIFT, abs=2e-3)


def _at(pause: Trajectory, transfer: Trajectory) -> Trajectory:
    """A pause where a motion ends."""
    return replace(pause, q=np.repeat(transfer.q[-1:], len(pause.t), axis=0))


def test_a_plan_takes_over_from_positions(built: StationDiagram, plan: Plan) -> None:
    """When it begins: for the arm at home, for the hand wherever that is."""
    context = built.diagram.CreateDefaultContext()
    for name, value in (
        ("plan", plan),
        ("plan.start_time", [0.1]),
        ("arm.position", HOME),
        ("hand.position", [0.06]),
    ):
        built.diagram.GetInputPort(name).FixValue(context, value)

    def read(name: str) -> Array:
        return np.asarray(built.diagram.GetOutputPort(name).Eval(context))

    simulator = Simulator(built.diagram, context)
    simulator.AdvanceTo(0.1 - built.engine.time_step)
    assert read("arm.position_commanded").tolist() == list(HOME)
    closer = read("hand.state_measured")[0]
    assert closer < 0.075
    simulator.AdvanceTo(0.5)
    # The command is what is wanted at the end of the next step.
    wanted = plan.transfer.at(0.4 + built.engine.time_step)
    assert read("arm.position_commanded") == pytest.approx(wanted, abs=1e-6)
    assert read("hand.state_measured")[0] == pytest.approx(0.08, abs=1e-4)


def test_plans_that_cannot_be_played(built: StationDiagram, plan: Plan) -> None:
    origin = plan.origin
    assert origin is not None

    def message(plan: object, start: float = 0.0) -> str:
        context = built.diagram.CreateDefaultContext()
        built.diagram.GetInputPort("plan").FixValue(context, plan)
        built.diagram.GetInputPort("plan.start_time").FixValue(context, [start])
        with pytest.raises(InvalidInputError) as error:
            Simulator(built.diagram, context).AdvanceTo(0.01)
        return str(error.value)

    other = replace(origin, joints=tuple(f"elbow{i}" for i in range(7)))
    assert message(replace(plan, origin=other)) == (
        "the plan moves the joints elbow0, elbow1, elbow2, elbow3, elbow4, elbow5, elbow6; the arm"
        " of station 'test' has panda_joint1, panda_joint2, panda_joint3, panda_joint4,"
        " panda_joint5, panda_joint6, panda_joint7"
    )
    other = replace(origin, scene="kitchen", scene_content="1")
    assert "the plan is for scene 'kitchen' (content 1), not for 'test' (content" in message(
        replace(plan, origin=other)
    )
    other = replace(origin, station_content="1")
    assert "the plan is for station as it was before a change (content 1), not for" in message(
        replace(plan, origin=other)
    )
    assert "port 'plan' got a Trajectory; give a burg_drake Plan" in message(plan.lift)
    no = Reach(Outcome.NO_IK)
    assert "port 'plan' got a Reach (no_ik); give a burg_drake Plan" in message(no)
    six = replace(plan.transfer, q=plan.transfer.q[:, :6], v=plan.transfer.v[:, :6])
    assert "the plan's transfer moves 6 joints; the arm has 7" in message(
        replace(plan, transfer=six, origin=None)
    )
    away = replace(plan.lift, q=plan.lift.q + 0.01)
    assert "the plan's lift begins 0.01 rad from where its close ends" in message(
        replace(plan, lift=away)
    )
    assert "rad away from the present one; bring the arm to the start of the plan" in message(
        plan, start=-1.0
    )
    assert message(plan, start=np.nan).startswith("plan.start_time is nan; give the time")
    assert "the plan's opening is 0.2 m; the pads of 'panda_hand' can be 0 to 0.08 m" in message(
        replace(plan, opening=0.2)
    )


@pytest.mark.thorough
def test_trials_follow_an_inverse_dynamics_controller(
    scene: Scene, station: Station, plan: Plan
) -> None:
    """One after the other with the same bits, and within its tracking error."""
    arm = replace(station.document.arm, control=ArmControl(kind="inverse_dynamics"))  # type: ignore[type-var]
    controlled = replace(station, document=replace(station.document, arm=arm))
    assert plan.origin is not None
    plan = replace(plan, origin=replace(plan.origin, station_content=controlled.content))
    trial = ArmTrial(scene, controlled)
    first = trial.run("box", CENTRE, plan)
    assert first.outcome == "lifted"
    assert first.margins.tracking_error < 5e-3
    assert trial.run("box", CENTRE, plan) == first
