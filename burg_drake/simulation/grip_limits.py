"""How strong a grip is: the tugs, the shaking and the lack of friction that it withstands.

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
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import UniformGravityFieldElement

from burg_drake.core import Array, Outcome, UnknownNameError, inverse, suggest_names
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
    """Searches from a guess in growing or falling strides, then by bisection of the logarithm.

    What bears a load need not bear every smaller one; the load that is returned is borne, and one
    that is larger by at most `tolerance` is not.

    Args:
        passes: whether a load is borne.
        guess: where the search starts; the nearer to the limit, the fewer loads are tried.
        low, high: smallest and largest load tried, above 0.
        tolerance: relative, above 0.

    Returns:
        The load; 0 if not even `low` is borne, infinity if `high` is.
    """
    stride = 1.5  # Factor between two loads until the limit lies between two of them.
    borne, lost = 0.0, math.inf
    load = min(max(guess, low), high)
    while True:
        if passes(load):
            if load == high:
                return math.inf
            borne = load
        else:
            if load == low:
                return 0.0
            lost = load
        if lost == math.inf:
            load = min(borne * stride, high)
        elif borne == 0.0:
            load = max(lost / stride, low)
        elif lost <= borne * (1.0 + tolerance):
            return borne
        else:
            load = math.sqrt(borne * lost)


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
        self._hand, plant = world.hand, world.diagram.plant
        self._forces_port = world.diagram.diagram.GetInputPort("applied_forces")
        self._target = plant.get_body(world.free[instance])
        self._step = world.engine.time_step
        gravity = float(np.linalg.norm(plant.gravity_field().gravity_vector()))
        self.weight = self._target.get_mass(world.plant_context) * gravity
        mu = trial.scene.entry(instance).friction if friction is None else friction
        self.friction_force = 2.0 * mu * trial.station.hand.force
        world.isolate(self._target.index())
        self._brake()
        self._rest()
        self._time, self._state = world.time, world.state()
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
        self._world.go_back(self._time, self._state)
        self._world.simulator.Initialize()
        R_WG = self._world.X_WG()[:3, :3]
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
                # What slides under 1 % of excess load is faster by the third check.
                if check * steps_per_check * self._step >= steady_from and at_rest >= 3:
                    return True
            return True
        finally:
            self._forces_port.FixValue(self._world.context, [])

    def _apply(self, f_W: Array) -> None:
        """Puts a force (3,) on the target's centre of mass [N]."""
        force = ExternallyAppliedSpatialForce()
        force.body_index = self._target.index()
        force.p_BoBq_B = self._target.default_com()
        force.F_Bq_W = SpatialForce(np.zeros(3), f_W)
        self._forces_port.FixValue(self._world.context, [force])

    def _is_touched(self) -> bool:
        contacts = self._world.look()
        return finger_contact(contacts, self._world.fingers, self._target.index()).both

    def _is_at_rest(self, before: Array, after: Array) -> bool:
        """Whether the target has hardly moved in the hand from one look to the next."""
        distance, angle = motion_in_hand(before, after)
        return max(distance, angle * SLIP_LEVER) <= 0.002 * self._world.settings.poll

    def _brake(self) -> None:
        """Stops the hand as gently as it was accelerated."""
        settings = self._world.settings
        braking = settings.acceleration
        speed = self._hand.lift.get_translation_rate(self._world.plant_context)
        checks = math.ceil(speed / (braking * settings.poll))
        for i in range(checks):
            self._world.command("lift", np.array([0.0, speed * (1.0 - (i + 0.5) / checks)]))
            self._advance()
        self._world.command("lift", np.zeros(2))

    def _rest(self) -> None:
        """Waits until the target is at rest in the hand."""
        at_rest, X_GO = 0, self._current_X_GO()
        for _ in range(50):  # then the grip is loaded in any case
            self._advance()
            before, X_GO = X_GO, self._current_X_GO()
            at_rest = at_rest + 1 if self._is_at_rest(before, X_GO) else 0
            if at_rest >= 10:
                return

    def _advance(self) -> None:
        self._advance_by(max(1, round(self._world.settings.poll / self._step)))

    def _advance_by(self, steps: int) -> None:
        """To a whole number of steps since 0, with the rounding that Drake's own steps have."""
        done = round(self._world.time / self._step)
        self._world.simulator.AdvanceTo((done + steps) * self._step)

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
    """What a grip bears.

    Attributes:
        accelerations: by direction or axis of G [g], beside the pull of gravity: the largest load
            of those tried that the grip bears, while it does not bear one that is larger by the
            tolerance. 0 if not even the smallest is borne, infinity if the largest is.
        weight: of the target [N].
    """

    accelerations: Mapping[str, float]
    weight: float

    @property
    def forces(self) -> dict[str, float]:
        """The same as forces on the centre of mass [N]."""
        return {name: value * self.weight for name, value in self.accelerations.items()}

    @property
    def weakest(self) -> tuple[str, float]:
        """Direction or axis of the smallest, and the acceleration there [g]."""
        return min(self.accelerations.items(), key=lambda item: item[1])


def tug(
    grip: Grip,
    settings: LoadSettings = LoadSettings(),
    *,
    directions: Iterable[str] = tuple(TUG_DIRECTIONS),
) -> HoldForces:
    """Tugs a held target along directions of the grasp frame.

    Args:
        grip: the held target; every load starts from the same state of it.
        settings: loads.
        directions: some of `TUG_DIRECTIONS`.

    Raises:
        UnknownNameError: no such direction.
        RuntimeError, SystemExit: from Drake.
    """

    def withstands(direction: Array, amplitude: float) -> bool:
        return grip.withstands(
            lambda t: amplitude * min(1.0, t / settings.tug_rise) * direction,
            settings.tug_rise + settings.tug_time,
            settings.slide,
            steady_from=settings.tug_rise,
        )

    return _hold_forces(grip, _select_by_name(TUG_DIRECTIONS, directions), withstands, settings)


def shake(
    grip: Grip,
    settings: LoadSettings = LoadSettings(),
    *,
    axes: Iterable[str] = tuple(SHAKE_AXES),
) -> HoldForces:
    """Shakes a held target to and fro along the axes of the grasp frame.

    Args:
        grip: the held target; every load starts from the same state of it.
        settings: loads.
        axes: some of `SHAKE_AXES`.

    Returns:
        Amplitudes of the sinusoidal acceleration that the grip bears for some periods.

    Raises:
        UnknownNameError: no such axis.
        RuntimeError, SystemExit: from Drake.
    """
    omega = 2.0 * np.pi * settings.frequency

    def withstands(axis: Array, amplitude: float) -> bool:
        return grip.withstands(
            lambda t: amplitude * min(1.0, t * settings.frequency) * np.sin(omega * t) * axis,
            settings.periods / settings.frequency,
            settings.slide,
        )

    return _hold_forces(grip, _select_by_name(SHAKE_AXES, axes), withstands, settings)


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
    withstands: Callable[[Array, float], bool],
    settings: LoadSettings,
) -> HoldForces:
    found = {
        name: largest_passing(
            partial(withstands, direction),
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
    """Looks for the smallest coefficient between target and pads with which a grasp lifts.

    A grasp that lifts need not lift with every larger coefficient. What is returned is a
    coefficient that lifts, while one that is smaller by the tolerance does not.

    Args:
        trial: executes the trials.
        instance: the target.
        X_OG: (4, 4) grasp in the target's frame.
        mass: of the target in place of the library's [kg].
        lift: length of the lift in place of the motion's [m].
        settings: which coefficients are tried.

    Returns:
        The coefficient; 0 if it lifts with the smallest that is tried, infinity if it does not with
        the largest.

    Raises:
        InvalidInputError: as `HandTrial.run`.
    """

    # Times the friction that carries the weight at the centre; few grasps are there.
    guess_factor = 1.25

    def lifts(inverse: float) -> bool:
        result = trial.run(instance, X_OG, friction=1.0 / inverse, mass=mass, lift=lift)
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
    """Coefficient with which two pads carry the target as fast as the hand speeds up, if they grip
    it at its centre: m (g + a) / (2 N)."""
    settings = trial.settings
    if mass is None:
        mass = trial.scene.entry(instance).mass
    gravity = UniformGravityFieldElement.kDefaultStrength
    friction: float = mass * (gravity + settings.acceleration) / (2.0 * trial.station.hand.force)
    return friction
