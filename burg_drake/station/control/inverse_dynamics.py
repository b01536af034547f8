"""The inverse-dynamics controller of an arm, with torque limits."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator, ModelInstanceIndex, MultibodyForces
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from burg_drake.core import Array, InvalidInputError
from burg_drake.station.document import Station
from burg_drake.station.world import add_models


class InverseDynamicsControl(LeafSystem):
    """Computes torques from a model of the arm: M(q) a + C(q, v) v - g(q), with the acceleration
    a = kp (q_d - q) + kd (v_d - v); adds a feedforward, and keeps within limits.

    That is Drake's `InverseDynamicsController` without an integral: it has no state, so that a
    simulation can go back to an earlier moment.

    Ports:
        desired_state: (2 n) positions and velocities.
        state: (2 n) where the arm is.
        feedforward: (n) torques in addition; nothing if not connected.
        torque: (n) [Nm] (output).
    """

    def __init__(self, model: MultibodyPlant, kp: Array, kd: Array, limits: Array) -> None:
        """Declares the ports.

        Args:
            model: the arm, finalized.
            kp, kd: (n,) gains [1/s^2, 1/s].
            limits: (n,) of the torques, in both directions [Nm]; infinite without one.
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
    models: dict[str, ModelInstanceIndex],
    actuators: list[JointActuator],
) -> InverseDynamicsControl:
    """The controller of a station's arm.

    Args:
        plant: finalized, with arm and hand.
        station: its arm has the gains.
        models: arm and hand.
        actuators: of the arm's joints, in their order.

    Raises:
        InvalidInputError: gains that do not fit the arm, or are too stiff for the time step.
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
    return InverseDynamicsControl(controller_plant(plant, station, models), kp, kd, limits)


def controller_plant(
    plant: MultibodyPlant, station: Station, models: dict[str, ModelInstanceIndex]
) -> MultibodyPlant:
    """The arm alone; its flange carries the open hand's mass and inertia.

    Args:
        plant: finalized, with arm and hand.
        station: where they are from.
        models: arm and hand.
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
