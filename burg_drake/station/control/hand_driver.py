"""The hand's driver: opens, closes and limits the force of a parallel hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, State

from burg_drake.core import Array, InvalidInputError
from burg_drake.station.control.plan_player import PlannedCommand, PlanPlayer
from burg_drake.station.document import Hand
from burg_drake.station.world import STALL

FOLLOWING = 50.0
"""Speed of a finger over its distance from where it is to be [1/s]."""
SLACK = 1e-3
"""A wanted distance between the pads may be so far beyond those of the hand [m]."""


@dataclass(frozen=True, eq=False)
class Fingers:
    """The two fingers in the order of their actuators.

    Attributes:
        hand: the document.
        q, v: where they are in the hand's positions, and in its positions and velocities.
        dofs: where they are among all velocities of the plant.
        closed, open: (2,) positions [m].
    """

    hand: Hand
    q: Array
    v: Array
    dofs: Array
    closed: Array
    open: Array

    @classmethod
    def of(cls, plant: MultibodyPlant, model: ModelInstanceIndex, hand: Hand) -> Fingers:
        """Finds them in a finalized plant."""
        actuators = map(plant.get_joint_actuator, plant.GetJointActuatorIndices(model))
        joints = [actuator.joint() for actuator in actuators]
        by_name = {finger.joint: finger for finger in hand.fingers}
        fingers = [by_name[joint.name()] for joint in joints]
        positions = plant.GetPositionsFromArray(model, np.arange(plant.num_positions()))
        velocities = plant.GetVelocitiesFromArray(model, np.arange(plant.num_velocities()))
        q = [int(np.flatnonzero(positions == j.position_start())[0]) for j in joints]
        v = [int(np.flatnonzero(velocities == j.velocity_start())[0]) for j in joints]
        return cls(
            hand=hand,
            q=np.array(q),
            v=len(positions) + np.array(v),
            dofs=np.array([joint.velocity_start() for joint in joints]),
            closed=np.array([finger.closed for finger in fingers]),
            open=np.array([finger.open for finger in fingers]),
        )

    @property
    def towards_closed(self) -> Array:
        """(2,) signs of the joints' velocities while the hand closes."""
        return np.sign(self.closed - self.open)

    def at(self, distance: float) -> Array:
        """(2,) positions with the pads at a distance [m]."""
        low, high = self.hand.opening
        return self.closed + (distance - low) / (high - low) * (self.open - self.closed)

    def distance(self, q: Array) -> float:
        """Distance between the pads [m] at positions (2,)."""
        low, high = self.hand.opening
        share = (q - self.closed) / (self.open - self.closed)
        return float(low + share.mean() * (high - low))


@dataclass(frozen=True, eq=False)
class _FingerCommand:
    """Positions that the fingers go to, (2,) [m], and with which velocities now, (2,) [m/s]."""

    q: Array
    v: Array


class HandDriver(LeafSystem):
    """Follows a plan that has begun, else a distance between the pads or a desired state; without
    any of them it holds what was commanded last.

    The fingers' servos follow a velocity with the document's force at most. A limit below that is
    kept by a force against the motion that makes up the difference, and that the servos are told
    of: free fingers are as fast as without it, and what they press on feels the limit.

    Ports:
        position: (1) distance between the pads [m].
        force_limit: (1) force of each pad [N], the document's if not connected.
        desired_state: (4) as the servos take it; they follow its velocities.
        plan, plan.start_time: see `PlanPlayer`; the time [s] is 0 if not connected.
        state: (2 k) of the hand's model.
        command: (4) for the servos (output).
        brake: (v) generalized force on the whole plant that limits the fingers' (output).
        braked: (2) what of it acted in the last step [N] (output).
    """

    def __init__(
        self, plant: MultibodyPlant, model: ModelInstanceIndex, fingers: Fingers, player: PlanPlayer
    ) -> None:
        """Declares ports, state and events; the arguments are those of the diagram."""
        super().__init__()
        hand = fingers.hand
        self._fingers, self._player, self._size = fingers, player, plant.num_velocities()
        self._damping = STALL * hand.force / hand.closing_speed
        self._position = self.DeclareVectorInputPort("position", 1)
        self._force_limit = self.DeclareVectorInputPort("force_limit", 1)
        self._desired_state = self.DeclareVectorInputPort("desired_state", 4)
        self._plan = self.DeclareAbstractInputPort("plan", Value[object]())
        self._start = self.DeclareVectorInputPort("plan.start_time", 1)
        self._state = self.DeclareVectorInputPort("state", plant.num_multibody_states(model))
        # Where the fingers are held, and the brake of the last step.
        self._held = self.DeclareDiscreteState(fingers.open)
        self._braked = self.DeclareDiscreteState(np.zeros(2))
        self.DeclareInitializationDiscreteUpdateEvent(self._begin)
        # A discrete update would come after the plant's step, which is an unrestricted one, and
        # would remember the brake of the step to come.
        self.DeclarePeriodicUnrestrictedUpdateEvent(plant.time_step(), 0.0, self._remember)
        self.DeclareVectorOutputPort("command", 4, self._calc_command)
        self._brake = self.DeclareVectorOutputPort("brake", self._size, self._calc_brake)
        self.DeclareStateOutputPort("braked", self._braked)

    def _begin(self, context: Context, values: DiscreteValues) -> None:
        values.set_value(self._held, self._state.Eval(context)[self._fingers.q])
        values.set_value(self._braked, np.zeros(2))

    def _remember(self, context: Context, state: State) -> None:
        values = state.get_mutable_discrete_state()
        wanted = self._finger_command(context)
        values.set_value(self._held, wanted.q)
        values.set_value(self._braked, self._brake.Eval(context)[self._fingers.dofs])

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        wanted = self._finger_command(context)
        eased = wanted.v - self._against(context, wanted.v) / self._damping
        output.SetFromVector([*wanted.q, *eased])

    def _calc_brake(self, context: Context, output: BasicVector) -> None:
        brake = np.zeros(self._size)
        brake[self._fingers.dofs] = self._against(context, self._finger_command(context).v)
        output.SetFromVector(brake)

    def _against(self, context: Context, speed: Array) -> Array:
        """(2,) force against the motion that is wanted [N]."""
        most = self._fingers.hand.force
        limit = most
        if self._force_limit.HasValue(context):
            limit = float(self._force_limit.Eval(context)[0])
            if not 0.0 < limit <= most:
                raise InvalidInputError(
                    f"hand.force_limit is {limit:g} N; give more than 0 and at most the"
                    f" {most:g} N of {self._fingers.hand.name!r}"
                )
        return np.asarray(-np.sign(speed) * (most - limit))

    def _finger_command(self, context: Context) -> _FingerCommand:
        position, desired_state = (
            port.HasValue(context) for port in (self._position, self._desired_state)
        )
        if position and desired_state:
            raise InvalidInputError(
                "ports hand.position and hand.desired_state are both connected; connect one of them"
            )
        fingers, fastest = self._fingers, self._fingers.hand.closing_speed
        q, planned = self._state.Eval(context)[self._fingers.q], self._planned(context)
        if planned is not None and planned.closed:
            return _FingerCommand(fingers.closed, fingers.towards_closed * fastest)
        if planned is None and desired_state:
            speeds = self._desired_state.Eval(context)[2:]
            if not np.isfinite(speeds).all():
                raise InvalidInputError(
                    f"hand.desired_state asks for finger speeds of {speeds.tolist()} m/s;"
                    " give finite numbers"
                )
            return _FingerCommand(q, speeds)
        goal = context.get_discrete_state(self._held).value()
        if planned is not None:
            goal = fingers.at(self._distance(planned.opening, "the plan's opening"))
        elif position:
            wanted = float(self._position.Eval(context)[0])
            goal = fingers.at(self._distance(wanted, "hand.position"))
        return _FingerCommand(goal, np.clip(FOLLOWING * (goal - q), -fastest, fastest))

    def _planned(self, context: Context) -> PlannedCommand | None:
        """What the plan wants now; None without one, and before it starts."""
        if not self._plan.HasValue(context):
            return None
        start = self._start.Eval(context)[0] if self._start.HasValue(context) else 0.0
        return self._player.command(self._plan.Eval(context), context.get_time() - start)

    def _distance(self, wanted: float, source: str) -> float:
        low, high = self._fingers.hand.opening
        if not low - SLACK <= wanted <= high + SLACK:
            raise InvalidInputError(
                f"{source} is {wanted:g} m; the pads of {self._fingers.hand.name!r} can"
                f" be {low:g} to {high:g} m apart"
            )
        return float(np.clip(wanted, low, high))
