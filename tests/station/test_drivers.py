"""Commands and measurements of the driven robot: statics, virtual work, finite differences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, Pose, UnknownNameError
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import (
    Arm,
    MountedHand,
    Obstacle,
    Station,
    StationDiagram,
    build_station_diagram,
    load_station,
)
from tests.thorough import thorough

BLOCK = 0.04
"""Width of a fixed block between the pads at home [m]."""
OFF = 0.3
"""A posture beside home [rad]."""


@pytest.fixture(scope="module")
def empty() -> Scene:
    library = load_scene("tabletop_six").library
    return Scene(SceneDocument(name="empty", library="household"), library, Path("empty.yaml"))


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def free(empty: Scene, station: Station) -> StationDiagram:
    """Nothing to touch."""
    return build_station_diagram(empty, station, drivers=True)


@pytest.fixture(scope="module")
def blocked(empty: Scene, station: Station, free: StationDiagram) -> StationDiagram:
    """A fixed block between the pads."""
    X_WG = MountedHand(free).X_WG(free.plant.CreateDefaultContext())
    block = Obstacle(X_WB=Pose.from_matrix(X_WG, quaternion=True), size=(BLOCK, 0.1, 0.06))
    document = replace(station.document, background={"block": block})
    return build_station_diagram(empty, replace(station, document=document), drivers=True)


class Run:
    """A simulation with commands."""

    def __init__(self, built: StationDiagram, **commands: object) -> None:
        self.built = built
        self.context = built.diagram.CreateDefaultContext()
        self.simulator = Simulator(built.diagram, self.context)
        self.give(**commands)

    def give(self, **commands: object) -> None:
        """Fixes inputs; `arm__position` is the port `arm.position`."""
        for name, value in commands.items():
            port = self.built.diagram.GetInputPort(name.replace("__", "."))
            port.FixValue(self.context, value)

    def to(self, time: float) -> Run:
        self.simulator.AdvanceTo(time)
        return self

    def read(self, port: str) -> Array:
        return np.asarray(self.built.diagram.GetOutputPort(port).Eval(self.context))

    @property
    def plant_context(self) -> Context:
        return self.built.plant.GetMyMutableContextFromRoot(self.context)


def home(built: StationDiagram) -> Array:
    arm = built.station.document.arm
    assert arm is not None
    return np.array(arm.home)


# --- commands -----------------------------------------------------------------------------------


def test_without_a_command_the_robot_stays_where_it_is(free: StationDiagram) -> None:
    """Wherever that is: not at home, and with a half open hand."""
    run = Run(free)
    MountedHand(free).place(run.plant_context, home(free) + OFF, closed=0.5)
    run.to(0.2)
    assert run.read("arm.position_measured") == pytest.approx(home(free) + OFF, abs=1e-9)
    assert run.read("arm.position_commanded") == pytest.approx(home(free) + OFF, abs=1e-12)
    assert run.read("hand.state_measured") == pytest.approx([0.04, 0.0], abs=1e-9)


def test_a_position_that_moves_is_followed_at_its_speed(free: StationDiagram) -> None:
    """Without the velocity that goes with it the joints would lag by kd / kp, 0.05 s of their way,
    which is 20 mrad here."""
    step, speed = free.engine.time_step, 0.4
    run = Run(free, arm__position=home(free))
    run.simulator.Initialize()
    way = np.zeros(7)
    for k in range(200):
        way[6] = speed * step * min(k, 150)
        run.give(arm__position=home(free) + way)
        before = run.read("arm.position_measured")
        run.to((k + 1) * step)
        difference = (run.read("arm.position_measured") - before) / step
        assert run.read("arm.velocity_estimated") == pytest.approx(difference, abs=1e-9)
        if k == 149:
            assert run.read("arm.velocity_estimated")[6] == pytest.approx(speed, rel=0.01)
            assert abs(run.read("arm.position_measured") - home(free) - way).max() < 1e-3
    run.to(0.8)
    assert run.read("arm.position_measured") == pytest.approx(home(free) + way, abs=1e-5)
    state = run.read("arm.estimated_state")
    assert state[:7] == pytest.approx(run.read("arm.position_measured"), abs=0.0)
    assert state == pytest.approx(run.read("arm.state"), abs=0.0)


def test_the_desired_state_goes_to_the_servos_as_it_is(free: StationDiagram) -> None:
    """A driven arm follows it bit by bit as one without drivers does."""
    plain = build_station_diagram(free.scene, free.station)
    wanted = np.concatenate([home(free) + 0.1, np.full(7, 0.2)])
    runs = []
    for built in (plain, free):
        run = Run(built, arm__desired_state=wanted, hand__desired_state=[0, 0, -0.02, -0.02])
        runs.append(run.to(0.1))
    for port in ("arm.state", "hand.state", "arm.actuation", "hand.actuation"):
        assert runs[0].read(port).tolist() == runs[1].read(port).tolist(), port


@pytest.mark.parametrize("reference", ["panda_tabletop", thorough("panda_wsg")])
def test_the_hand_goes_to_a_distance(empty: Scene, reference: str) -> None:
    free = build_station_diagram(empty, load_station(reference), drivers=True)
    hand = free.station.hand
    run = Run(free, hand__position=[0.03])
    before = between_fingers(free, run)
    run.to(0.25)
    distance, rate = run.read("hand.state_measured")
    assert rate == pytest.approx(-2.0 * hand.closing_speed, rel=1e-3)
    assert distance == pytest.approx(hand.opening[1] - 0.25 * 2.0 * hand.closing_speed, abs=1e-3)
    run.to(1.0)
    assert run.read("hand.state_measured") == pytest.approx([0.03, 0.0], abs=1e-5)
    closer = before - between_fingers(free, run)
    assert closer == pytest.approx(hand.opening[1] - 0.03, abs=1e-5)
    # At rest it presses nothing, whatever the limit is, in every step.
    run.give(hand__position=[0.0301], hand__force_limit=[1.0])
    run.to(1.5)
    for k in range(100):
        run.to(1.5 + k * free.engine.time_step)
        assert run.read("hand.force_measured") == pytest.approx(0.0, abs=0.01)
        assert run.read("hand.actuation") == pytest.approx([0.0, 0.0], abs=0.01)
    run.give(hand__position=[0.08])
    assert run.to(3.0).read("hand.state_measured") == pytest.approx([0.08, 0.0], abs=1e-5)


def between_fingers(built: StationDiagram, run: Run) -> float:
    """Distance between the origins of the two fingers [m]."""
    left, right = (
        built.plant.EvalBodyPoseInWorld(run.plant_context, built.plant.get_body(finger))
        for finger in MountedHand(built).fingers
    )
    return float(np.linalg.norm(left.translation() - right.translation()))


# --- measurements -------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [thorough(4.0), 40.0])
def test_the_pads_press_with_the_limit(blocked: StationDiagram, limit: float) -> None:
    """What they press with is what the contact says; and they got there at full speed."""
    run = Run(blocked, hand__position=[0.0], hand__force_limit=[limit])
    run.to(0.3)
    speed = blocked.station.hand.closing_speed
    assert run.read("hand.state_measured")[1] == pytest.approx(-2.0 * speed, rel=1e-3)
    assert run.read("hand.force_measured") == pytest.approx(0.0, abs=0.05)
    run.to(1.0)
    port = blocked.diagram.GetOutputPort("contact_results")
    results = port.Eval(run.context)
    pressing = []
    for i in range(results.num_hydroelastic_contacts()):
        force = results.hydroelastic_contact_info(i).F_Ac_W().translational()
        pressing.append(float(np.linalg.norm(force)))
    assert len(pressing) == 2
    assert pressing == pytest.approx([limit, limit], rel=0.01)
    assert run.read("hand.force_measured") == pytest.approx(limit, rel=0.01)
    assert run.read("hand.state_measured")[1] == pytest.approx(0.0, abs=2e-4)


def test_an_applied_force_is_felt_in_joints_and_wrist(free: StationDiagram) -> None:
    """Virtual work of a force at a point of the hand, by finite differences of where the point is;
    and its moment about the hand's origin."""
    F_W, tau_W, p_HP = np.array([3.0, -5.0, 8.0]), np.array([0.4, 0.2, -0.3]), (0.02, 0.03, 0.1)
    hand = MountedHand(free)
    force = ExternallyAppliedSpatialForce()
    force.body_index, force.p_BoBq_B = hand.body.index(), np.array(p_HP)
    force.F_Bq_W = SpatialForce(tau_W, F_W)
    run = Run(free, arm__position=home(free), applied_forces=[force]).to(1.0)
    q = run.read("arm.position_measured")

    def X_WP(q: Array) -> RigidTransform:
        hand.set_arm(context, q)
        return RigidTransform(hand.X_WH(context)).multiply(RigidTransform(np.array(p_HP)))

    context, expected, h = free.plant.CreateDefaultContext(), [], 1e-5
    for axis in np.eye(7):
        ahead, back = X_WP(q + h * axis), X_WP(q - h * axis)
        turn = ahead.rotation().multiply(back.rotation().inverse()).ToAngleAxis()
        moved = ahead.translation() - back.translation()
        work = F_W @ moved + tau_W @ (turn.angle() * turn.axis())
        expected.append(work / (2.0 * h))
    assert np.abs(expected).max() > 2.0
    assert run.read("arm.external_torque") == pytest.approx(expected, abs=1e-3)
    # The servos hold against it.
    assert run.read("arm.torque_measured") == pytest.approx(-np.array(expected), abs=0.02)

    R_HW = hand.X_WH(run.plant_context)[:3, :3].T
    moment = R_HW @ tau_W + np.cross(p_HP, R_HW @ F_W)
    assert run.read("wrist.force_torque") == pytest.approx([*moment, *(R_HW @ F_W)], abs=0.02)
    joint = next(
        j
        for j in map(free.plant.get_joint, free.plant.GetJointIndices())
        if j.type_name() == "weld" and j.child_body().index() == hand.body.index()
    )
    reactions = free.diagram.GetOutputPort("reaction_forces").Eval(run.context)
    assert reactions[int(joint.index())].translational() == pytest.approx(-R_HW @ F_W, abs=0.02)


# --- bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("commands", "message"),
    [
        (
            {"arm__position": np.zeros(7), "arm__desired_state": np.zeros(14)},
            "^ports arm.position and arm.desired_state are both connected; connect one of them$",
        ),
        (
            {"hand__position": [0.1], "hand__desired_state": np.zeros(4)},
            "^ports hand.position and hand.desired_state are both connected; connect one",
        ),
        (
            {"hand__position": [40.0]},
            "^hand.position is 40 m; the pads of 'panda_hand' can be 0 to ",
        ),
        ({"hand__force_limit": [70.0]}, r"^hand.force_limit is 70 N; give more than 0 and at most"),
        ({"hand__force_limit": [0.0]}, r"^hand.force_limit is 0 N; give more than 0"),
        (
            {"arm__position": [0, 0, 0, -1, 0, 1, np.nan]},
            r"^arm.position asks panda_joint7 for nan rad and .* rad/s; give finite numbers$",
        ),
        (
            {"hand__desired_state": [0, 0, np.nan, 0]},
            r"^hand.desired_state asks for finger speeds of \[nan",
        ),
        ({"plan": [1, 2]}, "^port 'plan' got a list; give a burg_drake Plan$"),
    ],
)
def test_commands_that_cannot_be_followed(
    free: StationDiagram, commands: dict[str, object], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Run(free, **commands).to(0.01)


def test_wrong_sizes_and_unknown_cameras(free: StationDiagram) -> None:
    with pytest.raises(RuntimeError, match=r"size=7 for input port 'arm.position' .* size=6"):
        Run(free, arm__position=np.zeros(6))
    with pytest.raises(UnknownNameError, match="no camera 'boards'; did you mean 'board'"):
        build_station_diagram(free.scene, free.station, cameras=["boards"])
    with pytest.raises(InvalidInputError, match="drivers need robot='arm'"):
        build_station_diagram(free.scene, free.station, robot="hand", drivers=True)


LINK = """<link name="{0}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>
<axis xyz="0 0 1"/><limit effort="5" lower="-1" upper="1" velocity="1"/></joint>"""
DRIVE = """<transmission><type>transmission_interface/SimpleTransmission</type>
<joint name="{0}"/><actuator name="{0}_drive"/></transmission>"""


def test_an_arm_with_actuators_in_another_order(empty: Scene, tmp_path: Path) -> None:
    """States and commands would not belong together."""
    parts = [LINK.format(name) for name in ("base", "upper", "fore")]
    parts += [JOINT.format("elbow", "upper", "fore"), JOINT.format("shoulder", "base", "upper")]
    parts += [DRIVE.format(name) for name in ("elbow", "shoulder")]
    model = tmp_path / "arm.urdf"
    model.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    station = load_station("panda_tabletop")
    X_WA = Pose((0.0, 0.0, 0.5))
    arm = Arm(base="base", flange="fore", X_FH=Pose(), home=(0.0, 0.0), X_WA=X_WA)
    document = replace(station.document, arm=arm)
    with pytest.raises(
        InvalidInputError,
        match=r"arm.urdf: .* elbow, shoulder,.* shoulder, elbow$",
    ):
        build_station_diagram(
            empty, replace(station, document=document, arm_model=model), drivers=True
        )
