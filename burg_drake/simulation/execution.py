"""One trial on its way: close, lift, hold, and the outcome with its margins."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from pydrake.multibody.tree import BodyIndex, RigidBody

from burg_drake.core.frames import Array, inverse, rotation_angle
from burg_drake.core.outcome import Outcome
from burg_drake.simulation.contacts import FingerContact, finger_contact, reached
from burg_drake.simulation.result import Margins, TrialResult

if TYPE_CHECKING:
    from burg_drake.simulation.hand_trial import HandTrial

MINIMUM_LIFT = 0.5
"""Share of the lift height that the target must rise by to count as lifted."""


LEVER = 0.05
"""Turning counts as the motion of a point at this distance from the grasp [m]."""


class BystanderReached(Exception):
    """A moving body touched objects that are locked.

    Attributes:
        bodies: the objects.
    """

    def __init__(self, bodies: set[BodyIndex]) -> None:
        super().__init__(bodies)
        self.bodies = bodies


class Execution:
    """Runs a trial from a Context that has been brought to its start.

    Args:
        trial: the trial.
        target: the grasped body.
        moving: the free objects that are not locked, the target among them.
    """

    def __init__(self, trial: HandTrial, target: BodyIndex, moving: set[BodyIndex]) -> None:
        diagram = trial.diagram
        self._trial = trial
        self._settings = trial.settings
        self._context = trial.context
        self._plant = diagram.plant
        self._plant_context = self._plant.GetMyContextFromRoot(self._context)
        self._results_port = self._plant.get_contact_results_output_port()
        self._target = self._plant.get_body(target)
        self._others = [self._plant.get_body(index) for index in sorted(moving - {target})]
        self._still = set(diagram.free.values()) - moving
        self._moving = moving | set(diagram.robot_bodies)
        self._start = [self._position(body) for body in self._others]
        self._height_start = self._height()
        self._others_moved = 0.0
        self._contact = FingerContact((False, False), np.zeros((2, 3)))
        self._X_GO_grip: Array | None = None

    def run(self) -> TrialResult:
        """Runs all phases.

        Raises:
            BystanderReached: a locked object was touched; the trial must start again.
            RuntimeError: the simulation failed.
        """
        touched = self._close()
        if not self._contact.both:
            if self._contact.any:
                return self._end(Outcome.ONE_FINGER)
            return self._end(Outcome.CLOSED_EMPTY if touched else Outcome.NO_CONTACT)
        self._X_GO_grip = self._X_GO()
        if not self._lift():
            return self._end(Outcome.SLIPPED)
        if not self._hold():
            return self._end(Outcome.DROPPED)
        return self._end(Outcome.LIFTED)

    def _close(self) -> bool:
        """Closes until the fingers rest; returns whether a finger touched the target."""
        settings = self._settings
        touched, slow_since = False, math.inf
        while self._context.get_time() < settings.close_timeout:
            now = self._advance()
            touched = touched or self._contact.any
            if self._trial.hand.finger_speed(self._plant_context) > settings.settled_speed:
                slow_since = math.inf
            else:
                slow_since = min(slow_since, now)
                if now - slow_since >= settings.settled_time - 1e-9:
                    break
        return touched

    def _lift(self) -> bool:
        """Raises the hand; returns whether the target is held at the end."""
        settings = self._settings
        steps = 2 * max(1, round(settings.lift_time / settings.poll / 2))
        top_speed = 2 * settings.lift_height / (steps * settings.poll)
        for i in range(steps):
            speed = top_speed * (1 - abs(2 * i + 1 - steps) / steps)  # of the interval's middle
            self._trial.command("lift", np.array([0.0, speed]))
            self._advance()
            if not self._contact.any:
                return False
        self._trial.command("lift", np.zeros(2))
        return self._contact.both and self._risen() >= MINIMUM_LIFT * settings.lift_height

    def _hold(self) -> bool:
        """Waits; returns whether the target is held at the end.

        The end is early when the target has come to rest in the hand: at the speeds of
        `TrialSettings` it would move by less than a millimetre in what is left.
        """
        settings = self._settings
        X_GO, resting = self._X_GO(), 0.0
        for _ in range(max(1, round(settings.hold_time / settings.poll))):
            self._advance()
            if not self._contact.any:
                return False
            X_GO_before, X_GO = X_GO, self._X_GO()
            distance, angle = _motion(X_GO_before, X_GO)
            slow = max(distance, angle * LEVER) <= settings.settled_speed * settings.poll
            resting = resting + settings.poll if slow else 0.0
            if resting >= settings.resting_time - 1e-9:
                break
        return self._contact.both

    def _advance(self) -> float:
        """Steps to the next look at the contacts; returns the time [s]."""
        time = self._context.get_time() + self._settings.poll
        self._trial.simulator.AdvanceTo(time)
        if not math.isfinite(self._height()):
            raise RuntimeError(f"the state is not finite at {time:.3f} s")
        contacts = self._trial.contacts.read(self._results_port.Eval(self._plant_context))
        bystanders = reached(contacts, self._moving, self._still)
        if bystanders:
            raise BystanderReached(bystanders)
        self._contact = finger_contact(contacts, self._trial.hand.fingers, self._target.index())
        for body, start in zip(self._others, self._start, strict=True):
            distance = float(np.linalg.norm(self._position(body) - start))
            self._others_moved = max(self._others_moved, distance)
        return time

    def _position(self, body: RigidBody) -> Array:
        return self._plant.EvalBodyPoseInWorld(self._plant_context, body).translation()

    def _height(self) -> float:
        """Height of the target's centre of mass [m]."""
        X_WO = self._plant.EvalBodyPoseInWorld(self._plant_context, self._target)
        return float(X_WO.multiply(self._target.default_com())[2])

    def _risen(self) -> float:
        return self._height() - self._height_start

    def _X_GO(self) -> Array:
        X_WO = self._plant.EvalBodyPoseInWorld(self._plant_context, self._target)
        return inverse(self._X_WG()) @ X_WO.GetAsMatrix4()

    def _X_WG(self) -> Array:
        return self._trial.hand.X_WG(self._plant_context)

    def _end(self, outcome: Outcome) -> TrialResult:
        slip = tilt = force = math.nan
        if self._X_GO_grip is not None:
            slip, tilt = _motion(self._X_GO_grip, self._X_GO())
            closing = self._X_WG()[:3, 0]
            force = float(np.abs(self._contact.force @ closing).min())
        margins = Margins(
            overlap=0.0,
            slip=slip,
            tilt=tilt,
            pad_force=force,
            lift=self._risen(),
            others_moved=self._others_moved,
            end_time=self._context.get_time(),
        )
        return TrialResult(outcome=outcome, margins=margins)


def _motion(X_GO: Array, X_GO_later: Array) -> tuple[float, float]:
    """How a target has moved in the hand: of the point at the grasp [m], and its angle [rad]."""
    X_GG = X_GO_later @ inverse(X_GO)
    return float(np.linalg.norm(X_GG[:3, 3])), float(rotation_angle(X_GG[:3, :3]))
