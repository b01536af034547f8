"""Rows of arm positions between the postures of a chain, so dense that the hand goes straight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.motion.ik import BRANCHES, ArmKinematics, PandaIk, panda_forward, solve_ik
from burg_drake.motion.lines.line_poses import LinePoses
from burg_drake.motion.lines.reach_settings import ReachSettings

JUMP = 0.35
"""Joint positions that differ by more than this from row to row are on other branches [rad]."""
HALVINGS = 6
"""How often the way between two rows is halved at most; from 1 cm down to 0.2 mm."""
LEVER = 0.2
"""A turn of the hand counts as the way of a point at this distance from H [m]: finger tips."""


@dataclass(frozen=True, eq=False)
class DenseRows:
    """Arm positions of m chains, in the order of the chains and their ways.

    Attributes:
        chain: (K,) indices of the chains.
        layer: (K,) where a row is between the layers of its chain.
        q: (K, n) joint positions [rad].
        broken: (K,) whether there is none, or one that jumps from the row before.
    """

    chain: Indices
    layer: Array
    q: Array
    broken: NDArray[np.bool_]

    def of(self, chain: int) -> slice:
        """Rows of one chain."""
        return slice(*np.searchsorted(self.chain, [chain, chain + 1]))

    def replaced(self, chains: Indices, other: DenseRows) -> DenseRows:
        """With those of some chains, which are numbered from 0 there, in place of the own ones."""
        kept = ~np.isin(self.chain, chains)
        chain = np.append(self.chain[kept], chains[other.chain])
        order = np.argsort(chain, kind="stable")
        return DenseRows(
            chain[order],
            np.append(self.layer[kept], other.layer)[order],
            np.concatenate([self.q[kept], other.q])[order],
            np.append(self.broken[kept], other.broken)[order],
        )


def straighten(every: Filler, at: Array, tolerance: Array) -> DenseRows:
    """Fills in rows between the layers of chains.

    Args:
        every: the chains.
        at: (R,) where rows are wanted at least, as layers and fractions between them.
        tolerance: (m,) how far the hand may be beside the straight segment half-way between two
            rows [m].

    Returns:
        The rows.
    """
    m = len(every.X_AG)
    chain, layer = np.repeat(np.arange(m), len(at)), np.tile(at, m)
    q, broken = every.solve(chain, layer)
    for _ in range(HALVINGS):
        first = np.flatnonzero((chain[1:] == chain[:-1]) & ~broken[1:] & ~broken[:-1])
        if len(at) < 2 or not len(first):
            break
        middle = 0.5 * (layer[first] + layer[first + 1])
        half_way = 0.5 * (q[first] + q[first + 1])
        # A row half-way is put in where the hand strays; what has been looked at stays as it is.
        astray = every.deviation(chain[first], middle, half_way) > tolerance[chain[first]]
        if not astray.any():
            break
        new_chain, new_layer = chain[first][astray], middle[astray]
        new_q, new_broken = every.solve(new_chain, new_layer)
        order = np.lexsort((np.append(layer, new_layer), np.append(chain, new_chain)))
        chain = np.append(chain, new_chain)[order]
        layer = np.append(layer, new_layer)[order]
        q = np.concatenate([q, new_q])[order]
        broken = np.append(broken, new_broken)[order]
    jump = np.zeros(len(q), dtype=bool)
    jump[1:] = (np.abs(np.diff(q, axis=0)).max(axis=1) > JUMP) & (chain[1:] == chain[:-1])
    return DenseRows(chain, layer, q, broken | jump)


@dataclass(frozen=True, eq=False)
class Filler(ABC):
    """Finds arm positions between the layers of chains.

    Attributes:
        lines: where the hand goes.
        X_AG: (m, 4, 4) grasps in the arm's base frame.
        corners: (m, L, n) joint positions at the layers [rad].
        layers: (L,) their lengths from the grasp [m].
    """

    lines: LinePoses
    X_AG: Array
    corners: Array
    layers: Array

    @abstractmethod
    def solve(self, chain: Indices, layer: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The posture at each of K places that is nearest to what lies between the layers, (K, n),
        and whether there is none that near (K,); what lies between stands in for it then."""

    @abstractmethod
    def forward(self, q: Array) -> Array:
        """Poses of the hand body (K, 4, 4) in the arm's base frame."""

    def deviation(self, chain: Indices, layer: Array, q: Array) -> Array:
        """How far the hand is from where it should be (K,) [m]."""
        X, wanted = self.forward(q), self.X_AH(chain, layer)
        p = X[:, :3, 3] - wanted[:, :3, 3]
        R = X[:, :3, :3] - wanted[:, :3, :3]
        distance = np.sqrt((p * p).sum(axis=1))
        return np.asarray(distance + LEVER * np.sqrt(0.5 * (R * R).sum(axis=(1, 2))))

    def between(self, chain: Indices, layer: Array) -> Array:
        """What lies between the layers (K, n)."""
        below = np.minimum(layer.astype(np.intp), max(0, self.corners.shape[1] - 2))
        above = np.minimum(below + 1, self.corners.shape[1] - 1)
        share = (layer - below)[:, None]
        return np.asarray(
            (1.0 - share) * self.corners[chain, below] + share * self.corners[chain, above]
        )

    def X_AH(self, chain: Indices, layer: Array) -> Array:
        """Wanted poses of the hand body (K, 4, 4) in the arm's base frame."""
        length = np.interp(layer, np.arange(len(self.layers)), self.layers)
        return self.lines.X_AH(self.X_AG[chain], length)


@dataclass(frozen=True, eq=False)
class ClosedFormFiller(Filler):
    """By the inverse kinematics of the Panda."""

    ik: PandaIk

    def solve(self, chain: Indices, layer: Array) -> tuple[Array, NDArray[np.bool_]]:
        """See `Filler`; the redundant joint has the value between the layers."""
        expected = self.between(chain, layer)
        found = self.ik.solve(self.X_AH(chain, layer), expected[:, -1:])
        q = np.full((len(chain), BRANCHES, expected.shape[1]), np.inf)
        q[found.pose, found.branch] = found.q
        distance = np.abs(q - expected[:, None]).max(axis=-1)
        nearest = distance.argmin(axis=1)
        every = np.arange(len(chain))
        broken = ~(distance[every, nearest] <= JUMP)
        return np.where(broken[:, None], expected, q[every, nearest]), broken

    def forward(self, q: Array) -> Array:
        """See `Filler`."""
        return panda_forward(q) @ self.ik.X_FH


@dataclass(frozen=True, eq=False)
class NumericFiller(Filler):
    """By steps from what lies between the layers."""

    arm: ArmKinematics
    settings: ReachSettings

    def solve(self, chain: Indices, layer: Array) -> tuple[Array, NDArray[np.bool_]]:
        """See `Filler`."""
        expected = self.between(chain, layer)
        q, met = near_ik(self.arm, self.X_AH(chain, layer), expected, self.settings)
        broken = ~met | (np.abs(q - expected).max(axis=1) > JUMP)
        return np.where(broken[:, None], expected, q), broken

    def forward(self, q: Array) -> Array:
        """See `Filler`."""
        return self.arm.forward(q)[0]


def near_ik(
    arm: ArmKinematics, X_AH: Array, start: Array, settings: ReachSettings
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures (S, n) at hand poses (S, 4, 4) by steps from near postures, and whether they meet
    them (S,)."""
    return solve_ik(
        arm,
        X_AH,
        start,
        iterations=settings.iterations,
        tolerance=settings.tolerance,
        margin=settings.limit_margin,
    )
