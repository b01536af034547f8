"""How far objects have been moved from where they stood."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context

from burg_drake.core import Array


class MassCenterTracker:
    """Watches centres of mass.

    Args:
        plant: the plant.
        plant_context: its Context, with the bodies where they stand.
        bodies: which to watch.

    Attributes:
        peaks: largest displacement of each body since the start [m].
    """

    def __init__(
        self, plant: MultibodyPlant, plant_context: Context, bodies: Iterable[BodyIndex]
    ) -> None:
        self._plant = plant
        self._plant_context = plant_context
        self._start = {i: self._center(i) for i in bodies}
        self._last = dict(self._start)
        self.peaks = dict.fromkeys(self._start, 0.0)

    @property
    def largest(self) -> float:
        """The largest of the peaks [m]; 0 without bodies."""
        return max(self.peaks.values(), default=0.0)

    def update(self, still: Collection[BodyIndex]) -> float:
        """Measures; those in `still` are at rest.

        Returns:
            The largest motion of a body since the last look [m].
        """
        largest = 0.0
        for index in self.peaks.keys() - still:
            center = self._center(index)
            displacement = float(np.linalg.norm(center - self._start[index]))
            self.peaks[index] = max(self.peaks[index], displacement)
            largest = max(largest, float(np.linalg.norm(center - self._last[index])))
            self._last[index] = center
        return largest

    def by_name(self, bodies: Mapping[str, BodyIndex]) -> dict[str, float]:
        """Peaks of some of the bodies by their names [m]."""
        return {name: self.peaks[index] for name, index in bodies.items()}

    def _center(self, index: BodyIndex) -> Array:
        return center_of_mass(self._plant, self._plant_context, self._plant.get_body(index))


def center_of_mass(plant: MultibodyPlant, plant_context: Context, body: RigidBody) -> Array:
    """Centre of mass (3,) of a body in the world [m]."""
    X_WB = plant.EvalBodyPoseInWorld(plant_context, body)
    p_WCm: Array = X_WB.multiply(body.default_com())
    return p_WCm
