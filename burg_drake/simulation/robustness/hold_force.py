"""How hard a held target can be tugged and shaken until it leaves the hand.

The loads are those of `simulation.robustness.grip`: forces on the target's centre of mass, in units
of its weight, which is what it feels when the hand is accelerated the other way. The inertia of the
fingers is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from burg_drake.core import Array, UnknownNameError, nearest
from burg_drake.simulation.robustness.bisection import largest_passing
from burg_drake.simulation.robustness.grip import Grip
from burg_drake.simulation.robustness.settings import LoadSettings

DIRECTIONS: dict[str, Array] = {
    f"{sign}{axis}": factor * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign, factor in (("+", 1.0), ("-", -1.0))
}
"""Directions (3,) in G: x closes the fingers, z approaches."""
AXES: dict[str, Array] = {axis: np.eye(3)[k] for k, axis in enumerate("xyz")}


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
    directions: Iterable[str] = tuple(DIRECTIONS),
) -> HoldForces:
    """Tugs a held target along directions of the grasp frame.

    Args:
        grip: the held target; every load starts from the same state of it.
        settings: loads.
        directions: some of `DIRECTIONS`.

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

    return _hold_forces(grip, _chosen(DIRECTIONS, directions), withstands, settings)


def shake(
    grip: Grip,
    settings: LoadSettings = LoadSettings(),
    *,
    axes: Iterable[str] = tuple(AXES),
) -> HoldForces:
    """Shakes a held target to and fro along the axes of the grasp frame.

    Args:
        grip: the held target; every load starts from the same state of it.
        settings: loads.
        axes: some of `AXES`.

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

    return _hold_forces(grip, _chosen(AXES, axes), withstands, settings)


def _chosen(known: Mapping[str, Array], names: Iterable[str]) -> dict[str, Array]:
    chosen = list(names)
    for name in chosen:
        if name not in known:
            raise UnknownNameError(f"direction {name!r} does not exist; {nearest(name, known)}")
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
