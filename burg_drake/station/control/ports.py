"""Names a diagram's ports, with and without drivers; `station.diagram` lists them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointIndex, ModelInstanceIndex
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import Demultiplexer

from burg_drake.core import InvalidInputError
from burg_drake.scene.document import Scene
from burg_drake.station.control.arm_driver import ArmDriver
from burg_drake.station.control.hand_driver import Fingers, HandDriver
from burg_drake.station.control.inverse_dynamics import make_inverse_dynamics
from burg_drake.station.control.measurements import ExternalTorque, HandMeasurement, WristForce
from burg_drake.station.control.plan_player import PlanPlayer
from burg_drake.station.document import Station
from burg_drake.station.world import inverse_dynamics, joint_actuators

Models = dict[str, ModelInstanceIndex]


@dataclass(frozen=True, eq=False)
class _Servo:
    """Where an arm takes positions and velocities (2 n) and torques in addition (n), and the
    torques that it makes of them (n)."""

    desired_state: InputPort
    feedforward: InputPort
    commanded: OutputPort


def export_ports(
    builder: RobotDiagramBuilder, station: Station, models: Models, *, controlled: bool
) -> None:
    """Exports what the servos take and the plant tells.

    Args:
        builder: of the diagram; its plant is finalized.
        station: has the arm's control.
        models: of the robot.
        controlled: add the arm's controller, if it has one beside the plant.
    """
    plant, system = builder.plant(), builder.builder()
    for role, model in models.items():
        desired_state = plant.get_desired_state_input_port(model)
        feedforward = plant.get_actuation_input_port(model)
        if role == "arm" and controlled:
            servo = _arm_servo(builder, station, models)
            desired_state, feedforward = servo.desired_state, servo.feedforward
        system.ExportInput(desired_state, f"{role}.desired_state")
        system.ExportInput(feedforward, f"{role}.feedforward")
        system.ExportOutput(plant.get_state_output_port(model), f"{role}.state")
        system.ExportOutput(plant.get_net_actuation_output_port(model), f"{role}.actuation")
    system.ExportInput(plant.get_applied_spatial_force_input_port(), "applied_forces")
    _export_plant(builder)


def export_driven_ports(
    builder: RobotDiagramBuilder, scene: Scene, station: Station, models: Models
) -> None:
    """Adds drivers of arm and hand, and exports what they take, and what the robot measures.

    Args:
        builder: of the diagram; its plant is finalized.
        scene, station: what plans have to be for.
        models: arm and hand.

    Raises:
        InvalidInputError: the arm's model has joints and actuators in different orders.
    """
    plant, system = builder.plant(), builder.builder()
    arm = station.document.arm
    assert arm is not None
    joints = _arm_joints(plant, station, models["arm"])
    player = PlanPlayer(joints, scene, station)
    servo = _arm_servo(builder, station, models)
    # Joint servos are part of a step, so that they are told what is wanted at its end.
    step = plant.time_step()
    ahead = 0.0 if inverse_dynamics(station) else step
    arm_driver = system.AddNamedSystem(
        "arm.driver", ArmDriver(joints, np.array(arm.home), step, ahead, player)
    )
    fingers = Fingers.of(plant, models["hand"], station.hand)
    hand_driver = system.AddNamedSystem(
        "hand.driver", HandDriver(plant, models["hand"], fingers, player)
    )
    system.Connect(arm_driver.GetOutputPort("command"), servo.desired_state)
    system.Connect(
        hand_driver.GetOutputPort("command"), plant.get_desired_state_input_port(models["hand"])
    )
    system.Connect(
        hand_driver.GetOutputPort("brake"), plant.get_applied_generalized_force_input_port()
    )
    hand_feedforward = plant.get_actuation_input_port(models["hand"])
    for role, driver, feedforward in (
        ("arm", arm_driver, servo.feedforward),
        ("hand", hand_driver, hand_feedforward),
    ):
        state = plant.get_state_output_port(models[role])
        system.Connect(state, driver.GetInputPort("state"))
        for name in ("position", "desired_state"):
            system.ExportInput(driver.GetInputPort(name), f"{role}.{name}")
        system.ExportInput(feedforward, f"{role}.feedforward")
        system.ExportOutput(state, f"{role}.state")
    system.ExportInput(hand_driver.GetInputPort("force_limit"), "hand.force_limit")
    for name in ("plan", "plan.start_time"):
        _share(system, name, arm_driver.GetInputPort(name), hand_driver.GetInputPort(name))

    _measure_arm(builder, models["arm"], arm_driver, servo)
    _measure_hand(builder, models["hand"], hand_driver, fingers)
    wrist = WristForce(_wrist(plant, station, models))
    system.AddNamedSystem("wrist.force", wrist)
    system.Connect(plant.get_reaction_forces_output_port(), wrist.get_input_port())
    system.ExportOutput(wrist.get_output_port(), "wrist.force_torque")
    system.ExportOutput(plant.get_reaction_forces_output_port(), "reaction_forces")
    _export_plant(builder)


def _arm_joints(
    plant: MultibodyPlant, station: Station, model: ModelInstanceIndex
) -> tuple[str, ...]:
    """Names of the arm's joints, which states and commands have in the same order."""
    commanded = [plant.get_joint_actuator(i).joint() for i in plant.GetJointActuatorIndices(model)]
    names = [joint.name() for joint in commanded]
    measured = [joint.name() for joint in sorted(commanded, key=lambda j: j.position_start())]
    if names != measured:
        raise InvalidInputError(
            f"{station.arm_model}: the actuators are in the order {', '.join(names)},"
            " which differs from that of the joints from base to hand; write them in the"
            f" order {', '.join(measured)}"
        )
    return tuple(names)


def _arm_servo(builder: RobotDiagramBuilder, station: Station, models: Models) -> _Servo:
    plant, arm = builder.plant(), models["arm"]
    if not inverse_dynamics(station):
        return _Servo(
            desired_state=plant.get_desired_state_input_port(arm),
            feedforward=plant.get_actuation_input_port(arm),
            commanded=plant.get_net_actuation_output_port(arm),
        )
    _arm_joints(plant, station, arm)
    system, actuators = builder.builder(), joint_actuators(plant, arm)
    control = make_inverse_dynamics(plant, station, models, actuators)
    system.AddNamedSystem("arm.control", control)
    system.Connect(plant.get_state_output_port(arm), control.GetInputPort("state"))
    system.Connect(control.get_output_port(), plant.get_actuation_input_port(arm))
    return _Servo(
        desired_state=control.GetInputPort("desired_state"),
        feedforward=control.GetInputPort("feedforward"),
        commanded=control.get_output_port(),
    )


def _measure_arm(
    builder: RobotDiagramBuilder, model: ModelInstanceIndex, driver: ArmDriver, servo: _Servo
) -> None:
    plant, system = builder.plant(), builder.builder()
    n = plant.num_velocities(model)
    commanded = system.AddNamedSystem("arm.commanded", Demultiplexer(2 * n, n))
    measured = system.AddNamedSystem("arm.measured", Demultiplexer(2 * n, n))
    state, torque = (
        plant.get_state_output_port(model),
        plant.get_net_actuation_output_port(model),
    )
    system.Connect(driver.GetOutputPort("command"), commanded.get_input_port())
    system.Connect(state, measured.get_input_port())
    external = system.AddNamedSystem("arm.external", ExternalTorque(plant, model))
    system.Connect(plant.get_state_output_port(), external.GetInputPort("state"))
    contact = plant.get_generalized_contact_forces_output_port(model)
    system.Connect(contact, external.GetInputPort("contact"))
    applied = plant.get_applied_spatial_force_input_port()
    _share(system, "applied_forces", applied, external.GetInputPort("applied_forces"))
    for name, port in (
        ("actuation", torque),
        ("position_commanded", commanded.get_output_port(0)),
        ("position_measured", measured.get_output_port(0)),
        ("velocity_estimated", measured.get_output_port(1)),
        ("estimated_state", state),
        ("torque_commanded", servo.commanded),
        ("torque_measured", torque),
        ("external_torque", external.get_output_port()),
    ):
        system.ExportOutput(port, f"arm.{name}")


def _measure_hand(
    builder: RobotDiagramBuilder, model: ModelInstanceIndex, driver: HandDriver, fingers: Fingers
) -> None:
    plant, system = builder.plant(), builder.builder()
    measurement = system.AddNamedSystem(
        "hand.measurement", HandMeasurement(plant.num_multibody_states(model), fingers)
    )
    for source, name in (
        (plant.get_state_output_port(model), "state"),
        (plant.get_net_actuation_output_port(model), "servos"),
        (driver.GetOutputPort("braked"), "braked"),
    ):
        system.Connect(source, measurement.GetInputPort(name))
    for name in ("actuation", "state_measured", "force_measured"):
        system.ExportOutput(measurement.GetOutputPort(name), f"hand.{name}")


def _wrist(plant: MultibodyPlant, station: Station, models: Models) -> JointIndex:
    """The weld between arm and hand."""
    hand = plant.GetBodyByName(station.hand.body, models["hand"])
    welds = [
        index
        for index in plant.GetJointIndices()
        if plant.get_joint(index).type_name() == "weld"
        and plant.get_joint(index).child_body().index() == hand.index()
    ]
    (weld,) = welds
    return weld


def _share(system: DiagramBuilder, name: str, first: InputPort, other: InputPort) -> None:
    """Exports one input for two systems."""
    system.ConnectInput(system.ExportInput(first, name), other)


def _export_plant(builder: RobotDiagramBuilder) -> None:
    plant, system = builder.plant(), builder.builder()
    system.ExportOutput(plant.get_state_output_port(), "state")
    system.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    system.ExportOutput(plant.get_body_poses_output_port(), "body_poses")
    system.ExportOutput(builder.scene_graph().get_query_output_port(), "geometry_query")
