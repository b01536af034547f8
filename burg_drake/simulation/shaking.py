"""The trial of a shaken hand: a target alone and without gravity, as in ACRONYM.

The hand stands still, and the target feels the inertial forces of its motion. The fingers need
none: they move along the closing axis alone, and there the inertial forces are 0.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, InvalidInputError, Outcome, cross_matrix
from burg_drake.objects import ObjectEntry
from burg_drake.scene import Scene
from burg_drake.simulation.contacts import BodyContact
from burg_drake.simulation.object_motions import MovingBody
from burg_drake.simulation.settings import ShakeSettings, TrialSettings
from burg_drake.simulation.trial_execution import Execution, HandSegment, SteppedWorld
from burg_drake.simulation.trial_result import TrialResult
from burg_drake.station import Station, instance_pose

HAND_REACH = 0.3
"""Metres. No part of a hand is farther from its grasp frame."""


def height_to_shake(entry: ObjectEntry, station: Station) -> float:
    """Height of an object's origin at which hand and object are above table and obstacles [m].

    Args:
        entry: the object, in any orientation.
        station: the station.
    """
    tops = [0.0]
    for box in station.document.background.values():
        tops.append(box.X_WB.translation[2] + math.hypot(*box.size) / 2.0)
    farthest = np.maximum(np.abs(entry.lower), np.abs(entry.upper))
    return max(tops) + HAND_REACH + float(np.linalg.norm(farthest))


def require_single_object(scene: Scene, station: Station) -> None:
    """Refuses a scene in which a shaken hand would not be alone with its target.

    Raises:
        InvalidInputError: there are other objects, or something is near.
    """
    names = [*scene.instances, *scene.background]
    if len(scene.instances) != 1 or len(names) != 1:
        raise InvalidInputError(
            f"scene {scene.name!r} has {len(names)} objects; a hand is shaken with one alone"
        )
    height = height_to_shake(scene.entry(names[0]), station)
    if instance_pose(scene, station, names[0])[2, 3] < height - 1e-6:
        raise InvalidInputError(
            f"scene {scene.name!r}: {names[0]!r} is too near to the table or an obstacle of"
            f" station {station.name!r} to be shaken; place it at {height:.2f} m or more"
        )


def turning_axis(R_OG: Array) -> Array:
    """Axis (3,) about which a shaken hand turns first, in the grasp frame: the closing axis, along
    the direction that does not depend on which finger is the first.

    Args:
        R_OG: (3, 3) orientation of the hand in the target's frame.
    """
    aligned = 1e-6  # Components below this are 0, but for rounding.
    x_O = R_OG[:, 0]
    first = next((part for part in x_O if abs(part) > aligned), 1.0)
    return np.array([math.copysign(1.0, first), 0.0, 0.0])


class Shaking:
    """Motion of a shaken hand, and the forces on the target that stand for it.

    Args:
        settings: strength and duration.
        X_WG: (4, 4) the hand in the world.
        X_WO: (4, 4) the target at the start.
    """

    def __init__(self, settings: ShakeSettings, X_WG: Array, X_WO: Array) -> None:
        self._settings = settings
        self._approach, self._origin = X_WG[:3, 2], X_WG[:3, 3]
        self._axis = X_WG[:3, :3] @ turning_axis(X_WO[:3, :3].T @ X_WG[:3, :3])

    def _strokes(self, time: float) -> tuple[Array, Array]:
        """Speed and acceleration along the approach (2,) [m/s, m/s^2], and the same about the
        closing axis (2,) [rad/s, rad/s^2].

        Args:
            time: time since the shaking began [s].
        """
        settings, still = self._settings, np.zeros(2)
        periods = time * settings.shake_frequency
        if periods < settings.shake_periods:
            return self._stroke(periods, settings.shake_acceleration), still
        periods -= settings.shake_periods
        if periods < settings.shake_periods:
            return still, self._stroke(periods, settings.turn_acceleration)
        return still, still

    def _stroke(self, periods: float, acceleration: float) -> Array:
        side = 1.0 if math.floor(periods) % 2 == 0 else -1.0
        omega = 2.0 * math.pi * self._settings.shake_frequency
        phase = 2.0 * math.pi * (periods % 1.0)
        return side * acceleration * np.array([math.sin(phase) / omega, math.cos(phase)])

    def wrench(self, time: float, step: float, body: MovingBody) -> tuple[Array, Array]:
        """Inertial force (3,) at the centre of mass [N] and torque (3,) [N m] on a body during a
        time step, in the world; Euler's equations in the frame of the hand.

        Args:
            time: start of the step since the shaking began [s].
            step: its length [s].
            body: state of the body at the start, with whose speeds those of the hand go.
        """
        along, about = self._strokes(time + 0.5 * step)
        acceleration = along[1] * self._approach
        w, alpha = self._strokes(time)[1][0] * self._axis, about[1] * self._axis
        if not (w.any() or alpha.any()):
            return -body.mass * acceleration, np.zeros(3)
        W, A, B = cross_matrix(w), cross_matrix(alpha), cross_matrix(body.w_W)
        inertia = body.I_W
        acceleration = acceleration + (A + W @ W) @ (body.p_W - self._origin)
        acceleration += 2.0 * W @ body.v_W
        torque = inertia @ (alpha - B @ w) + (W + B) @ inertia @ w
        torque += W @ inertia @ body.w_W
        return -body.mass * acceleration, -torque


def shake_checks(settings: TrialSettings) -> int:
    """Number of contact checks while a hand is shaken."""
    assert settings.shake is not None
    return math.ceil(settings.shake.duration / settings.poll - 1e-9)


class ShakeCarrier:
    """Holds the hand still, and applies the forces of its shaking to the target; see `Carrier`.

    Args:
        world: world of a trial, prepared for its start with the fingers closing.
        target: the body to be grasped, away from everything else.
    """

    approach_checks = approach_steps = 0
    tracking_error = tracking_distance = math.nan
    touched = ""

    def __init__(self, world: SteppedWorld, target: BodyIndex) -> None:
        settings = world.settings.shake
        assert settings is not None
        self._world, self._target = world, target
        self._shaking = Shaking(settings, world.X_WG(), world.X_WB(target))
        self._begun = math.inf
        up, checks = np.array([0.0, 0.0, 1.0]), shake_checks(world.settings)
        self.segments: tuple[HandSegment, ...] = (HandSegment(up, 0.0, checks),)
        self.lift_time = settings.duration

    def approach(self) -> None:
        """Does nothing, as the hand begins at the grasp."""

    def close(self) -> None:
        """Does nothing, as the fingers close from the start."""

    def lift(self, segment_index: int, check: int) -> None:
        """Shakes from now on."""
        if check == 0:
            self._begun = self._world.time

    def stop(self) -> None:
        """Ends the shaking."""
        self._begun = math.inf

    def advance_to(self, time: float) -> None:
        """Advances the simulation; the forces change at every step."""
        world, step = self._world, self._world.engine.time_step
        for _ in range(round((time - world.time) / step)):
            body = world.moving_body(self._target)
            force = -body.mass * world.gravity
            torque = np.zeros(3)
            since = world.time - self._begun
            if since >= 0.0:
                inertial, torque = self._shaking.wrench(since, step, body)
                force = force + inertial
            world.push(self._target, force, torque)
            world.advance(1)

    def watch(self, contacts: list[BodyContact]) -> str:
        """Finds nothing, as nothing is near."""
        return ""

    def travelled(self) -> float:
        """Always 0."""
        return 0.0

    def carries_full_load(self, check: int) -> bool:
        """Never, as the trial is not decided before the end of the shaking."""
        return False

    def is_free_ahead(self) -> bool:
        """Always True, as nothing is near."""
        return True


class ShakeExecution(Execution):
    """Runs a trial of a shaken hand; see `Execution`."""

    def run(self) -> TrialResult:
        """Runs all phases, and ends the forces on the target."""
        try:
            return super().run()
        finally:
            self._world.push(self._target, np.zeros(3), np.zeros(3))

    def lift(self) -> Outcome | None:
        """Shakes; None if both fingers hold the target at the end, else the outcome."""
        for check in range(self._carrier.segments[0].checks):
            self._carrier.lift(0, check)
            self.advance()
            if not self.contact.any:
                return Outcome.SLIPPED
        self._carrier.stop()
        return None if self.contact.both else Outcome.SLIPPED

    def hold(self) -> Outcome | None:
        """Decides at once."""
        return None

    def result(self, outcome: Outcome) -> TrialResult:
        """The result, in which there is no lift."""
        found = super().result(outcome)
        return replace(found, margins=replace(found.margins, lift=math.nan))
