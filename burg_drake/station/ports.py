"""Ports of a station diagram: commands of arm and hand, their controllers and measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import JointActuator, JointIndex, ModelInstanceIndex, MultibodyForces
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
)
from pydrake.systems.primitives import Demultiplexer

from burg_drake.core import Array, InvalidInputError
from burg_drake.scene import Scene
from burg_drake.station.drivers import ArmDriver, Fingers, HandDriver, PlanPlayer
from burg_drake.station.model_file import add_models
from burg_drake.station.robot import RobotModels, has_inverse_dynamics, joint_actuators
from burg_drake.station.station_document import Station


class ExternalTorque(LeafSystem):
    """External torques on a model's joints: generalized forces of contacts and applied forces on
    the model and everything that it carries. Positive in the joint's direction.

    Ports:
        state: state of the whole plant.
        contact: (n) generalized contact forces of the model.
        applied_forces: list of ExternallyAppliedSpatialForce; none if not connected.
        torque: (n) joint torques [Nm] (output).
    """

    def __init__(self, plant: MultibodyPlant, model: ModelInstanceIndex) -> None:
        """Declares the ports; `plant` is finalized."""
        super().__init__()
        self._plant, self._model = plant, model
        self._context = plant.CreateDefaultContext()
        n = plant.num_velocities(model)
        self._state = self.DeclareVectorInputPort("state", plant.num_multibody_states())
        self._contact = self.DeclareVectorInputPort("contact", n)
        self._applied = self.DeclareAbstractInputPort(
            "applied_forces", Value[list[ExternallyAppliedSpatialForce]]()
        )
        self.DeclareVectorOutputPort("torque", n, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        torque = self._contact.Eval(context)
        applied = self._applied.Eval(context) if self._applied.HasValue(context) else []
        if applied:
            plant = self._plant
            plant.SetPositionsAndVelocities(self._context, self._state.Eval(context))
            forces = MultibodyForces(plant)
            for force in applied:
                body = plant.get_body(force.body_index)
                R_WB = plant.EvalBodyPoseInWorld(self._context, body).rotation()
                body.AddInForce(
                    context=self._context,
                    p_BP_E=R_WB @ force.p_BoBq_B,
                    F_Bp_E=force.F_Bq_W,
                    frame_E=plant.world_frame(),
                    forces=forces,
                )
            all_torques = plant.CalcGeneralizedForces(self._context, forces)
            torque = torque + plant.GetVelocitiesFromArray(self._model, all_torques)
        output.SetFromVector(torque)


class WristForce(LeafSystem):
    """The force that the hand, including its contacts and held objects, exerts on the arm.

    Ports:
        reaction_forces: reaction forces of the plant.
        force_torque: (6) torque [Nm], then force [N], about the hand's origin, in its frame H, as
            Drake orders a spatial force (output).
    """

    def __init__(self, joint: JointIndex) -> None:
        """Declares the ports; `joint` welds the hand to the arm, with H as its child frame."""
        super().__init__()
        self._joint = int(joint)
        self._reactions = self.DeclareAbstractInputPort(
            "reaction_forces", Value[list[SpatialForce]]()
        )
        self.DeclareVectorOutputPort("force_torque", 6, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        on_hand = self._reactions.Eval(context)[self._joint]
        output.SetFromVector(0.0 - on_hand.get_coeffs())


class HandMeasurement(LeafSystem):
    """Distance between the pads and force of the fingers.

    Ports:
        state: (2 k) state of the hand's model.
        servos: (2) net actuation of the fingers [N].
        braked: (2) brake force of `HandDriver` on the fingers [N].
        state_measured: (2) distance between the pads [m] and its rate [m/s] (output).
        force_measured: (1) mean force of the fingers, positive as they close [N] (output).
        actuation: (2) sum of servos and brake [N] (output).
    """

    def __init__(self, state_size: int, fingers: Fingers) -> None:
        """Declares the ports; `state_size` is the size of the hand's state."""
        super().__init__()
        self._fingers = fingers
        self._state = self.DeclareVectorInputPort("state", state_size)
        self._servos = self.DeclareVectorInputPort("servos", 2)
        self._braked = self.DeclareVectorInputPort("braked", 2)
        state, force = {self._state.ticket()}, {self._servos.ticket(), self._braked.ticket()}
        self.DeclareVectorOutputPort("state_measured", 2, self._calc_state, state)
        self.DeclareVectorOutputPort("force_measured", 1, self._calc_force, force)
        self.DeclareVectorOutputPort("actuation", 2, self._calc_actuation, force)

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        state, fingers = self._state.Eval(context), self._fingers
        rate = (
            fingers.distance(fingers.closed + state[fingers.rate_index]) - fingers.hand.opening[0]
        )
        output.SetFromVector([fingers.distance(state[fingers.position_index]), rate])

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        total = self._servos.Eval(context) + self._braked.Eval(context)
        output.SetFromVector([float((total * self._fingers.closing_signs).mean())])

    def _calc_actuation(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._servos.Eval(context) + self._braked.Eval(context))


class InverseDynamicsControl(LeafSystem):
    """Computes torques from a model of the arm: M(q) a + C(q, v) v - g(q), with the acceleration a
    = kp (q_d - q) + kd (v_d - v); adds a feedforward, and saturates at the limits.

    Equals Drake's `InverseDynamicsController` without an integral: it has no state, so a simulation
    can return to an earlier time.

    Ports:
        desired_state: (2 n) positions and velocities.
        state: (2 n) positions and velocities of the arm.
        feedforward: (n) additional torques; 0 if not connected.
        torque: (n) joint torques [Nm] (output).
    """

    def __init__(self, model: MultibodyPlant, kp: Array, kd: Array, limits: Array) -> None:
        """Declares the ports.

        Args:
            model: the arm, finalized.
            kp, kd: (n,) gains [1/s^2, 1/s].
            limits: (n,) torque limits in both directions [Nm]; infinite for none.
        """
        super().__init__()
        n = len(limits)
        self._model, self._context = model, model.CreateDefaultContext()
        self._kp, self._kd, self._limits = kp, kd, limits
        self._desired_state = self.DeclareVectorInputPort("desired_state", 2 * n)
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        self._feedforward = self.DeclareVectorInputPort("feedforward", n)
        self.DeclareVectorOutputPort("torque", n, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        model, state = self._model, self._state.Eval(context)
        q, v = np.split(self._desired_state.Eval(context) - state, 2)
        model.SetPositionsAndVelocities(self._context, state)
        forces = MultibodyForces(model)
        model.CalcForceElementsContribution(self._context, forces)
        torque = model.CalcInverseDynamics(self._context, self._kp * q + self._kd * v, forces)
        if self._feedforward.HasValue(context):
            torque = torque + self._feedforward.Eval(context)
        output.SetFromVector(np.clip(torque, -self._limits, self._limits))


def make_inverse_dynamics(
    plant: MultibodyPlant,
    station: Station,
    models: RobotModels,
    actuators: list[JointActuator],
) -> InverseDynamicsControl:
    """The controller of a station's arm.

    Args:
        plant: a finalized plant with arm and hand.
        station: station whose arm has the gains.
        models: models of arm and hand.
        actuators: actuators of the arm's joints, in order.

    Raises:
        InvalidInputError: the gains do not fit the arm, or are too stiff for the time step.
    """
    arm = station.document.arm
    assert arm is not None
    where, step = f"{station.path}: arm.control", plant.time_step()
    kp, kd = arm.control.gains(len(actuators), where)
    if max(kd) * step >= 1.0:
        raise InvalidInputError(
            f"{where}.kd of {max(kd):g} 1/s is too stiff for time steps of {1e3 * step:g}"
            f" ms; give less than {1.0 / step:g}. If kd is not given, it is twice the"
            " square root of kp"
        )
    if max(kp) * step**2 >= 1.0:
        raise InvalidInputError(
            f"{where}.kp of {max(kp):g} 1/s^2 is too stiff for time steps of "
            f"{1e3 * step:g} ms; give less than {1.0 / step**2:g}"
        )
    limits = np.array([actuator.effort_limit() for actuator in actuators])
    return InverseDynamicsControl(make_controller_plant(plant, station, models), kp, kd, limits)


def make_controller_plant(
    plant: MultibodyPlant, station: Station, models: RobotModels
) -> MultibodyPlant:
    """The arm alone; its flange carries the open hand's mass and inertia.

    Args:
        plant: a finalized plant with arm and hand.
        station: their station.
        models: models of arm and hand.
    """
    arm = station.document.arm
    assert arm is not None
    hand = plant.GetBodyByName(station.hand.body, models["hand"])
    # In the default context the hand is open.
    inertia = plant.CalcSpatialInertia(
        plant.CreateDefaultContext(), hand.body_frame(), plant.GetBodyIndices(models["hand"])
    )
    model = MultibodyPlant(time_step=0.0)
    assert station.arm_model is not None
    (own,) = add_models(Parser(model), station.arm_model, station.packages)
    base, flange = (model.GetFrameByName(name, own) for name in (arm.base, arm.flange))
    model.WeldFrames(model.world_frame(), base, RigidTransform(arm.X_WA.matrix()))
    body = model.AddRigidBody("hand", own, inertia)
    model.WeldFrames(flange, body.body_frame(), RigidTransform(arm.X_FH.matrix()))
    model.mutable_gravity_field().set_gravity_vector(plant.gravity_field().gravity_vector())
    model.Finalize()
    return model


@dataclass(frozen=True, eq=False)
class _Servo:
    """Ports of an arm's servo: desired positions and velocities (2 n), feedforward torques (n), and
    commanded torques (n)."""

    desired_state: InputPort
    feedforward: InputPort
    commanded: OutputPort


def export_ports(
    builder: RobotDiagramBuilder, station: Station, models: RobotModels, *, controlled: bool
) -> None:
    """Exports the servos' inputs and the plant's outputs.

    Args:
        builder: builder of the diagram; its plant is finalized.
        station: station with the arm's control.
        models: models of the robot.
        controlled: add the arm's controller, if it is not part of the plant.
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
    _export_plant_outputs(builder)


def export_driven_ports(
    builder: RobotDiagramBuilder, scene: Scene, station: Station, models: RobotModels
) -> None:
    """Adds drivers of arm and hand, and exports their inputs and the robot's measurements.

    Args:
        builder: builder of the diagram; its plant is finalized.
        scene, station: scene and station of the plans.
        models: models of arm and hand.

    Raises:
        InvalidInputError: the arm's model has joints and actuators in different orders.
    """
    plant, system = builder.plant(), builder.builder()
    arm = station.document.arm
    assert arm is not None
    joints = _arm_joints(plant, station, models["arm"])
    player = PlanPlayer(joints, scene, station)
    servo = _arm_servo(builder, station, models)
    # Joint servos are part of a step, so their command is the state desired at its end.
    step = plant.time_step()
    ahead = 0.0 if has_inverse_dynamics(station) else step
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
        _export_shared_input(
            system, name, arm_driver.GetInputPort(name), hand_driver.GetInputPort(name)
        )

    _measure_arm(builder, models["arm"], arm_driver, servo)
    _measure_hand(builder, models["hand"], hand_driver, fingers)
    wrist = WristForce(_wrist_joint(plant, station, models))
    system.AddNamedSystem("wrist.force", wrist)
    system.Connect(plant.get_reaction_forces_output_port(), wrist.get_input_port())
    system.ExportOutput(wrist.get_output_port(), "wrist.force_torque")
    system.ExportOutput(plant.get_reaction_forces_output_port(), "reaction_forces")
    _export_plant_outputs(builder)


def _arm_joints(
    plant: MultibodyPlant, station: Station, model: ModelInstanceIndex
) -> tuple[str, ...]:
    """Names of the arm's joints; requires the same order in states and commands."""
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


def _arm_servo(builder: RobotDiagramBuilder, station: Station, models: RobotModels) -> _Servo:
    plant, arm = builder.plant(), models["arm"]
    if not has_inverse_dynamics(station):
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
    state, torque = (plant.get_state_output_port(model), plant.get_net_actuation_output_port(model))
    system.Connect(driver.GetOutputPort("command"), commanded.get_input_port())
    system.Connect(state, measured.get_input_port())
    external = system.AddNamedSystem("arm.external", ExternalTorque(plant, model))
    system.Connect(plant.get_state_output_port(), external.GetInputPort("state"))
    contact = plant.get_generalized_contact_forces_output_port(model)
    system.Connect(contact, external.GetInputPort("contact"))
    applied = plant.get_applied_spatial_force_input_port()
    _export_shared_input(system, "applied_forces", applied, external.GetInputPort("applied_forces"))
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


def _wrist_joint(plant: MultibodyPlant, station: Station, models: RobotModels) -> JointIndex:
    """The weld between arm and hand."""
    hand = plant.GetBodyByName(station.hand.body, models["hand"])
    joints = map(plant.get_joint, plant.GetJointIndices())
    welds = [joint for joint in joints if joint.type_name() == "weld"]
    (weld,) = (joint.index() for joint in welds if joint.child_body().index() == hand.index())
    return weld


def _export_shared_input(
    system: DiagramBuilder, name: str, first: InputPort, other: InputPort
) -> None:
    """Exports one input for two systems."""
    system.ConnectInput(system.ExportInput(first, name), other)


def _export_plant_outputs(builder: RobotDiagramBuilder) -> None:
    plant, system = builder.plant(), builder.builder()
    system.ExportOutput(plant.get_state_output_port(), "state")
    system.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    system.ExportOutput(plant.get_body_poses_output_port(), "body_poses")
    system.ExportOutput(builder.scene_graph().get_query_output_port(), "geometry_query")
