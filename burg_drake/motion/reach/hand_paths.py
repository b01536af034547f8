"""What the hand alone decides about grasps: its straight ways with the fingers either way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.geometry import TOUCHING
from burg_drake.motion.reach.verdict import Reach
from burg_drake.motion.sweep import HandSweep, Sweep

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class HandVerdicts:
    """What the hand's ways decide about N grasps with the fingers either way.

    Attributes:
        no: (N, 2) what is in the way first; None where nothing is.
        clearance: (N, 2) of the hand on its way, negative where it is not free [m].
    """

    no: NDArray[np.object_]
    clearance: Array

    def __getitem__(self, chosen: Indices) -> HandVerdicts:
        return HandVerdicts(self.no[chosen].copy(), self.clearance[chosen].copy())

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """(N,) grasps that the hand gets to, or away from, with its fingers in neither way."""
        return np.asarray((self.clearance < 0.0).all(axis=1))

    def why(self, grasp: int) -> Reach:
        """Of one that is blocked; the first way to put the fingers decides."""
        said = next(no for no in self.no[grasp] if no is not None)
        assert isinstance(said, Reach)
        return said

    def put(self, way: int, rows: Indices, sweep: Sweep, outcome: Outcome) -> None:
        """Takes over what is in the way of some grasps (S,) with the fingers in one way."""
        blocked = np.minimum(sweep.clearance, -TOUCHING)
        room = np.where(sweep.free, np.maximum(sweep.clearance, 0.0), blocked)
        self.clearance[rows, way] = np.minimum(self.clearance[rows, way], room)
        for k in np.flatnonzero(~sweep.free):
            self.no[rows[k], way] = Reach(outcome, str(sweep.blocker[k]), float(sweep.clearance[k]))


@dataclass(frozen=True, eq=False)
class HandPaths:
    """N grasps whose hand's ways are judged.

    Attributes:
        sweep: the hand in its scene.
        instance: (N,) names of the targets; "" without one.
        X_both: (N, 2, 4, 4) grasps in the world with their fingers either way.
        width: (N,) distances between the pads that hold the target [m].
        retreats: whether the hand goes back before it is lifted.
    """

    sweep: HandSweep
    instance: NDArray[np.object_]
    X_both: Array
    width: Array
    retreats: bool

    def __getitem__(self, chosen: Indices) -> Self:
        return type(self)(
            self.sweep,
            self.instance[chosen],
            self.X_both[chosen],
            self.width[chosen],
            self.retreats,
        )

    def before_lift(self) -> HandVerdicts:
        """Approach and retreat."""
        shape = self.X_both.shape[:2]
        found = HandVerdicts(np.full(shape, None, dtype=object), np.full(shape, np.inf))
        for name, way, at in self._asked(found):
            sweep = self.sweep.approach(name, self.X_both[at, way])
            found.put(way, at, sweep, Outcome.HAND_COLLISION_APPROACH)
        for name, way, at in self._asked(found) if self.retreats else ():
            sweep = self.sweep.retreat(name, self.X_both[at, way], self.width[at])
            found.put(way, at, sweep, Outcome.HAND_COLLISION_RETREAT)
        return self._mirrored(found)

    def lifted(self, before: HandVerdicts, height: float) -> HandVerdicts:
        """The same with the lift to a height [m]."""
        found = before[np.arange(len(before.no))]
        for name, way, at in self._asked(found):
            sweep = self.sweep.lift(name, self.X_both[at, way], self.width[at], height)
            found.put(way, at, sweep, Outcome.HAND_COLLISION_LIFT)
        return self._mirrored(found)

    def _asked(self, found: HandVerdicts) -> list[tuple[str, int, Indices]]:
        """Targets, ways to put the fingers, and the grasps that are free so far."""
        ways = (0,) if self.sweep.symmetric else (0, 1)
        return [
            (name, way, np.flatnonzero((self.instance == name) & (found.clearance[:, way] >= 0.0)))
            for name in dict.fromkeys(self.instance.tolist())
            for way in ways
        ]

    def _mirrored(self, found: HandVerdicts) -> HandVerdicts:
        if self.sweep.symmetric:
            found.clearance[:, 1], found.no[:, 1] = found.clearance[:, 0], found.no[:, 0]
        return found
