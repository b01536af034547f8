"""Moves a grasped object past all others: back along the approach, and along the lift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, make_pose
from burg_drake.geometry import CONTACT_TOLERANCE, Body, HandScreen, swept_body


@dataclass(frozen=True, eq=False)
class PathBlockers:
    """What is in the way of an object on N ways.

    Attributes:
        by: (N,) the first body, in order of their names given, that it gets too deep into; "" where
            the way is free.
        depth: (N,) deepest overlap with it [m]; 0 where the way is free.
        at: (N,) how far along the way that is [m]; NaN where the way is free.
    """

    by: NDArray[np.object_]
    depth: Array
    at: Array

    @classmethod
    def nowhere(cls, n: int) -> PathBlockers:
        """On none of n ways."""
        return cls(np.full(n, "", dtype=object), np.zeros(n), np.full(n, np.nan))

    def repeated(self, n: int) -> PathBlockers:
        """The only way n times."""
        return PathBlockers(np.repeat(self.by, n), np.repeat(self.depth, n), np.repeat(self.at, n))


class TargetSweep:
    """Moves one object, which does not turn.

    Args:
        target: where it stands.
        others: where they stand, those that decide first.
    """

    def __init__(self, target: Body, others: Mapping[str, Body]) -> None:
        self._target = target
        self._X_WO = make_pose(target.X_WB.R, target.X_WB.p)
        self._still = HandScreen(target.pieces, others)
        self._boxes = {name: swept_body(body, np.zeros(3)) for name, body in others.items()}
        self._box = swept_body(target, np.zeros(3))
        self._others = dict(others)
        self._depths_allowed: dict[str, float] = {}
        self._lifts: dict[float, HandScreen] = {}

    def retreat(self, u_W: Array, length: float) -> PathBlockers:
        """From its place straight along unit vectors (N, 3) in the world by a length [m]."""
        found = PathBlockers.nowhere(len(u_W))
        ends = (
            self._box.low + np.minimum(length * u_W, 0.0),
            self._box.high + np.maximum(length * u_W, 0.0),
        )
        for name, box in self._boxes.items():
            near = (ends[0] <= box.high).all(axis=1) & (ends[1] >= box.low).all(axis=1)
            rows = np.flatnonzero(near & (found.by == ""))
            self._check(name, found, rows, np.zeros((len(rows), 3)), u_W[rows], length)
        return found

    def lift(
        self, start_W: Array, u_W: Array, height: float, swept: Mapping[str, Body]
    ) -> PathBlockers:
        """From beside its place straight along one direction.

        Args:
            start_W: (N, 3) how far it has been moved before [m].
            u_W: (3,) unit vector in the world.
            height: length of the way [m].
            swept: what the others sweep where they move against it by that length instead.
        """
        if height not in self._lifts:
            below = {name: swept[name] for name in self._boxes}
            self._lifts[height] = HandScreen(self._target.pieces, below)
        screen = self._lifts[height]
        found = PathBlockers.nowhere(len(start_W))
        path = self._poses(start_W)
        for name in self._boxes:
            rows = np.flatnonzero(found.by == "")
            # An upper bound, which is quick and settles most.
            bound = screen.deepest(path[rows], [name], faces_only=True)[1]
            rows = rows[bound > CONTACT_TOLERANCE]
            if len(rows):
                rows = rows[screen.deepest(path[rows], [name])[1] > self._allowed(name)]
            u = np.broadcast_to(u_W, (len(rows), 3))
            self._check(name, found, rows, start_W[rows], u, height)
        return found

    def _check(
        self,
        name: str,
        found: PathBlockers,
        rows: Indices,
        start_W: Array,
        u_W: Array,
        length: float,
    ) -> None:
        """Notes for some ways (S,) whether the object gets too deep into one body on them."""
        places = np.linspace(0.0, length, int(np.ceil(length / 1e-3)) + 1)
        size = max(1, 2**17 // len(places))  # bounds the memory to about 20 MB
        for k in range(0, len(rows), size):
            some = slice(k, k + size)
            p_W = start_W[some, None] + places[:, None] * u_W[some, None]
            depths = self._still.deepest(self._poses(p_W.reshape(-1, 3)), [name])[1]
            depths = depths.reshape(-1, len(places))
            deepest = depths.argmax(axis=1)
            depth = depths[np.arange(len(depths)), deepest]
            hit = depth > self._allowed(name)
            at = rows[some][hit]
            found.by[at], found.depth[at], found.at[at] = name, depth[hit], places[deepest[hit]]

    def _allowed(self, name: str) -> float:
        """Depth in a body up to which nothing is in the way [m]."""
        depth_tolerance = 1e-3  # Metres deeper than at rest that a moved object may get.
        if name not in self._depths_allowed:
            at_rest = self._X_WO[None]
            depth = float(self._still.deepest(at_rest, [name])[1][0])
            alone = HandScreen(self._target.pieces, {name: self._others[name]})
            touches = depth > 0.0 or alone.nearest(at_rest)[1][0] <= depth_tolerance
            self._depths_allowed[name] = depth + depth_tolerance if touches else CONTACT_TOLERANCE
        return self._depths_allowed[name]

    def _poses(self, moved_W: Array) -> Array:
        """(N, 4, 4) poses of the object once it has been moved by (N, 3) [m]."""
        X = np.repeat(self._X_WO[None], len(moved_W), axis=0)
        X[:, :3, 3] += moved_W
        return X
