"""Drivers of arm and hand: they follow a plan, or else position commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    InputPort,
    LeafSystem,
    State,
)
from pydrake.trajectories import PiecewisePolynomial

from burg_drake.core import Array, InvalidInputError
from burg_drake.scene import Scene
from burg_drake.station.hand_document import Hand
from burg_drake.station.hand_model import STALL_FORCE_RATIO
from burg_drake.station.station_document import Station


class SampledMotion(Protocol):
    """Joint positions over time: `t` (T,) rising from 0 [s], `q` and `v` (T, n)."""

    @property
    def t(self) -> Array: ...

    @property
    def q(self) -> Array: ...

    @property
    def v(self) -> Array: ...


@runtime_checkable
class PlayablePlan(Protocol):
    """A plan: consecutive phases by name; `opening`, the distance between the pads of the open hand
    [m]; its `origin` with the names of its `joints`, or None; and `require_for`, which checks the
    origin, if there is one, against a scene and a station."""

    @property
    def phases(self) -> Mapping[str, SampledMotion]: ...

    @property
    def opening(self) -> float: ...

    @property
    def origin(self) -> Any: ...

    def require_for(self, scene: Scene, station: Station) -> None: ...


@dataclass(frozen=True, eq=False)
class PlannedCommand:
    """Command of a plan at one time.

    Attributes:
        q, v: (n,) positions and velocities of the arm [rad, rad/s].
        closed: whether the hand closes or holds.
        opening: distance between the pads of the open hand [m].
    """

    q: Array
    v: Array
    closed: bool
    opening: float


@dataclass(frozen=True, eq=False)
class _PlannedSamples:
    q: PiecewisePolynomial
    duration: float
    switches: tuple[tuple[float, bool], ...]
    opening: float


class PlanPlayer:
    """Samples plans that were made for one arm in one scene.

    Args:
        joints: names of the arm's n joints, in order.
        scene, station: scene and station of the plans.
    """

    def __init__(self, joints: tuple[str, ...], scene: Scene, station: Station) -> None:
        self._joints, self._scene, self._station = joints, scene, station
        self._plan: object = None
        self._samples: _PlannedSamples | None = None

    def command(self, plan: object, time: float) -> PlannedCommand | None:
        """Command of a plan for arm and hand.

        Args:
            plan: a `PlayablePlan`, or None.
            time: since its start [s].

        Returns:
            The command; None without a plan and before its start. After the end of the plan its
            last positions are kept.

        Raises:
            InvalidInputError: it is not a plan, or is for another arm, scene or station; or the
                time is not a number.
        """
        if plan is None:
            return None
        if self._samples is None or plan is not self._plan:
            self._samples, self._plan = self._check_plan(plan), plan
        if np.isnan(time):
            raise InvalidInputError(
                "plan.start_time is nan; give the time in seconds at which the plan begins"
            )
        if time < 0.0:
            return None
        samples = self._samples
        when = min(time, samples.duration)
        q = samples.q.value(when)[:, 0]
        v = samples.q.EvalDerivative(when, 1)[:, 0] if time < samples.duration else np.zeros(len(q))
        closed = [closing for start, closing in samples.switches if start <= time]
        return PlannedCommand(q, v, bool(closed and closed[-1]), samples.opening)

    def _check_plan(self, plan: object) -> _PlannedSamples:
        if not isinstance(plan, PlayablePlan):
            got = type(plan).__name__
            if hasattr(plan, "outcome"):  # a planner's result if it found no plan
                got += f" ({plan.outcome})"
            raise InvalidInputError(f"port 'plan' got a {got}; give a burg_drake Plan")
        if plan.origin is not None:
            joints = plan.origin.joints
            if tuple(joints) != self._joints:
                raise InvalidInputError(
                    f"the plan moves the joints {', '.join(joints)}; the arm of station"
                    f" {self._station.name!r} has {', '.join(self._joints)}"
                )
            plan.require_for(self._scene, self._station)
        opening = plan.opening
        if np.isnan(opening):
            opening = self._station.hand.opening[1]
        return _sample_plan(plan.phases, len(self._joints), opening)


def _sample_plan(
    phases: Mapping[str, SampledMotion], joints: int, opening: float
) -> _PlannedSamples:
    """Joins phases into one trajectory, and records when the hand closes and opens."""
    max_gap = 1e-6  # Radians between the end of a phase and the start of the next.
    times, positions, velocities = [np.zeros(1)], list[Array](), list[Array]()
    switches, end, before = [], 0.0, ""
    for name, phase in phases.items():
        if phase.q.shape[1] != joints:
            raise InvalidInputError(
                f"the plan's {name} moves {phase.q.shape[1]} joints; the arm has {joints}"
            )
        if not positions:
            positions.append(phase.q[:1])
            velocities.append(phase.v[:1])
        gap = float(np.abs(phase.q[0] - positions[-1][-1]).max())
        if gap > max_gap:
            raise InvalidInputError(
                f"the plan's {name} begins {gap:.2g} rad from where its {before} ends"
            )
        if name in ("close", "open"):
            switches.append((end, name == "close"))
        times.append(end + phase.t[1:])
        positions.append(phase.q[1:])
        velocities.append(phase.v[1:])
        end, before = float(times[-1][-1]), name
    if not positions:
        raise InvalidInputError("the plan has no phases")
    t, q, v = (np.concatenate(rows) for rows in (times, positions, velocities))
    return _PlannedSamples(
        PiecewisePolynomial.CubicHermite(t, q.T, v.T), end, tuple(switches), opening
    )


class _PlanFollower(LeafSystem):
    """Follows a plan that has begun, else one of the ports `position` and `desired_state`."""

    _position: InputPort
    _desired_state: InputPort

    def _declare_plan_ports(self, player: PlanPlayer, ahead: float = 0.0) -> None:
        """Declares the ports of the plan, which is sampled a time `ahead` [s] in advance."""
        self._player, self._ahead = player, ahead
        self._plan = self.DeclareAbstractInputPort("plan", Value[object]())
        self._start = self.DeclareVectorInputPort("plan.start_time", 1)

    def _planned_command(self, context: Context) -> PlannedCommand | None:
        """The plan's current command; None without a plan and before its start."""
        if not self._plan.HasValue(context):
            return None
        start = self._start.Eval(context)[0] if self._start.HasValue(context) else 0.0
        time = context.get_time() - start
        ahead = self._ahead if time >= 0.0 else 0.0
        return self._player.command(self._plan.Eval(context), time + ahead)

    def _connected_inputs(self, context: Context, role: str) -> tuple[bool, bool]:
        """Whether the ports `position` and `desired_state` are connected."""
        position, desired_state = (
            port.HasValue(context) for port in (self._position, self._desired_state)
        )
        if position and desired_state:
            raise InvalidInputError(
                f"ports {role}.position and {role}.desired_state are both connected; connect one of"
                " them"
            )
        return position, desired_state


class ArmDriver(_PlanFollower):
    """Follows a plan that has begun, else a position or a desired state, else holds the last
    command.

    With a position, the commanded velocity is its change since the previous step per time step, and
    0 in the first step. Drake's `StateInterpolatorWithDiscreteDerivative` does this a step later.

    Ports:
        position: (n) positions [rad].
        desired_state: (2 n) positions and velocities.
        plan, plan.start_time: see `PlanPlayer`; the time [s] is 0 if not connected.
        state: (2 n) positions and velocities of the arm; read when a simulation begins.
        command: (2 n) positions and velocities (output).
    """

    def __init__(
        self, joints: tuple[str, ...], home: Array, period: float, ahead: float, player: PlanPlayer
    ) -> None:
        """Declares ports, state and events.

        Args:
            joints: names of the n joints.
            home: (n,) positions that are held before a simulation begins [rad].
            period: time step of the simulation [s].
            ahead: time by which plans are sampled in advance [s].
            player: player of plans for this arm.
        """
        super().__init__()
        n = len(joints)
        self._joints, self._period = joints, period
        self._position = self.DeclareVectorInputPort("position", n)
        self._desired_state = self.DeclareVectorInputPort("desired_state", 2 * n)
        self._declare_plan_ports(player, ahead)
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        # The last command, and whether there has been one.
        self._last = self.DeclareDiscreteState(np.append(home, 0.0))
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._store_command)
        self._command = self.DeclareVectorOutputPort("command", 2 * n, self._calc)

    def _initialize(self, context: Context, values: DiscreteValues) -> None:
        n = len(self._joints)
        values.set_value(self._last, np.append(self._state.Eval(context)[:n], 0.0))

    def _store_command(self, context: Context, values: DiscreteValues) -> None:
        q = self._command.Eval(context)[: len(self._joints)]
        if self._planned_command(context) is not None:
            self._check_jump(q - context.get_discrete_state(self._last).value()[:-1])
        values.set_value(self._last, np.append(q, 1.0))

    def _check_jump(self, jump: Array) -> None:
        max_jump = 0.05  # Radians from the last command; the fastest arms move 0.015 rad in a step.
        worst = int(np.abs(jump).argmax())
        if abs(jump[worst]) > max_jump:
            raise InvalidInputError(
                f"the plan starts with {self._joints[worst]} at an angle "
                f"{abs(jump[worst]):.2g} rad away from the present one; bring the arm to"
                " the start of the plan, or set plan.start_time"
            )

    def _calc(self, context: Context, output: BasicVector) -> None:
        last = context.get_discrete_state(self._last).value()
        source, q, v = "the last command", last[:-1], np.zeros(len(self._joints))
        position, desired_state = self._connected_inputs(context, "arm")
        planned = self._planned_command(context)
        if planned is not None:
            source, q, v = "the plan", planned.q, planned.v
        elif desired_state:
            source = "arm.desired_state"
            q, v = np.split(self._desired_state.Eval(context), 2)
        elif position:
            source, before, q = "arm.position", q, self._position.Eval(context)
            v = (q - before) / self._period if last[-1] else v
        if not np.isfinite([q, v]).all():
            joint = int(np.argmin(np.isfinite(q) & np.isfinite(v)))
            raise InvalidInputError(
                f"{source} asks {self._joints[joint]} for {q[joint]:g} rad and "
                f"{v[joint]:g} rad/s; give finite numbers"
            )
        output.SetFromVector(np.concatenate([q, v]))


@dataclass(frozen=True, eq=False)
class Fingers:
    """The two fingers in the order of their actuators.

    Attributes:
        hand: the document.
        position_index, rate_index: (2,) indices of their positions and velocities in the state of
            the hand's model.
        dofs: (2,) indices of their velocities among all velocities of the plant.
        closed, open: (2,) positions of the closed and the open hand [m].
    """

    hand: Hand
    position_index: Array
    rate_index: Array
    dofs: Array
    closed: Array
    open: Array

    @classmethod
    def of(cls, plant: MultibodyPlant, model: ModelInstanceIndex, hand: Hand) -> Fingers:
        """Finds the fingers of a hand in a finalized plant."""
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
            position_index=np.array(q),
            rate_index=len(positions) + np.array(v),
            dofs=np.array([joint.velocity_start() for joint in joints]),
            closed=np.array([finger.closed for finger in fingers]),
            open=np.array([finger.open for finger in fingers]),
        )

    @property
    def closing_signs(self) -> Array:
        """Signs (2,) of the joints' velocities while the hand closes."""
        return np.sign(self.closed - self.open)

    def at(self, distance: float) -> Array:
        """Joint positions (2,) for a distance between the pads [m]."""
        low, high = self.hand.opening
        return self.closed + (distance - low) / (high - low) * (self.open - self.closed)

    def distance(self, q: Array) -> float:
        """Distance between the pads [m] at positions (2,)."""
        low, high = self.hand.opening
        share = (q - self.closed) / (self.open - self.closed)
        return float(low + share.mean() * (high - low))


class HandDriver(_PlanFollower):
    """Follows a plan that has begun, else a distance between the pads or a desired state, else
    holds the last command.

    The fingers' servos follow a velocity with at most the document's force. A lower limit is
    enforced by a brake: a force against the motion that makes up the difference, for which the
    servos compensate. So free fingers keep their speed, and the grip force obeys the limit.

    Ports:
        position: (1) distance between the pads [m].
        force_limit: (1) force of each pad [N], the document's if not connected.
        desired_state: (4) input of the servos, which follow its velocities.
        plan, plan.start_time: see `PlanPlayer`; the time [s] is 0 if not connected.
        state: (2 k) state of the hand's model.
        command: (4) command of the servos (output).
        brake: (v) generalized force on the whole plant, which brakes the fingers (output).
        braked: (2) brake force of the fingers in the last step [N] (output).
    """

    def __init__(
        self, plant: MultibodyPlant, model: ModelInstanceIndex, fingers: Fingers, player: PlanPlayer
    ) -> None:
        """Declares ports, state and events for a hand in a diagram."""
        super().__init__()
        hand = fingers.hand
        self._fingers, self._size = fingers, plant.num_velocities()
        self._damping = STALL_FORCE_RATIO * hand.force / hand.closing_speed
        self._position = self.DeclareVectorInputPort("position", 1)
        self._force_limit = self.DeclareVectorInputPort("force_limit", 1)
        self._desired_state = self.DeclareVectorInputPort("desired_state", 4)
        self._declare_plan_ports(player)
        self._state = self.DeclareVectorInputPort("state", plant.num_multibody_states(model))
        # Positions at which the fingers are held, and the brake of the last step.
        self._held = self.DeclareDiscreteState(fingers.open)
        self._braked = self.DeclareDiscreteState(np.zeros(2))
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        # A discrete update would come after the plant's unrestricted update, and would store the
        # brake of the next step.
        self.DeclarePeriodicUnrestrictedUpdateEvent(plant.time_step(), 0.0, self._store_command)
        self.DeclareVectorOutputPort("command", 4, self._calc_command)
        self._brake = self.DeclareVectorOutputPort("brake", self._size, self._calc_brake)
        self.DeclareStateOutputPort("braked", self._braked)

    def _initialize(self, context: Context, values: DiscreteValues) -> None:
        values.set_value(self._held, self._state.Eval(context)[self._fingers.position_index])
        values.set_value(self._braked, np.zeros(2))

    def _store_command(self, context: Context, state: State) -> None:
        values = state.get_mutable_discrete_state()
        values.set_value(self._held, self._finger_command(context)[0])
        values.set_value(self._braked, self._brake.Eval(context)[self._fingers.dofs])

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        q, v = self._finger_command(context)
        output.SetFromVector([*q, *(v - self._braking_force(context, v) / self._damping)])

    def _calc_brake(self, context: Context, output: BasicVector) -> None:
        brake = np.zeros(self._size)
        _, v = self._finger_command(context)
        brake[self._fingers.dofs] = self._braking_force(context, v)
        output.SetFromVector(brake)

    def _braking_force(self, context: Context, speed: Array) -> Array:
        """Force (2,) against the commanded motion [N]."""
        full_force = self._fingers.hand.force
        limit = full_force
        if self._force_limit.HasValue(context):
            limit = float(self._force_limit.Eval(context)[0])
            if not 0.0 < limit <= full_force:
                raise InvalidInputError(
                    f"hand.force_limit is {limit:g} N; give more than 0 and at most the"
                    f" {full_force:g} N of {self._fingers.hand.name!r}"
                )
        return np.asarray(-np.sign(speed) * (full_force - limit))

    def _finger_command(self, context: Context) -> tuple[Array, Array]:
        """Goal positions (2,) of the fingers [m], and their current velocities (2,) [m/s]."""
        position_gain = 50.0  # Ratio of finger speed to distance from the goal, 1/s.
        position, desired_state = self._connected_inputs(context, "hand")
        fingers, fastest = self._fingers, self._fingers.hand.closing_speed
        q = self._state.Eval(context)[fingers.position_index]
        planned = self._planned_command(context)
        if planned is not None and planned.closed:
            return fingers.closed, fingers.closing_signs * fastest
        if planned is None and desired_state:
            speeds = self._desired_state.Eval(context)[2:]
            if not np.isfinite(speeds).all():
                raise InvalidInputError(
                    f"hand.desired_state asks for finger speeds of {speeds.tolist()} m/s;"
                    " give finite numbers"
                )
            return q, speeds
        goal = context.get_discrete_state(self._held).value()
        if planned is not None:
            goal = fingers.at(self._distance(planned.opening, "the plan's opening"))
        elif position:
            wanted = float(self._position.Eval(context)[0])
            goal = fingers.at(self._distance(wanted, "hand.position"))
        return goal, np.clip(position_gain * (goal - q), -fastest, fastest)

    def _distance(self, wanted: float, source: str) -> float:
        tolerance = 1e-3  # Metres beyond the range of the hand.
        low, high = self._fingers.hand.opening
        if not low - tolerance <= wanted <= high + tolerance:
            raise InvalidInputError(
                f"{source} is {wanted:g} m; the pads of {self._fingers.hand.name!r} can"
                f" be {low:g} to {high:g} m apart"
            )
        return float(np.clip(wanted, low, high))
