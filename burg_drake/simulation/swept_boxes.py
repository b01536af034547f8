"""Bounding boxes of a hand and its target, swept along straight paths, against all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, inverse


@dataclass(frozen=True, eq=False)
class BoxSet:
    """Boxes in one frame.

    Attributes:
        X_FB: (K, 4, 4) their poses.
        half: (K, 3) their half sizes [m].
    """

    X_FB: Array
    half: Array

    def bounds(self, X_AF: Array) -> tuple[Array, Array]:
        """Lower and upper corners (N, K, 3) of boxes around them along the axes of a frame A, in
        which their own frame has poses (N, 4, 4)."""
        R_AF, p_AF = X_AF[:, None, :3, :3], X_AF[:, None, :3, 3]
        center = np.einsum("nkij,kj->nki", R_AF, self.X_FB[:, :3, 3]) + p_AF
        R_AB = np.einsum("nkij,kjl->nkil", R_AF, self.X_FB[:, :3, :3])
        reach = np.einsum("nkij,kj->nki", np.abs(R_AB), self.half)
        return center - reach, center + reach


@dataclass(frozen=True, eq=False)
class SweptBoxes:
    """What moves with the hand, and what does not.

    Attributes:
        hand: in the grasp frame G.
        target: in the target's frame O.
        others: in the world.
    """

    hand: BoxSet
    target: BoxSet
    others: BoxSet

    def are_apart(self, X_WG: Array, X_WO: Array, p_W: Array, min_gap: float) -> NDArray[np.bool_]:
        """Whether nothing that moves comes near anything else.

        Args:
            X_WG, X_WO: (N, 4, 4) grasp frame and target in the world.
            p_W: (N, 3) paths [m].
            min_gap: distance along an axis of world or hand that counts as near [m].

        Returns:
            (N,) values.
        """
        chunk = 256  # Paths at a time; bounds the memory to some tens of MB.
        parts = [slice(k, k + chunk) for k in range(0, len(p_W), chunk)]
        found = [self._are_apart(X_WG[at], X_WO[at], p_W[at], min_gap) for at in parts]
        return np.concatenate([np.zeros(0, dtype=bool), *found])

    def _are_apart(self, X_WG: Array, X_WO: Array, p_W: Array, min_gap: float) -> NDArray[np.bool_]:
        others = self.others.bounds(np.eye(4)[None])
        low, high = self._swept_bounds(X_WG, X_WO, p_W, min_gap)
        # Most paths are free already by one box around all that moves.
        around = low.min(axis=1, keepdims=True), high.max(axis=1, keepdims=True)
        near = np.asarray(_boxes_meet(around, others).any(axis=(1, 2)))
        rows = np.flatnonzero(near)
        pairs = _boxes_meet((low[rows], high[rows]), others)
        left = pairs.any(axis=(1, 2))
        near[rows], rows, pairs = left, rows[left], pairs[left]
        # Of tilted hands the boxes along their own axes are smaller.
        X_GW = inverse(X_WG[rows])
        p_G = np.einsum("nij,nj->ni", X_GW[:, :3, :3], p_W[rows])
        X_GG = np.tile(np.eye(4), (len(rows), 1, 1))
        moving = self._swept_bounds(X_GG, X_GW @ X_WO[rows], p_G, min_gap)
        near[rows] = (pairs & _boxes_meet(moving, self.others.bounds(X_GW))).any(axis=(1, 2))
        return ~near

    def _swept_bounds(
        self, X_AG: Array, X_AO: Array, p_A: Array, min_gap: float
    ) -> tuple[Array, Array]:
        """Lower and upper corners (N, K, 3), along the axes of a frame A, of boxes around all that
        moves and a gap."""
        bounds = self.hand.bounds(X_AG), self.target.bounds(X_AO)
        low, high = (np.concatenate(both, axis=1) for both in zip(*bounds, strict=True))
        low += np.minimum(p_A, 0.0)[:, None] - min_gap
        high += np.maximum(p_A, 0.0)[:, None] + min_gap
        return low, high


def _boxes_meet(a: tuple[Array, Array], b: tuple[Array, Array]) -> NDArray[np.bool_]:
    """(N, K, Q) whether boxes with corners (N, K, 3) meet boxes with corners (N, Q, 3)."""
    (a_low, a_high), (b_low, b_high) = a, b
    meet = (a_low[:, :, None] <= b_high[:, None]) & (a_high[:, :, None] >= b_low[:, None])
    return np.asarray(meet.all(axis=-1))
