"""Where the hand goes: straight from the pregrasp to the grasp, straight back along the approach,
and from there straight along the lift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, inverse
from burg_drake.core.grasps import Outcome
from burg_drake.geometry import Poses, rotate
from burg_drake.station.document import GraspMotion

LAYER = 0.05
"""Largest distance between two poses at which postures of the arm are looked for [m]."""


@dataclass(frozen=True, eq=False)
class LinePoses:
    """The hand's way, by its length from the grasp: negative on the way there, positive after it.

    Attributes:
        X_GH: (4, 4) hand body in the grasp frame.
        R_WA: (3, 3) the arm's base in the world.
        direction_W: (3,) unit vector of the lift.
        standoff, retreat, lift: lengths of the three straight segments [m].
    """

    X_GH: Array
    R_WA: Array
    direction_W: Array
    standoff: float
    retreat: float
    lift: float

    @classmethod
    def of(cls, X_HG: Array, R_WA: Array, motion: GraspMotion) -> LinePoses:
        """With the whole lift.

        Args:
            X_HG: (4, 4) grasp frame in the hand.
            R_WA: (3, 3) the arm's base in the world.
            motion: the ways.
        """
        lengths = motion.standoff, motion.retreat, motion.lift_height
        return cls(inverse(X_HG), R_WA.copy(), motion.direction_W, *lengths)

    @property
    def layers(self) -> Array:
        """(L,) lengths at which postures of the arm are looked for, from pregrasp to the top of the
        lift, at most `LAYER` apart; grasp and end of the retreat are among them [m]."""
        approach, retreat, lift = map(_layers, (self.standoff, self.retreat, self.lift))
        return np.concatenate([-approach[:0:-1], retreat, self.retreat + lift[1:]])

    @property
    def at_grasp(self) -> int:
        """Which of the layers is the grasp."""
        return len(_layers(self.standoff)) - 1

    @property
    def at_retreated(self) -> int:
        """Which of the layers is the end of the retreat, where the lift begins."""
        return self.at_grasp + len(_layers(self.retreat)) - 1

    def outcome(self, layer: int) -> Outcome:
        """What is said of an arm that gets no further than to the layer before this one."""
        if layer <= self.at_grasp:
            return Outcome.APPROACH_LINE
        return Outcome.RETREAT_LINE if layer <= self.at_retreated else Outcome.LIFT_LINE

    def X_AH(self, X_AG: Array, distance: Array) -> Array:
        """Poses of the hand body.

        Args:
            X_AG: (..., 4, 4) grasps in the arm's base frame.
            distance: (...,) lengths [m].

        Returns:
            (..., 4, 4), with the leading shapes broadcast against each other.
        """
        shape = np.broadcast_shapes(X_AG.shape[:-2], distance.shape)
        X = np.broadcast_to(X_AG, (*shape, 4, 4)).copy()
        length = np.broadcast_to(distance, shape)[..., None]
        along = np.minimum(length, 0.0) - np.clip(length, 0.0, self.retreat)
        X[..., :3, 3] += along * X[..., :3, 2]
        X[..., :3, 3] += np.maximum(length - self.retreat, 0.0) * (self.direction_W @ self.R_WA)
        placed = Poses.of(X) @ Poses.of(self.X_GH)
        X[..., :3, :3], X[..., :3, 3] = placed.R, placed.p
        return X

    def carried(self, X_AG: Array, distance: Array) -> Array:
        """How far what the hand holds from the grasp on has been moved in the world.

        Args:
            X_AG: (..., 4, 4) grasps in the arm's base frame.
            distance: (...,) lengths [m].

        Returns:
            (..., 3) [m]; 0 up to the grasp.
        """
        length = distance[..., None]
        approach_W = rotate(self.R_WA, X_AG[..., :3, 2])
        back = -np.clip(length, 0.0, self.retreat) * approach_W
        return np.asarray(back + np.maximum(length - self.retreat, 0.0) * self.direction_W)


def _layers(length: float) -> Array:
    """Distances from 0 to `length` [m]; 0 alone if that is 0."""
    return np.linspace(0.0, length, int(np.ceil(length / LAYER - 1e-9)) + 1)
