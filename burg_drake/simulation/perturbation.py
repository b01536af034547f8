"""Success rate of a grasp when its pose, mass and friction differ from what is assumed."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, InvalidInputError, Outcome, make_pose, rng_from, wilson_interval
from burg_drake.simulation.grasp_trial import HandTrial
from burg_drake.simulation.mujoco_trial import MujocoTrial
from burg_drake.simulation.settings import Noise


@dataclass(frozen=True, eq=False)
class PerturbedTrial:
    """Parameters of a perturbed trial.

    Attributes:
        X_OG: (4, 4) grasp in the target's frame.
        friction, mass: the target's [-, kg]; None without noise.
    """

    X_OG: Array
    friction: float | None
    mass: float | None


@dataclass(frozen=True)
class SuccessRate:
    """Outcomes of perturbed trials.

    Attributes:
        outcomes: number of trials by outcome, including hand collisions at the start.
    """

    outcomes: Counter[Outcome]

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self.outcomes.total()

    @property
    def lifted(self) -> int:
        """Number of trials that succeeded."""
        return self.outcomes[Outcome.LIFTED]

    @property
    def probability(self) -> float:
        """Share of trials that succeeded; NaN without trials."""
        return self.lifted / self.trials if self.trials else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson 95 % interval of the probability."""
        return wilson_interval(self.lifted, self.trials)


def perturb(
    X_OG: Array, mass: float, friction: float, noise: Noise, *, seed: int, grasp: str, repeat: int
) -> PerturbedTrial:
    """Draws one perturbed repeat of a trial.

    The draw depends only on seed, grasp and number of the repeat; the standard deviations only
    scale it.

    Args:
        X_OG: (4, 4) grasp in the target's frame; it is displaced and rotated by normally
            distributed errors along and about the axes of G.
        mass, friction: the target's [kg, -]; they are multiplied by a log-normal factor.
        noise: standard deviations.
        seed: seed of the run.
        grasp: id of the grasp.
        repeat: number of the repeat.
    """
    rng = rng_from("perturbation", seed, grasp, repeat)
    p_GG, turn, (log_mass, log_friction) = np.split(rng.standard_normal(8), (3, 6))
    X_GG = make_pose(
        Rotation.from_rotvec(noise.rotation * turn).as_matrix(), noise.translation * p_GG
    )
    still = noise.translation == noise.rotation == 0.0
    return PerturbedTrial(
        X_OG=X_OG if still else X_OG @ X_GG,
        friction=friction * math.exp(noise.friction * log_friction) if noise.friction else None,
        mass=mass * math.exp(noise.mass * log_mass) if noise.mass else None,
    )


def success_rate(
    trial: HandTrial | MujocoTrial,
    instance: str,
    X_OG: Array,
    noise: Noise = Noise(),
    *,
    repeats: int = 20,
    seed: int = 0,
    grasp: str = "",
) -> SuccessRate:
    """Executes perturbed repeats of a trial.

    Args:
        trial: executes them.
        instance: the target.
        X_OG: (4, 4) grasp in the target's frame.
        noise: standard deviations.
        repeats: number of repeats.
        seed, grasp: as for `perturb`.

    Raises:
        InvalidInputError: as `HandTrial.run`, or repeats is below 1.
    """
    if repeats < 1:
        raise InvalidInputError(f"repeats is {repeats}; give 1 or more")
    entry = trial.scene.entry(instance)
    outcomes: Counter[Outcome] = Counter()
    for repeat in range(repeats):
        drawn = perturb(
            X_OG, entry.mass, entry.friction, noise, seed=seed, grasp=grasp, repeat=repeat
        )
        result = trial.run(instance, drawn.X_OG, friction=drawn.friction, mass=drawn.mass)
        outcomes[result.outcome] += 1
    return SuccessRate(outcomes)
