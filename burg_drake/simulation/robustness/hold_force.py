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

from burg_drake.core import Array, InvalidInputError, UnknownNameError, nearest
from burg_drake.simulation.robustness.bisection import largest_passing
from burg_drake.simulation.robustness.grip import Grip

DIRECTIONS: dict[str, Array] = {
    f"{sign}{axis}": factor * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign, factor in (("+", 1.0), ("-", -1.0))
}
"""Directions (3,) in G: x closes the fingers, z approaches."""
AXES: dict[str, Array] = {axis: np.eye(3)[k] for k, axis in enumerate("xyz")}


@dataclass(frozen=True, kw_only=True)
class LoadSettings:
    """How a grip is loaded.

    Attributes:
        smallest, largest: accelerations that are tried [g].
        tolerance: relative distance between the largest that is borne and the next that is not.
        slide: the target has left its place when its point at the grasp has moved in the hand by
            more than this [m]; it has left, too, when a finger does not touch it.
        tug_rise: a tug grows to its full force in this time [s], which it then keeps ...
        tug_time: ... for this long [s]; less if the target is at rest under it.
        frequency: of shaking [Hz].
        periods: of shaking; the amplitude grows during the first one.
    """

    smallest: float = 0.05
    largest: float = 50.0
    tolerance: float = 0.03
    slide: float = 0.005
    tug_rise: float = 0.05
    tug_time: float = 0.2
    frequency: float = 5.0
    periods: int = 3

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest < self.largest:
            raise InvalidInputError(
                f"loads from {self.smallest:g} to {self.largest:g} g: must rise from above 0"
            )
        for name in ("tolerance", "slide", "tug_rise", "tug_time", "frequency", "periods"):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"{name} is {getattr(self, name):g}; give more than 0")


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

    def bears(direction: Array, amplitude: float) -> bool:
        return grip.withstands(
            lambda t: amplitude * min(1.0, t / settings.tug_rise) * direction,
            settings.tug_rise + settings.tug_time,
            settings.slide,
            steady_from=settings.tug_rise,
        )

    return _hold_forces(grip, _chosen(DIRECTIONS, directions), bears, settings)


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

    def bears(axis: Array, amplitude: float) -> bool:
        return grip.withstands(
            lambda t: amplitude * min(1.0, t * settings.frequency) * np.sin(omega * t) * axis,
            settings.periods / settings.frequency,
            settings.slide,
        )

    return _hold_forces(grip, _chosen(AXES, axes), bears, settings)


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
