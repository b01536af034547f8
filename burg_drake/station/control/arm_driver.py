"""The arm's driver: makes positions and velocities of whatever commands the arm."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from burg_drake.core import Array, InvalidInputError
from burg_drake.station.control.plan_player import PlannedCommand, PlanPlayer

JUMP = 0.05
"""A plan may begin, and go on, so far from the last command [rad]: the fastest arms move 0.015 in
the longest step."""


class ArmDriver(LeafSystem):
    """Follows a plan that has begun, else a position or a desired state; without any of them it
    holds what was commanded last.

    The velocity that goes with a position is its difference from that of one step before, and 0 in
    the first step. Drake's `StateInterpolatorWithDiscreteDerivative` does the same a step later.

    Ports:
        position: (n) [rad].
        desired_state: (2 n) positions and velocities.
        plan, plan.start_time: see `PlanPlayer`; the time [s] is 0 if not connected.
        state: (2 n) where the arm is; read when a simulation begins.
        command: (2 n) positions and velocities (output).
    """

    def __init__(
        self, joints: tuple[str, ...], home: Array, period: float, ahead: float, player: PlanPlayer
    ) -> None:
        """Declares ports, state and events.

        Args:
            joints: names of the n joints.
            home: (n,) what is held before a simulation has begun [rad].
            period: of the simulation's steps [s].
            ahead: plans are commanded for so much later [s].
            player: of plans for this arm.
        """
        super().__init__()
        n = len(joints)
        self._joints, self._period, self._ahead, self._player = joints, period, ahead, player
        self._position = self.DeclareVectorInputPort("position", n)
        self._desired_state = self.DeclareVectorInputPort("desired_state", 2 * n)
        self._plan = self.DeclareAbstractInputPort("plan", Value[object]())
        self._start = self.DeclareVectorInputPort("plan.start_time", 1)
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        # The last command, and whether there has been one.
        self._last = self.DeclareDiscreteState(np.append(home, 0.0))
        self.DeclareInitializationDiscreteUpdateEvent(self._begin)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)
        self._command = self.DeclareVectorOutputPort("command", 2 * n, self._calc)

    def _begin(self, context: Context, values: DiscreteValues) -> None:
        n = len(self._joints)
        values.set_value(self._last, np.append(self._state.Eval(context)[:n], 0.0))

    def _remember(self, context: Context, values: DiscreteValues) -> None:
        q = self._command.Eval(context)[: len(self._joints)]
        if self._planned(context) is not None:
            self._check_jump(q - context.get_discrete_state(self._last).value()[:-1])
        values.set_value(self._last, np.append(q, 1.0))

    def _check_jump(self, jump: Array) -> None:
        worst = int(np.abs(jump).argmax())
        if abs(jump[worst]) > JUMP:
            raise InvalidInputError(
                f"the plan starts with {self._joints[worst]} at an angle "
                f"{abs(jump[worst]):.2g} rad away from the present one; bring the arm to"
                " the start of the plan, or set plan.start_time"
            )

    def _calc(self, context: Context, output: BasicVector) -> None:
        last = context.get_discrete_state(self._last).value()
        source, q, v = "the last command", last[:-1], np.zeros(len(self._joints))
        position, desired_state = (
            port.HasValue(context) for port in (self._position, self._desired_state)
        )
        if position and desired_state:
            raise InvalidInputError(
                "ports arm.position and arm.desired_state are both connected; connect one of them"
            )
        planned = self._planned(context)
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

    def _planned(self, context: Context) -> PlannedCommand | None:
        """What the plan wants now; None without one, and before it starts."""
        if not self._plan.HasValue(context):
            return None
        start = self._start.Eval(context)[0] if self._start.HasValue(context) else 0.0
        time = context.get_time() - start
        ahead = self._ahead if time >= 0.0 else 0.0
        return self._player.command(self._plan.Eval(context), time + ahead)
