"""A target that the hand holds in free air, and loads on its grip.

A load is a force on the target's centre of mass, given as an acceleration times the target's mass:
after d'Alembert that is what the target feels when the hand is accelerated the other way, without
turning. Every load starts from the same state, so that what one of them does says nothing about the
next.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce

from burg_drake.core import Array, inverse
from burg_drake.simulation.trials import (
    LEVER,
    HandTrial,
    TrialResult,
    finger_contact,
    motion_in_hand,
)
from burg_drake.station.diagram import FloatingHand

REST_SPEED = 0.002
"""A target that moves in the hand slower than this is at rest [m/s]."""
REST_CHECKS, REST_TIMEOUT = 10, 50
"""The grip is loaded when the target is at rest in the standing hand at so many looks in a row, and
after so many looks in any case."""
STEADY_CHECKS = 3
"""A steady load is borne when the target is at rest in the hand at so many looks in a row: what
slides under an excess of a hundredth of its weight is faster by then."""


class Grip:
    """The hand with the target in it after a trial that ended with the target held.

    The hand brakes and stands. From then on there is nothing but hand and target: what else is in
    the scene neither moves nor touches them.

    Args:
        trial: its last run was one of this target `without_hull`, and held it.
        instance: the target.
        friction: its coefficient in that run, if not the library's.

    Attributes:
        weight: of the target [N].
        friction_force: what the pads carry by friction in all, 2 mu N [N].
    """

    def __init__(self, trial: HandTrial, instance: str, friction: float | None = None) -> None:
        self._world = world = trial.world
        assert isinstance(world.hand, FloatingHand)
        self._hand = world.hand
        self._plant = world.diagram.plant
        self._context = world.context
        self._plant_context = self._plant.GetMyContextFromRoot(self._context)
        self._contacts_port = self._plant.get_contact_results_output_port()
        self._forces_port = world.diagram.diagram.GetInputPort("applied_forces")
        self._target = self._plant.get_body(world.diagram.free[instance])
        self._gravity = float(np.linalg.norm(self._plant.gravity_field().gravity_vector()))
        self._step = world.diagram.engine.time_step
        self._mass = self._target.get_mass(self._plant_context)
        self.weight = self._mass * self._gravity
        mu = trial.scene.entry(instance).friction if friction is None else friction
        self.friction_force = 2.0 * mu * trial.station.hand.force
        world.isolate(self._target.index())
        self._brake()
        self._rest()
        self._time = self._context.get_time()
        self._state = self._context.get_discrete_state().Clone()
        self._X_GO = self._current_X_GO()

    def withstands(
        self,
        load: Callable[[float], Array],
        duration: float,
        slide: float,
        *,
        steady_from: float = math.inf,
    ) -> bool:
        """Whether the grip bears a load.

        Args:
            load: (3,) acceleration in G [g] by the time since the load began [s].
            duration: of the load [s].
            slide: how far the point of the target at the grasp may move in the hand [m].
            steady_from: time from which the load is constant [s], so that what is at rest stays
                so, and the rest can be left out.

        Returns:
            Whether both fingers touch the target and it has not slid further, at every look.

        Raises:
            RuntimeError, SystemExit: from Drake.
        """
        self._context.SetTime(self._time)
        self._context.SetDiscreteState(self._state)
        self._world.simulator.Initialize()
        R_WG = self._hand.X_WG(self._plant_context)[:3, :3]
        steps_per_check = max(1, round(self._world.settings.poll / self._step))
        checks = math.ceil(duration / (steps_per_check * self._step) - 1e-9)
        X_GO, at_rest = self._X_GO, 0
        try:
            for check in range(checks):
                for k in range(check * steps_per_check, (check + 1) * steps_per_check):
                    self._apply(self.weight * (R_WG @ load((k + 0.5) * self._step)))
                    self._advance_by(1)
                before, X_GO = X_GO, self._current_X_GO()
                if not (self._is_touched() and motion_in_hand(self._X_GO, X_GO)[0] <= slide):
                    return False
                at_rest = at_rest + 1 if self._is_at_rest(before, X_GO) else 0
                if check * steps_per_check * self._step >= steady_from and at_rest >= STEADY_CHECKS:
                    return True
            return True
        finally:
            self._forces_port.FixValue(self._context, [])

    def _apply(self, f_W: Array) -> None:
        """Puts a force (3,) on the target's centre of mass [N]."""
        force = ExternallyAppliedSpatialForce()
        force.body_index = self._target.index()
        force.p_BoBq_B = self._target.default_com()
        force.F_Bq_W = SpatialForce(np.zeros(3), f_W)
        self._forces_port.FixValue(self._context, [force])

    def _is_touched(self) -> bool:
        contacts = self._world.contacts.read(self._contacts_port.Eval(self._plant_context))
        return finger_contact(contacts, self._hand.fingers, self._target.index()).both

    def _is_at_rest(self, before: Array, after: Array) -> bool:
        """Whether the target has hardly moved in the hand from one look to the next."""
        distance, angle = motion_in_hand(before, after)
        return max(distance, angle * LEVER) <= REST_SPEED * self._world.settings.poll

    def _brake(self) -> None:
        """Stops the hand as gently as it was accelerated."""
        settings = self._world.settings
        braking = settings.acceleration
        speed = self._hand.lift.get_translation_rate(self._plant_context)
        checks = math.ceil(speed / (braking * settings.poll))
        for i in range(checks):
            self._world.command("lift", np.array([0.0, speed * (1.0 - (i + 0.5) / checks)]))
            self._advance()
        self._world.command("lift", np.zeros(2))

    def _rest(self) -> None:
        """Waits until the target is at rest in the hand."""
        at_rest, X_GO = 0, self._current_X_GO()
        for _ in range(REST_TIMEOUT):
            self._advance()
            before, X_GO = X_GO, self._current_X_GO()
            at_rest = at_rest + 1 if self._is_at_rest(before, X_GO) else 0
            if at_rest >= REST_CHECKS:
                return

    def _advance(self) -> None:
        self._advance_by(max(1, round(self._world.settings.poll / self._step)))

    def _advance_by(self, steps: int) -> None:
        """To a whole number of steps since 0, with the rounding that Drake's own steps have."""
        done = round(self._context.get_time() / self._step)
        self._world.simulator.AdvanceTo((done + steps) * self._step)

    def _current_X_GO(self) -> Array:
        X_WO = self._plant.EvalBodyPoseInWorld(self._plant_context, self._target)
        X_GO: Array = inverse(self._hand.X_WG(self._plant_context)) @ X_WO.GetAsMatrix4()
        return X_GO


def take_grip(
    trial: HandTrial,
    instance: str,
    X_OG: Array,
    *,
    friction: float | None = None,
    mass: float | None = None,
    lift: float | None = None,
) -> Grip | TrialResult:
    """Executes a grasp, and takes the hand as it then holds the target.

    A load may bring the target to parts of the hand that the trial kept clear of. They have to meet
    it as it is: a hull would hold a bowl by its hollow.

    Args:
        trial, instance, X_OG, friction, mass, lift: as for `HandTrial.run`.

    Returns:
        The grip; the trial's result if the target is not held at its end.

    Raises:
        InvalidInputError: as `HandTrial.run`.
        RuntimeError, SystemExit: from Drake.
    """
    result = trial.run(instance, X_OG, friction=friction, mass=mass, lift=lift, without_hull=True)
    return Grip(trial, instance, friction) if result.outcome.held else result
