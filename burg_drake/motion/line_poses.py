"""Hand poses along the straight segments of a grasp, and dense rows of arm positions between."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, Outcome, inverse
from burg_drake.geometry import Poses, rotate
from burg_drake.motion.line_search import Chain
from burg_drake.motion.motion_settings import ReachSettings
from burg_drake.motion.numeric_ik import ArmKinematics, solve_ik
from burg_drake.motion.panda_ik import IK_BRANCHES, PandaIk, panda_forward
from burg_drake.station import GraspMotion


@dataclass(frozen=True, eq=False)
class HandPath:
    """The hand's path, by its length from the grasp: negative before the grasp, positive after it.

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
    def of(cls, X_HG: Array, R_WA: Array, motion: GraspMotion) -> HandPath:
        """The path with the whole lift.

        Args:
            X_HG: (4, 4) grasp frame in the hand.
            R_WA: (3, 3) the arm's base in the world.
            motion: the straight segments.
        """
        lengths = motion.standoff, motion.retreat, motion.lift_height
        return cls(inverse(X_HG), R_WA.copy(), motion.direction_W, *lengths)

    @property
    def layers(self) -> Array:
        """(L,) path lengths at which postures are computed [m], from pregrasp to the top of the
        lift, at most 5 cm apart; they include the grasp and the end of the retreat."""
        approach, retreat, lift = map(_layer_distances, (self.standoff, self.retreat, self.lift))
        return np.concatenate([-approach[:0:-1], retreat, self.retreat + lift[1:]])

    @property
    def at_grasp(self) -> int:
        """Index of the layer at the grasp."""
        return len(_layer_distances(self.standoff)) - 1

    @property
    def at_retreated(self) -> int:
        """Index of the layer at the end of the retreat, where the lift begins."""
        return self.at_grasp + len(_layer_distances(self.retreat)) - 1

    def outcome(self, layer: int) -> Outcome:
        """Outcome of an arm that cannot move from the layer before to this one."""
        if layer <= self.at_grasp:
            return Outcome.APPROACH_LINE
        return Outcome.RETREAT_LINE if layer <= self.at_retreated else Outcome.LIFT_LINE

    def segment_end(self, layer: int) -> int:
        """Index of the last layer of the segment that leads to a layer."""
        ends = self.at_grasp, self.at_retreated, len(self.layers) - 1
        return next(end for end in ends if layer <= end)

    def X_AH(self, X_AG: Array, distance: Array) -> Array:
        """Poses of the hand body.

        Args:
            X_AG: (..., 4, 4) grasps in the arm's base frame.
            distance: (...,) path lengths from the grasp [m].

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

    def chain(
        self, X_AG: Array, flip: int, rows: DenseRows, own: slice, lower: Array, place: Any
    ) -> Chain:
        """Makes a chain of its rows.

        Args:
            X_AG: (4, 4) grasp in the arm's base frame.
            flip: finger assignment, 0 or 1.
            rows: rows of several chains.
            own: the rows of this chain.
            lower: lower bounds of the clearance at all rows [m].
            place: see `Chain`.
        """
        layer = rows.layer[own]
        length = np.interp(layer, np.arange(len(self.layers)), self.layers)
        return Chain(
            flip=flip,
            q=rows.q[own],
            at_grasp=int(np.searchsorted(layer, self.at_grasp)),
            at_retreated=int(np.searchsorted(layer, self.at_retreated)),
            moved_W=self.target_displacement(X_AG, length),
            lower=lower[own],
            place=place,
        )

    def target_displacement(self, X_AG: Array, distance: Array) -> Array:
        """Displacement of the grasped target in the world.

        Args:
            X_AG: (..., 4, 4) grasps in the arm's base frame.
            distance: (...,) path lengths from the grasp [m].

        Returns:
            (..., 3) [m]; 0 up to the grasp.
        """
        length = distance[..., None]
        approach_W = rotate(self.R_WA, X_AG[..., :3, 2])
        back = -np.clip(length, 0.0, self.retreat) * approach_W
        return np.asarray(back + np.maximum(length - self.retreat, 0.0) * self.direction_W)


def _layer_distances(length: float) -> Array:
    """Distances from 0 to `length` [m]; only 0 if `length` is 0."""
    max_spacing = 0.05  # Metres between poses at which postures are computed.
    return np.linspace(0.0, length, int(np.ceil(length / max_spacing - 1e-9)) + 1)


MAX_JOINT_JUMP = 0.35
"""Radians between rows. Rows farther apart are on different branches."""


@dataclass(frozen=True, eq=False)
class DenseRows:
    """Arm positions of m chains, ordered by chain, then along the path.

    Attributes:
        chain: (K,) indices of the chains.
        layer: (K,) position of a row along its chain, in layers and fractions between them.
        q: (K, n) joint positions [rad].
        broken: (K,) whether no posture was found, or it jumps from the row before.
    """

    chain: Indices
    layer: Array
    q: Array
    broken: NDArray[np.bool_]

    def slice_of(self, chain: int) -> slice:
        """The rows of one chain."""
        return slice(*np.searchsorted(self.chain, [chain, chain + 1]))

    def replaced(self, chains: Indices, other: DenseRows) -> DenseRows:
        """Copy with the rows of `chains` replaced by `other`, which numbers them from 0."""
        kept = ~np.isin(self.chain, chains)
        chain = np.append(self.chain[kept], chains[other.chain])
        order = np.argsort(chain, kind="stable")
        return DenseRows(
            chain[order],
            np.append(self.layer[kept], other.layer)[order],
            np.concatenate([self.q[kept], other.q])[order],
            np.append(self.broken[kept], other.broken)[order],
        )


def straighten_rows(filler: RowFiller, at: Array, tolerance: Array) -> DenseRows:
    """Fills in rows between the layers of chains until the hand moves straight.

    Args:
        filler: the chains.
        at: (R,) positions of the first rows, as layers and fractions between them.
        tolerance: (m,) largest deviation of the hand from the straight segment half-way between
            two rows [m].

    Returns:
        The rows.
    """
    m = len(filler.X_AG)
    chain, layer = np.repeat(np.arange(m), len(at)), np.tile(at, m)
    q, broken = filler.solve(chain, layer)
    for _ in range(6):  # from 1 cm down to 0.2 mm
        first = np.flatnonzero((chain[1:] == chain[:-1]) & ~broken[1:] & ~broken[:-1])
        if len(at) < 2 or not len(first):
            break
        middle = 0.5 * (layer[first] + layer[first + 1])
        half_way = 0.5 * (q[first] + q[first + 1])
        # Where the hand strays, a row is inserted half-way; earlier rows do not change.
        astray = filler.deviation(chain[first], middle, half_way) > tolerance[chain[first]]
        if not astray.any():
            break
        new_chain, new_layer = chain[first][astray], middle[astray]
        new_q, new_broken = filler.solve(new_chain, new_layer)
        order = np.lexsort((np.append(layer, new_layer), np.append(chain, new_chain)))
        chain = np.append(chain, new_chain)[order]
        layer = np.append(layer, new_layer)[order]
        q = np.concatenate([q, new_q])[order]
        broken = np.append(broken, new_broken)[order]
    jump = np.zeros(len(q), dtype=bool)
    jump[1:] = (np.abs(np.diff(q, axis=0)).max(axis=1) > MAX_JOINT_JUMP) & (chain[1:] == chain[:-1])
    return DenseRows(chain, layer, q, broken | jump)


@dataclass(frozen=True, eq=False)
class RowFiller(ABC):
    """Finds arm positions between the layers of chains.

    Attributes:
        lines: the hand's path.
        X_AG: (m, 4, 4) grasps in the arm's base frame.
        corners: (m, L, n) joint positions at the layers [rad].
        layers: (L,) path lengths of the layers from the grasp [m].
    """

    hand_path: HandPath
    X_AG: Array
    corners: Array
    layers: Array

    @abstractmethod
    def solve(self, chain: Indices, layer: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Postures (K, n) nearest to the interpolated ones, and whether none is near enough (K,).
        In that case the interpolated posture is returned."""

    @abstractmethod
    def forward(self, q: Array) -> Array:
        """Poses of the hand body (K, 4, 4) in the arm's base frame."""

    def deviation(self, chain: Indices, layer: Array, q: Array) -> Array:
        """Deviation of the hand from its wanted poses (K,) [m]."""
        lever = 0.2  # Metres from H to the finger tips, whose motion a rotation counts as.
        X, wanted = self.forward(q), self.X_AH(chain, layer)
        p = X[:, :3, 3] - wanted[:, :3, 3]
        R = X[:, :3, :3] - wanted[:, :3, :3]
        distance = np.sqrt((p * p).sum(axis=1))
        return np.asarray(distance + lever * np.sqrt(0.5 * (R * R).sum(axis=(1, 2))))

    def interpolate(self, chain: Indices, layer: Array) -> Array:
        """Joint positions (K, n), interpolated linearly between the layers."""
        below = np.minimum(layer.astype(np.intp), max(0, self.corners.shape[1] - 2))
        above = np.minimum(below + 1, self.corners.shape[1] - 1)
        share = (layer - below)[:, None]
        return np.asarray(
            (1.0 - share) * self.corners[chain, below] + share * self.corners[chain, above]
        )

    def X_AH(self, chain: Indices, layer: Array) -> Array:
        """Wanted poses of the hand body (K, 4, 4) in the arm's base frame."""
        length = np.interp(layer, np.arange(len(self.layers)), self.layers)
        return self.hand_path.X_AH(self.X_AG[chain], length)


@dataclass(frozen=True, eq=False)
class ClosedFormFiller(RowFiller):
    """Solves with the closed-form inverse kinematics of the Panda."""

    ik: PandaIk

    def solve(self, chain: Indices, layer: Array) -> tuple[Array, NDArray[np.bool_]]:
        """See `RowFiller`; the redundant joint has the interpolated value."""
        expected = self.interpolate(chain, layer)
        found = self.ik.solve(self.X_AH(chain, layer), expected[:, -1:])
        q = np.full((len(chain), IK_BRANCHES, expected.shape[1]), np.inf)
        q[found.pose, found.branch] = found.q
        distance = np.abs(q - expected[:, None]).max(axis=-1)
        nearest = distance.argmin(axis=1)
        every = np.arange(len(chain))
        broken = ~(distance[every, nearest] <= MAX_JOINT_JUMP)
        return np.where(broken[:, None], expected, q[every, nearest]), broken

    def forward(self, q: Array) -> Array:
        """See `RowFiller`."""
        return panda_forward(q) @ self.ik.X_FH


@dataclass(frozen=True, eq=False)
class NumericFiller(RowFiller):
    """Solves numerically, starting from the interpolated postures."""

    arm: ArmKinematics
    settings: ReachSettings

    def solve(self, chain: Indices, layer: Array) -> tuple[Array, NDArray[np.bool_]]:
        """See `RowFiller`."""
        expected = self.interpolate(chain, layer)
        q, met = solve_ik_near(self.arm, self.X_AH(chain, layer), expected, self.settings)
        broken = ~met | (np.abs(q - expected).max(axis=1) > MAX_JOINT_JUMP)
        return np.where(broken[:, None], expected, q), broken

    def forward(self, q: Array) -> Array:
        """See `RowFiller`."""
        return self.arm.forward(q)[0]


def solve_ik_near(
    arm: ArmKinematics, X_AH: Array, start: Array, settings: ReachSettings
) -> tuple[Array, NDArray[np.bool_]]:
    """Solves numerically for hand poses (S, 4, 4) from near postures `start`; returns postures
    (S, n) and whether they meet the poses (S,)."""
    return solve_ik(
        arm,
        X_AH,
        start,
        iterations=settings.iterations,
        tolerance=settings.tolerance,
        margin=settings.limit_margin,
    )
