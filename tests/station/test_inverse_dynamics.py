"""The inverse-dynamics controller: beside Drake's own, statics of its weight, limits, tracking."""

from __future__ import annotations

import gc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import InverseDynamicsController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from burg_drake.core import DocumentError, InvalidInputError, load_document
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import (
    DEFAULT_ACCELERATION_GAIN,
    ArmControl,
    Station,
    StationDiagram,
    StationDocument,
    build_station_diagram,
    load_station,
    make_controller_plant,
)
from tests.thorough import thorough

GRAVITY = 9.81
LIMITS = np.array([87.0] * 4 + [12.0] * 3)
"""Torques of a Panda [Nm]."""


@pytest.fixture(scope="module")
def empty() -> Scene:
    library = load_scene("tabletop_six").library
    return Scene(SceneDocument(name="empty", library="household"), library, Path("empty.yaml"))


def with_control(control: ArmControl, reference: str = "panda_tabletop") -> Station:
    station = load_station(reference)
    assert station.document.arm is not None
    arm = replace(station.document.arm, control=control)
    return replace(station, document=replace(station.document, arm=arm))


@pytest.fixture(scope="module")
def built(empty: Scene) -> StationDiagram:
    station = with_control(ArmControl(kind="inverse_dynamics"))
    found = build_station_diagram(empty, station, drivers=True)
    gc.collect()  # the controller's own plant lives on
    return found


def test_at_rest_the_torque_carries_the_weight(built: StationDiagram) -> None:
    """Of every body, by virtual work; the arm does not sag."""
    context = built.diagram.CreateDefaultContext()
    simulator = Simulator(built.diagram, context)
    home = built.diagram.GetOutputPort("arm.position_measured").Eval(context).copy()
    simulator.AdvanceTo(0.3)
    q = built.diagram.GetOutputPort("arm.position_measured").Eval(context)
    assert q == pytest.approx(home, abs=1e-6)
    plant, world = built.plant, built.plant.world_frame()
    plant_context = plant.GetMyContextFromRoot(context)
    columns = [joint.velocity_start() for joint in built.arm_joints]
    weight, mass = np.zeros(7), 0.0
    for body in map(plant.get_body, built.robot_bodies):
        J = plant.CalcJacobianTranslationalVelocity(
            plant_context,
            JacobianWrtVariable.kV,
            body.body_frame(),
            body.default_com(),
            world,
            world,
        )
        weight += body.default_mass() * GRAVITY * J[2, columns]
        mass += body.default_mass() if "hand" in body.name() or "finger" in body.name() else 0.0
    assert np.abs(weight).max() > 15.0
    for port in ("arm.torque_commanded", "arm.torque_measured"):
        assert built.diagram.GetOutputPort(port).Eval(context) == pytest.approx(weight, abs=1e-3)
    # The hand points down: all of its weight hangs on the wrist along its z axis.
    force = built.diagram.GetOutputPort("wrist.force_torque").Eval(context)[3:]
    assert force == pytest.approx([0.0, 0.0, mass * GRAVITY], abs=1e-2)


def test_torques_are_those_of_drakes_controller(built: StationDiagram) -> None:
    """In any state, for any desired one, as long as limits do not matter."""
    models = {name: built.plant.GetModelInstanceByName(name) for name in ("arm", "hand")}
    plant = make_controller_plant(built.plant, built.station, models)
    kp = np.full(7, DEFAULT_ACCELERATION_GAIN)
    theirs = InverseDynamicsController(plant, kp, np.zeros(7), 2.0 * np.sqrt(kp), False)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, v = rng.uniform(-1.0, 1.0, (2, 7))
        wanted = np.concatenate([q, v]) + rng.uniform(-2e-3, 2e-3, 14)
        context = built.diagram.CreateDefaultContext()
        plant_context = built.plant.GetMyMutableContextFromRoot(context)
        built.plant.SetPositions(plant_context, models["arm"], q)
        built.plant.SetVelocities(plant_context, models["arm"], v)
        built.diagram.GetInputPort("arm.desired_state").FixValue(context, wanted)
        ours = built.diagram.GetOutputPort("arm.torque_commanded").Eval(context)
        their_context = theirs.CreateDefaultContext()
        theirs.get_input_port_estimated_state().FixValue(their_context, np.concatenate([q, v]))
        theirs.get_input_port_desired_state().FixValue(their_context, wanted)
        torque = theirs.get_output_port_control().Eval(their_context)
        assert ours == pytest.approx(np.clip(torque, -LIMITS, LIMITS), abs=1e-9)
        assert (np.abs(torque[:4]) < LIMITS[:4]).any()


@pytest.mark.parametrize("reference", ["panda_tabletop", thorough("ur5e_tabletop")])
def test_tracking_error_is_the_acceleration_over_the_gain(empty: Scene, reference: str) -> None:
    """What the controller does not know of a motion is its acceleration: as a driven oscillator it
    lags by no more than that over kp, and half a step of its speed."""
    station = with_control(ArmControl(kind="inverse_dynamics"), reference)
    built = build_station_diagram(empty, station, drivers=True)
    arm = station.document.arm
    assert arm is not None
    home = np.array(arm.home)
    way = np.linspace(0.3, -0.4, len(home))
    t = np.linspace(0.0, 1.0, 101)
    s = t**3 * (10 - 15 * t + 6 * t**2)
    path = PiecewisePolynomial.CubicShapePreserving(t, home[:, None] + way[:, None] * s, True)
    builder = DiagramBuilder()
    builder.AddSystem(built.diagram)
    source = builder.AddSystem(TrajectorySource(path, output_derivative_order=1))
    builder.Connect(source.get_output_port(), built.diagram.GetInputPort("arm.desired_state"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = built.diagram.GetMyContextFromRoot(simulator.get_context())
    bound = 5.78 * np.abs(
        way
    ) / DEFAULT_ACCELERATION_GAIN + 0.5 * built.engine.time_step * 1.88 * abs(way)
    errors = []
    for time in np.arange(0.02, 1.2, 0.02):
        simulator.AdvanceTo(time)
        q = built.diagram.GetOutputPort("arm.position_measured").Eval(context)
        errors.append(np.abs(q - path.value(min(time, 1.0))[:, 0]))
    assert (np.max(errors, axis=0) <= 1.1 * bound + 1e-5).all()
    assert np.max(errors) > 0.3 * bound.max()
    assert errors[-1] == pytest.approx(0.0, abs=1e-5)


def test_torques_and_feedforward_are_limited(built: StationDiagram) -> None:
    context = built.diagram.CreateDefaultContext()
    home = built.diagram.GetOutputPort("arm.position_measured").Eval(context)
    built.diagram.GetInputPort("arm.position").FixValue(context, home)
    before = built.diagram.GetOutputPort("arm.torque_commanded").Eval(context).copy()
    extra = np.array([5.0, -5.0, 500.0, 5.0, 1.0, -500.0, 1.0])
    built.diagram.GetInputPort("arm.feedforward").FixValue(context, extra)
    torque = built.diagram.GetOutputPort("arm.torque_commanded").Eval(context)
    expected = np.clip(before + extra, -LIMITS, LIMITS)
    assert expected[[2, 5]].tolist() == [87.0, -12.0]
    assert torque == pytest.approx(expected, abs=1e-9)
    Simulator(built.diagram, context).AdvanceTo(built.engine.time_step)
    measured = built.diagram.GetOutputPort("arm.torque_measured").Eval(context)
    assert measured == pytest.approx(expected, abs=1e-9)


@pytest.mark.thorough
def test_gains_of_joint_servos(empty: Scene) -> None:
    """A torque turns each joint by itself over its stiffness."""
    kp, torque = np.array([400.0, 500, 600, 700, 800, 900, 1000]), np.full(7, 3.0)
    control = ArmControl(kp=tuple(kp.tolist()), kd=(40.0,))
    built = build_station_diagram(empty, with_control(control), drivers=True)
    context = built.diagram.CreateDefaultContext()
    home = built.diagram.GetOutputPort("arm.position_measured").Eval(context).copy()
    built.diagram.GetInputPort("arm.feedforward").FixValue(context, torque)
    built.diagram.GetInputPort("arm.position").FixValue(context, home)
    Simulator(built.diagram, context).AdvanceTo(1.5)
    q = built.diagram.GetOutputPort("arm.position_measured").Eval(context)
    assert q - home == pytest.approx(torque / kp, rel=0.01)


def test_documents(tmp_path: Path) -> None:
    """The default leaves a station's hash as it was."""
    station = load_station("panda_tabletop")
    assert with_control(ArmControl()).content == station.content
    assert with_control(ArmControl(kind="inverse_dynamics")).content != station.content
    text = (
        "version: 1\nname: mine\narm:\n  home: [0]\n  control: {kind: inverse_dynamics, kp: [%s]}\n"
    )
    path = tmp_path / "station.yaml"
    path.write_text(text % "900")
    arm = load_document(path, StationDocument).arm
    assert arm is not None and arm.control == ArmControl(kind="inverse_dynamics", kp=(900.0,))
    path.write_text(text % "-1")
    with pytest.raises(DocumentError, match=r"station.yaml:5: .*kp \[-1.0\] must be"):
        load_document(path, StationDocument)


@pytest.mark.parametrize(
    ("control", "message"),
    [
        (ArmControl(kp=(1.0, 2.0)), r"yaml: arm.control.kp has 2 numbers; give one, or one for ea"),
        (
            ArmControl(kind="inverse_dynamics", kd=(600.0,)),
            "arm.control.kd of 600 1/s is too stiff for time steps of 2 ms; give less than",
        ),
        (
            ArmControl(kind="inverse_dynamics", kp=(9e5,), kd=(10.0,)),
            (
                r"arm.control.kp of 900000 1/s\^2 is too stiff for time steps of 2 ms; give"
                r" less than 250000"
            ),
        ),
    ],
)
def test_gains_that_do_not_fit(empty: Scene, control: ArmControl, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        build_station_diagram(empty, with_control(control))
