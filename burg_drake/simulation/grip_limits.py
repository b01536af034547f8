"""Strength of a grip: the tugs and the shaking that it withstands, and the friction that it needs.

A load is a force on the target's centre of mass, given as an acceleration times the target's mass.
The target would feel the same if the hand accelerated the other way without turning. Every load
starts from the same state, so loads do not affect each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.multibody.tree import UniformGravityFieldElement

from burg_drake.core import (
    Array,
    InvalidInputError,
    Outcome,
    UnknownNameError,
    inverse,
    suggest_names,
)
from burg_drake.simulation.contacts import finger_contact
from burg_drake.simulation.grasp_trial import HandTrial
from burg_drake.simulation.mujoco_trial import MujocoTrial
from burg_drake.simulation.object_motions import SLIP_LEVER, motion_in_hand
from burg_drake.simulation.settings import FrictionSettings, LoadSettings
from burg_drake.simulation.trial_result import TrialResult
from burg_drake.station import FloatingHand


def largest_passing(
    passes: Callable[[float], bool], *, guess: float, low: float, high: float, tolerance: float
) -> float:
    """Searches for the largest load that passes: geometric steps from a guess, then bisection of
    the logarithm.

    Passing need not be monotonic: the returned load passes, and a load larger by at most
    `tolerance` fails.

    Args:
        passes: whether a load passes.
        guess: start of the search; the closer to the limit, the fewer loads are tried.
        low, high: smallest and largest load tried, above 0.
        tolerance: relative, above 0.

    Returns:
        The load; 0 if `low` fails, infinity if `high` passes.
    """
    stride = 1.5  # Factor between tried loads until two of them bracket the limit.
    passed, failed = 0.0, math.inf
    load = min(max(guess, low), high)
    while True:
        if passes(load):
            if load == high:
                return math.inf
            passed = load
        else:
            if load == low:
                return 0.0
            failed = load
        if failed == math.inf:
            load = min(passed * stride, high)
        elif passed == 0.0:
            load = max(failed / stride, low)
        elif failed <= passed * (1.0 + tolerance):
            return passed
        else:
            load = math.sqrt(passed * failed)


class Grip:
    """The hand with the target in it after a trial that ended with the target held.

    The hand stops. From then on all other bodies of the scene are locked and touch neither hand nor
    target.

    Args:
        trial: its last run was a successful grasp of this target `without_hull`.
        instance: the target.
        friction: the target's coefficient in that run, if not the library's.

    Attributes:
        weight: weight of the target [N].
        friction_force: total friction limit of both pads, 2 mu N [N].
    """

    def __init__(self, trial: HandTrial, instance: str, friction: float | None = None) -> None:
        self._world = world = trial.world
        assert isinstance(world.hand, FloatingHand)
        self._hand, plant = world.hand, world.diagram.plant
        self._forces_port = world.diagram.diagram.GetInputPort("applied_forces")
        self._target = plant.get_body(world.free[instance])
        self._step = world.engine.time_step
        gravity = float(np.linalg.norm(plant.gravity_field().gravity_vector()))
        self.weight = self._target.get_mass(world.plant_context) * gravity
        mu = trial.scene.entry(instance).friction if friction is None else friction
        self.friction_force = 2.0 * mu * trial.station.hand.force
        world.isolate(self._target.index())
        self._stop_hand()
        self._wait_until_at_rest()
        self._time, self._state = world.time, world.state()
        self._X_GO = self._current_X_GO()

    def bears_load(
        self,
        load: Callable[[float], Array],
        duration: float,
        slide: float,
        *,
        steady_from: float = math.inf,
    ) -> bool:
        """Whether the grip withstands a load.

        Args:
            load: (3,) acceleration in G [g] as a function of the time since the load began [s].
            duration: duration of the load [s].
            slide: largest motion of the target's point at the grasp in the hand [m].
            steady_from: time from which the load is constant [s]; a target at rest then ends the
                simulation early.

        Returns:
            True if both fingers touch the target, and it has not slid further, at every check.

        Raises:
            RuntimeError, SystemExit: Drake failed.
        """
        self._world.restore_state(self._time, self._state)
        self._world.simulator.Initialize()
        R_WG = self._world.X_WG()[:3, :3]
        steps_per_check = max(1, round(self._world.settings.poll / self._step))
        checks = math.ceil(duration / (steps_per_check * self._step) - 1e-9)
        X_GO, at_rest = self._X_GO, 0
        try:
            for check in range(checks):
                for k in range(check * steps_per_check, (check + 1) * steps_per_check):
                    f_W = self.weight * (R_WG @ load((k + 0.5) * self._step))
                    self._world.push(self._target.index(), f_W, np.zeros(3))
                    self._world.advance(1)
                before, X_GO = X_GO, self._current_X_GO()
                if not (self._is_held() and motion_in_hand(self._X_GO, X_GO)[0] <= slide):
                    return False
                at_rest = at_rest + 1 if self._is_at_rest(before, X_GO) else 0
                # A target that slides under 1 % of excess load is faster by the third check.
                if check * steps_per_check * self._step >= steady_from and at_rest >= 3:
                    return True
            return True
        finally:
            self._forces_port.FixValue(self._world.context, [])

    def _is_held(self) -> bool:
        contacts = self._world.read_contacts()
        return finger_contact(contacts, self._world.fingers, self._target.index()).both

    def _is_at_rest(self, before: Array, after: Array) -> bool:
        """Whether the target has hardly moved in the hand between two checks."""
        distance, angle = motion_in_hand(before, after)
        return max(distance, angle * SLIP_LEVER) <= 0.002 * self._world.settings.poll

    def _stop_hand(self) -> None:
        """Stops the hand as gently as it was accelerated."""
        settings = self._world.settings
        braking = settings.acceleration
        speed = self._hand.lift.get_translation_rate(self._world.plant_context)
        checks = math.ceil(speed / (braking * settings.poll))
        for i in range(checks):
            self._world.command("lift", np.array([0.0, speed * (1.0 - (i + 0.5) / checks)]))
            self._advance()
        self._world.command("lift", np.zeros(2))

    def _wait_until_at_rest(self) -> None:
        """Waits until the target is at rest in the hand."""
        at_rest, X_GO = 0, self._current_X_GO()
        for _ in range(50):  # then the grip is loaded in any case
            self._advance()
            before, X_GO = X_GO, self._current_X_GO()
            at_rest = at_rest + 1 if self._is_at_rest(before, X_GO) else 0
            if at_rest >= 10:
                return

    def _advance(self) -> None:
        self._world.advance(max(1, round(self._world.settings.poll / self._step)))

    def _current_X_GO(self) -> Array:
        X_GO: Array = inverse(self._world.X_WG()) @ self._world.X_WB(self._target.index())
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
    """Executes a grasp, and returns the grip of the held target.

    A load may push the target against parts of the hand that the trial did not touch. They have to
    meet its true surface: with a convex hull, a bowl could be held by its hollow.

    Args:
        trial, instance, X_OG, friction, mass, lift: as for `HandTrial.run`.

    Returns:
        The grip, or the trial's result if the target is not held at its end.

    Raises:
        InvalidInputError: as `HandTrial.run`, or the trial shakes the target without gravity.
        RuntimeError, SystemExit: Drake failed.
    """
    if trial.settings.shake is not None:
        raise InvalidInputError(
            "the trial shakes its target without gravity; loads of a grip need one that lifts it"
        )
    result = trial.run(instance, X_OG, friction=friction, mass=mass, lift=lift, without_hull=True)
    return Grip(trial, instance, friction) if result.outcome.held else result


TUG_DIRECTIONS: dict[str, Array] = {
    f"{sign}{axis}": factor * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign, factor in (("+", 1.0), ("-", -1.0))
}
"""Directions (3,) in G by name: x closes the fingers, z approaches."""
SHAKE_AXES: dict[str, Array] = {axis: np.eye(3)[k] for k, axis in enumerate("xyz")}
"""Axes (3,) of G by name."""


@dataclass(frozen=True)
class HoldForces:
    """Largest loads that a grip withstands.

    Attributes:
        accelerations: largest load that the grip withstands in addition to gravity [g], by
            direction or axis of G; a load larger by the tolerance fails. 0 if the smallest tried
            load fails, infinity if the largest is withstood.
        weight: weight of the target [N].
    """

    accelerations: Mapping[str, float]
    weight: float

    @property
    def forces(self) -> dict[str, float]:
        """The loads as forces on the centre of mass [N], by direction or axis."""
        return {name: value * self.weight for name, value in self.accelerations.items()}

    @property
    def lowest_limit(self) -> tuple[str, float]:
        """Direction or axis with the smallest load, and that load as an acceleration [g]."""
        return min(self.accelerations.items(), key=lambda item: item[1])


def tug(
    grip: Grip,
    settings: LoadSettings = LoadSettings(),
    *,
    directions: Iterable[str] = tuple(TUG_DIRECTIONS),
) -> HoldForces:
    """Tugs a held target along directions of the grasp frame.

    Args:
        grip: the held target; every load starts from the same state.
        settings: loads.
        directions: names from `TUG_DIRECTIONS`.

    Raises:
        UnknownNameError: no such direction.
        RuntimeError, SystemExit: Drake failed.
    """

    def bears_load(direction: Array, amplitude: float) -> bool:
        return grip.bears_load(
            lambda t: amplitude * min(1.0, t / settings.tug_rise) * direction,
            settings.tug_rise + settings.tug_time,
            settings.slide,
            steady_from=settings.tug_rise,
        )

    return _hold_forces(grip, _select_by_name(TUG_DIRECTIONS, directions), bears_load, settings)


def shake(
    grip: Grip,
    settings: LoadSettings = LoadSettings(),
    *,
    axes: Iterable[str] = tuple(SHAKE_AXES),
) -> HoldForces:
    """Shakes a held target to and fro along the axes of the grasp frame.

    Args:
        grip: the held target; every load starts from the same state.
        settings: loads.
        axes: names from `SHAKE_AXES`.

    Returns:
        Largest amplitudes of the sinusoidal acceleration that the grip withstands.

    Raises:
        UnknownNameError: no such axis.
        RuntimeError, SystemExit: Drake failed.
    """
    omega = 2.0 * np.pi * settings.frequency

    def bears_load(axis: Array, amplitude: float) -> bool:
        return grip.bears_load(
            lambda t: amplitude * min(1.0, t * settings.frequency) * np.sin(omega * t) * axis,
            settings.periods / settings.frequency,
            settings.slide,
        )

    return _hold_forces(grip, _select_by_name(SHAKE_AXES, axes), bears_load, settings)


def _select_by_name(known: Mapping[str, Array], names: Iterable[str]) -> dict[str, Array]:
    chosen = list(names)
    for name in chosen:
        if name not in known:
            raise UnknownNameError(
                f"direction {name!r} does not exist; {suggest_names(name, known)}"
            )
    return {name: known[name] for name in chosen}


def _hold_forces(
    grip: Grip,
    directions: Mapping[str, Array],
    bears_load: Callable[[Array, float], bool],
    settings: LoadSettings,
) -> HoldForces:
    found = {
        name: largest_passing(
            partial(bears_load, direction),
            guess=grip.friction_force / grip.weight,
            low=settings.smallest,
            high=settings.largest,
            tolerance=settings.tolerance,
        )
        for name, direction in directions.items()
    }
    return HoldForces(found, grip.weight)


def friction_limit(
    trial: HandTrial | MujocoTrial,
    instance: str,
    X_OG: Array,
    *,
    mass: float | None = None,
    lift: float | None = None,
    settings: FrictionSettings = FrictionSettings(),
) -> float:
    """Searches for the smallest friction coefficient of target and pads with which a grasp lifts.

    A grasp that lifts need not lift with every larger coefficient. The grasp lifts with the
    returned coefficient, and fails with one that is smaller by the tolerance.

    Args:
        trial: executes the trials.
        instance: the target.
        X_OG: (4, 4) grasp in the target's frame.
        mass: the target's mass in place of the library's [kg].
        lift: length of the lift in place of the motion's [m].
        settings: range of coefficients, and tolerance.

    Returns:
        The coefficient; 0 if the grasp lifts with the smallest tried, infinity if it fails with the
        largest.

    Raises:
        InvalidInputError: as `HandTrial.run`.
    """

    # Relative to the friction that carries the weight at the centre; few grasps are there.
    guess_factor = 1.25

    def lifts(inverse_friction: float) -> bool:
        result = trial.run(instance, X_OG, friction=1.0 / inverse_friction, mass=mass, lift=lift)
        return result.outcome is Outcome.LIFTED

    largest_inverse = largest_passing(
        lifts,
        guess=1.0 / (guess_factor * friction_to_carry(trial, instance, mass)),
        low=1.0 / settings.largest,
        high=1.0 / settings.smallest,
        tolerance=settings.tolerance,
    )
    return float("inf") if largest_inverse == 0.0 else 1.0 / largest_inverse


def friction_to_carry(
    trial: HandTrial | MujocoTrial, instance: str, mass: float | None = None
) -> float:
    """Friction coefficient with which two pads that grip the target at its centre carry it during
    the lift's acceleration: m (g + a) / (2 N)."""
    settings = trial.settings
    if mass is None:
        mass = trial.scene.entry(instance).mass
    gravity = UniformGravityFieldElement.kDefaultStrength
    friction: float = mass * (gravity + settings.acceleration) / (2.0 * trial.station.hand.force)
    return friction
