"""Bounding boxes of a hand and its target, swept along straight paths, against all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array


@dataclass(frozen=True, eq=False)
class BoxSet:
    """Boxes in one frame.

    Attributes:
        X_FB: (K, 4, 4) their poses.
        half: (K, 3) their half sizes [m].
    """

    X_FB: Array
    half: Array

    def bounds(self, X_WF: Array) -> tuple[Array, Array]:
        """Lower and upper corners (N, K, 3) of the world-aligned boxes around them, with their
        frame at poses (N, 4, 4)."""
        R_WF, p_WF = X_WF[:, None, :3, :3], X_WF[:, None, :3, 3]
        center = np.einsum("nkij,kj->nki", R_WF, self.X_FB[:, :3, 3]) + p_WF
        R_WB = np.einsum("nkij,kjl->nkil", R_WF, self.X_FB[:, :3, :3])
        reach = np.einsum("nkij,kj->nki", np.abs(R_WB), self.half)
        return center - reach, center + reach


@dataclass(frozen=True, eq=False)
class SweptBoxes:
    """What moves with the hand, and what does not.

    Attributes:
        hand: in the grasp frame G.
        target: in the target's frame O.
        low, high: (Q, 3) corners of the world-aligned boxes of all others [m].
    """

    hand: BoxSet
    target: BoxSet
    low: Array
    high: Array

    def are_apart(self, X_WG: Array, X_WO: Array, p_W: Array, min_gap: float) -> NDArray[np.bool_]:
        """Whether nothing that moves comes near anything else.

        Args:
            X_WG, X_WO: (N, 4, 4) grasp frame and target in the world.
            p_W: (N, 3) paths [m].
            min_gap: distance in each direction that counts as near [m].

        Returns:
            (N,) values.
        """
        chunk = 256  # Paths at a time; bounds the memory to some tens of MB.
        parts = [slice(k, k + chunk) for k in range(0, len(p_W), chunk)]
        found = [self._are_apart(X_WG[at], X_WO[at], p_W[at], min_gap) for at in parts]
        return np.concatenate([np.zeros(0, dtype=bool), *found])

    def _are_apart(self, X_WG: Array, X_WO: Array, p_W: Array, min_gap: float) -> NDArray[np.bool_]:
        bounds = self.hand.bounds(X_WG), self.target.bounds(X_WO)
        low, high = (np.concatenate(both, axis=1) for both in zip(*bounds, strict=True))
        low = low + np.minimum(p_W, 0.0)[:, None] - min_gap
        high = high + np.maximum(p_W, 0.0)[:, None] + min_gap
        # Most paths are free already by one box around all that moves.
        near = self._meet(low.min(axis=1)[:, None], high.max(axis=1)[:, None])
        rows = np.flatnonzero(near)
        near[rows] = self._meet(low[rows], high[rows])
        return ~near

    def _meet(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """(N,) whether one of the boxes (N, K, 3) meets one of the others."""
        meet = np.ones((*low.shape[:2], len(self.low)), dtype=bool)
        for axis in range(3):
            meet &= low[..., axis, None] <= self.high[:, axis]
            meet &= high[..., axis, None] >= self.low[:, axis]
        return np.asarray(meet.any(axis=(1, 2)))
