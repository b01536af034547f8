"""What the hand alone decides about grasps: its straight segments with the fingers either way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.core.grasps import Outcome
from burg_drake.geometry import TOUCHING
from burg_drake.motion.reach.verdict import Reach
from burg_drake.motion.sweep import HandSweep, Sweep


@dataclass(frozen=True, eq=False)
class HandVerdicts:
    """What the hand's ways decide about N grasps with the fingers either way.

    Attributes:
        blocked_by: (N, 2) what is in the way first; None where nothing is.
        clearance: (N, 2) of the hand on its way, negative where it is not free [m].
    """

    blocked_by: NDArray[np.object_]
    clearance: Array

    def __getitem__(self, chosen: Indices) -> HandVerdicts:
        return HandVerdicts(self.blocked_by[chosen].copy(), self.clearance[chosen].copy())

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """(N,) grasps that the hand gets to, or away from, with its fingers in neither way."""
        return np.asarray((self.clearance < 0.0).all(axis=1))

    def refusal(self, grasp: int) -> Reach:
        """Of one that is blocked; the first way to put the fingers decides."""
        said = next(no for no in self.blocked_by[grasp] if no is not None)
        assert isinstance(said, Reach)
        return said

    def put(self, flip: int, rows: Indices, sweep: Sweep, outcome: Outcome) -> None:
        """Takes over what is in the way of some grasps (S,) with the fingers in one way."""
        blocked = np.minimum(sweep.clearance, -TOUCHING)
        room = np.where(sweep.free, np.maximum(sweep.clearance, 0.0), blocked)
        self.clearance[rows, flip] = np.minimum(self.clearance[rows, flip], room)
        for k in np.flatnonzero(~sweep.free):
            self.blocked_by[rows[k], flip] = Reach(
                outcome, str(sweep.blocker[k]), float(sweep.clearance[k])
            )


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
        for name, flip, at in self._to_check(found):
            sweep = self.sweep.approach(name, self.X_both[at, flip])
            found.put(flip, at, sweep, Outcome.HAND_COLLISION_APPROACH)
        for name, flip, at in self._to_check(found) if self.retreats else ():
            sweep = self.sweep.retreat(name, self.X_both[at, flip], self.width[at])
            found.put(flip, at, sweep, Outcome.HAND_COLLISION_RETREAT)
        return self._mirrored(found)

    def lifted(self, before: HandVerdicts, height: float) -> HandVerdicts:
        """The same with the lift to a height [m]."""
        found = before[np.arange(len(before.blocked_by))]
        for name, flip, at in self._to_check(found):
            sweep = self.sweep.lift(name, self.X_both[at, flip], self.width[at], height)
            found.put(flip, at, sweep, Outcome.HAND_COLLISION_LIFT)
        return self._mirrored(found)

    def _to_check(self, found: HandVerdicts) -> list[tuple[str, int, Indices]]:
        """Targets, ways to put the fingers, and the grasps that are free so far."""
        flips = (0,) if self.sweep.symmetric else (0, 1)
        return [
            (
                name,
                flip,
                np.flatnonzero((self.instance == name) & (found.clearance[:, flip] >= 0.0)),
            )
            for name in dict.fromkeys(self.instance.tolist())
            for flip in flips
        ]

    def _mirrored(self, found: HandVerdicts) -> HandVerdicts:
        if self.sweep.symmetric:
            found.clearance[:, 1], found.blocked_by[:, 1] = (
                found.clearance[:, 0],
                found.blocked_by[:, 0],
            )
        return found
