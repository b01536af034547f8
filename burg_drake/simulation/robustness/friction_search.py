"""The smallest friction coefficient with which a grasp still lifts its target."""

from __future__ import annotations

from pydrake.multibody.tree import UniformGravityFieldElement

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.simulation.mujoco import MujocoTrial
from burg_drake.simulation.robustness.bisection import largest_passing
from burg_drake.simulation.robustness.settings import FrictionSettings
from burg_drake.simulation.trials import HandTrial

LEVERAGE = 1.25
"""The search starts at this many times what carries the weight: few grasps are at the centre."""


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

    def lifts(inverse: float) -> bool:
        result = trial.run(instance, X_OG, friction=1.0 / inverse, mass=mass, lift=lift)
        return result.outcome is Outcome.LIFTED

    largest_inverse = largest_passing(
        lifts,
        guess=1.0 / (LEVERAGE * friction_to_carry(trial, instance, mass)),
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
