"""Where the hand goes: straight from the pregrasp to the grasp, and from there straight up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core.frames import Array, inverse
from burg_drake.grasping.poses import Poses


@dataclass(frozen=True, eq=False)
class LinePoses:
    """The hand's way, by its length from the grasp: negative on the way there, positive above it.

    Attributes:
        X_GH: (4, 4) hand body in the grasp frame.
        up_A: (3,) direction of the lift in the arm's base frame.
    """

    X_GH: Array
    up_A: Array

    @classmethod
    def of(cls, X_HG: Array, R_WA: Array) -> LinePoses:
        """From the grasp frame in the hand, and the arm's base in the world (3, 3)."""
        return cls(inverse(X_HG), R_WA[2].copy())

    def X_AH(self, X_AG: Array, way: Array) -> Array:
        """Poses of the hand body.

        Args:
            X_AG: (..., 4, 4) grasps in the arm's base frame.
            way: (...,) lengths [m].

        Returns:
            (..., 4, 4), with the leading shapes broadcast against each other.
        """
        shape = np.broadcast_shapes(X_AG.shape[:-2], way.shape)
        X = np.broadcast_to(X_AG, (*shape, 4, 4)).copy()
        length = np.broadcast_to(way, shape)[..., None]
        X[..., :3, 3] += np.minimum(length, 0.0) * X[..., :3, 2]
        X[..., :3, 3] += np.maximum(length, 0.0) * self.up_A
        placed = Poses.of(X) @ Poses.of(self.X_GH)
        X[..., :3, :3], X[..., :3, 3] = placed.R, placed.p
        return X
