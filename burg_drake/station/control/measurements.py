"""What a robot measures: external torque, force and torque at the wrist, state of its hand.

All of it is computed when it is asked for, from the last step of the simulation.
"""

from __future__ import annotations

from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import JointIndex, ModelInstanceIndex, MultibodyForces
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from burg_drake.station.control.hand_driver import Fingers


class ExternalTorque(LeafSystem):
    """What the world does to a model's joints: contacts and applied forces on it and all that it
    carries, as generalized forces. Positive pushes a joint forward.

    Ports:
        state: of the whole plant.
        contact: (n) generalized contact forces of the model.
        applied_forces: list of ExternallyAppliedSpatialForce; none if not connected.
        torque: (n) [Nm] (output).
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
                plant.get_body(force.body_index).AddInForce(
                    context=self._context,
                    p_BP_E=plant.EvalBodyPoseInWorld(
                        self._context, plant.get_body(force.body_index)
                    ).rotation()
                    @ force.p_BoBq_B,
                    F_Bp_E=force.F_Bq_W,
                    frame_E=plant.world_frame(),
                    forces=forces,
                )
            all_torques = plant.CalcGeneralizedForces(self._context, forces)
            torque = torque + plant.GetVelocitiesFromArray(self._model, all_torques)
        output.SetFromVector(torque)


class WristForce(LeafSystem):
    """The force that the hand, with all that it holds and touches, exerts on the arm.

    Ports:
        reaction_forces: of the plant.
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
        state: (2 k) of the hand's model.
        servos: (2) net actuation of the fingers [N].
        braked: (2) what `HandDriver` added to it [N].
        state_measured: (2) distance between the pads [m] and its rate [m/s] (output).
        force_measured: (1) mean force of the fingers, positive as they close [N] (output).
        actuation: (2) sum of servos and brake [N] (output).
    """

    def __init__(self, states: int, fingers: Fingers) -> None:
        """Declares the ports; `states` is the size of the hand's state."""
        super().__init__()
        self._fingers = fingers
        self._state = self.DeclareVectorInputPort("state", states)
        self._servos = self.DeclareVectorInputPort("servos", 2)
        self._braked = self.DeclareVectorInputPort("braked", 2)
        state, force = {self._state.ticket()}, {self._servos.ticket(), self._braked.ticket()}
        self.DeclareVectorOutputPort("state_measured", 2, self._calc_state, state)
        self.DeclareVectorOutputPort("force_measured", 1, self._calc_force, force)
        self.DeclareVectorOutputPort("actuation", 2, self._calc_actuation, force)

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        state, fingers = self._state.Eval(context), self._fingers
        rate = fingers.distance(fingers.closed + state[fingers.v]) - fingers.hand.opening[0]
        output.SetFromVector([fingers.distance(state[fingers.q]), rate])

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        total = self._servos.Eval(context) + self._braked.Eval(context)
        output.SetFromVector([float((total * self._fingers.towards_closed).mean())])

    def _calc_actuation(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._servos.Eval(context) + self._braked.Eval(context))
