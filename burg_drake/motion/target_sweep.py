"""Collision checks of a grasped object against all others, on retreat and lift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, make_pose
from burg_drake.geometry import CONTACT_TOLERANCE, Body, HandScreen, swept_body


@dataclass(frozen=True, eq=False)
class PathBlockers:
    """Obstacles of an object on N paths.

    Attributes:
        by: (N,) the first body, in the given order, that the object penetrates too deeply; "" where
            the path is free.
        depth: (N,) deepest overlap with that body [m]; 0 where the path is free.
        at: (N,) distance along the path of the deepest overlap [m]; NaN where the path is free.
    """

    by: NDArray[np.object_]
    depth: Array
    at: Array

    @classmethod
    def empty(cls, n: int) -> PathBlockers:
        """No obstacles on n paths."""
        return cls(np.full(n, "", dtype=object), np.zeros(n), np.full(n, np.nan))

    def repeated(self, n: int) -> PathBlockers:
        """Repeats the single path n times."""
        return PathBlockers(np.repeat(self.by, n), np.repeat(self.depth, n), np.repeat(self.at, n))


class TargetSweep:
    """Sweeps one object, without rotation, past the others.

    Args:
        target: the object at its placement.
        others: the other bodies at their placements, in the order in which they are reported.
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
        """Checks straight paths from the placement along unit vectors (N, 3) in the world, of a
        length [m]."""
        found = PathBlockers.empty(len(u_W))
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
        """Checks straight paths from displaced poses along one direction.

        Args:
            start_W: (N, 3) displacements from the placement at the start [m].
            u_W: (3,) unit vector in the world.
            height: length of the paths [m].
            swept: the other bodies, swept in the opposite direction by that length.
        """
        if height not in self._lifts:
            below = {name: swept[name] for name in self._boxes}
            self._lifts[height] = HandScreen(self._target.pieces, below)
        screen = self._lifts[height]
        found = PathBlockers.empty(len(start_W))
        path = self._poses(start_W)
        for name in self._boxes:
            rows = np.flatnonzero(found.by == "")
            # A fast upper bound, which decides most paths.
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
        """Enters the body into `found` for the paths (S,) on which it is penetrated too deeply."""
        places = np.linspace(0.0, length, int(np.ceil(length / 1e-3)) + 1)
        size = max(1, 2**17 // len(places))  # bounds the memory to about 20 MB
        for k in range(0, len(rows), size):
            batch = slice(k, k + size)
            p_W = start_W[batch, None] + places[:, None] * u_W[batch, None]
            depths = self._still.deepest(self._poses(p_W.reshape(-1, 3)), [name])[1]
            depths = depths.reshape(-1, len(places))
            deepest = depths.argmax(axis=1)
            depth = depths[np.arange(len(depths)), deepest]
            hit = depth > self._allowed(name)
            at = rows[batch][hit]
            found.by[at], found.depth[at], found.at[at] = name, depth[hit], places[deepest[hit]]

    def _allowed(self, name: str) -> float:
        """Largest overlap with a body that does not block the path [m]."""
        depth_tolerance = 1e-3  # Metres deeper than at rest that a moved object may get.
        if name not in self._depths_allowed:
            at_rest = self._X_WO[None]
            depth = float(self._still.deepest(at_rest, [name])[1][0])
            alone = HandScreen(self._target.pieces, {name: self._others[name]})
            touches = depth > 0.0 or alone.nearest(at_rest)[1][0] <= depth_tolerance
            self._depths_allowed[name] = depth + depth_tolerance if touches else CONTACT_TOLERANCE
        return self._depths_allowed[name]

    def _poses(self, moved_W: Array) -> Array:
        """(N, 4, 4) poses of the object after displacements (N, 3) [m]."""
        X = np.repeat(self._X_WO[None], len(moved_W), axis=0)
        X[:, :3, 3] += moved_W
        return X
