"""How far the open hand is from the nearest body of a scene, for many grasps that overlap none.

From broad to narrow again: spheres about the parts of the hand against boxes around bodies, boxes
against boxes around convex pieces, both of which bound a distance from below; then the distance
itself: of the most promising pair of part and piece first, and then of those that may be nearer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.geometry.body import Body, HandParts
from burg_drake.geometry.distance import Cores, distances
from burg_drake.geometry.distance_bounds import Pairs, SceneBoxes
from burg_drake.geometry.poses import Poses


class NearestBody:
    """Finds the body that is nearest to the open hand.

    Args:
        hand: convex parts of the open hand.
        bodies: at least one.
    """

    def __init__(self, hand: HandParts, bodies: Sequence[Body]) -> None:
        self._boxes = SceneBoxes(hand, bodies)
        self._parts = Cores.of(hand.shapes)
        self._pieces = Cores.of([piece for body in bodies for piece in body.pieces])

    def measure(self, X_WG: Array) -> tuple[Indices, Array]:
        """The nearest body at each grasp.

        Args:
            X_WG: (N, 4, 4) grasps at which the hand overlaps nothing.

        Returns:
            Indices (N,) of bodies and distances (N,) [m].
        """
        search = _NearestSearch(Poses.of(X_WG), self._boxes, self._parts, self._pieces)
        bound = self._boxes.around_bodies(search.X_WG)
        first = bound <= np.maximum(bound.min(axis=(1, 2), keepdims=True), 0.0)
        search.go_on(np.nonzero(first))
        search.go_on(np.nonzero(~first & (bound < search.distance[:, None, None])))
        return search.nearest, search.distance


class _NearestSearch:
    """The nearest bodies (N,) of N grasps and their distances (N,) [m] as far as is known."""

    def __init__(self, X_WG: Poses, boxes: SceneBoxes, parts: Cores, pieces: Cores) -> None:
        self.X_WG, self._boxes, self._parts, self._pieces = X_WG, boxes, parts, pieces
        self.nearest = np.zeros(len(X_WG.p), dtype=np.intp)
        self.distance = np.full(len(X_WG.p), np.inf)

    def go_on(self, pairs: Pairs) -> None:
        """Takes pairs of parts and bodies into account, in the order of the grasps."""
        place, pieces, bound = self._boxes.around_pieces(self.X_WG, pairs)
        grasp, part, body = pairs
        left = _PartPiecePairs(grasp[place], part[place], body[place], pieces, bound)
        left = self._measure_lowest(left)
        left = left.above(self._boxes.along_parts(self.X_WG, left.pairs, left.piece))
        left = self._measure_lowest(left)
        self._measure(left)

    def _measure_lowest(self, left: _PartPiecePairs) -> _PartPiecePairs:
        """Measures those with the lowest bound of each grasp; returns the others that count."""
        left = left[left.bound < self.distance[left.grasp]]
        if not len(left.grasp):
            return left
        start = np.diff(left.grasp, prepend=-1) != 0
        lowest = np.minimum.reduceat(left.bound, np.flatnonzero(start))
        is_lowest = left.bound == lowest[np.cumsum(start) - 1]
        self._measure(left[is_lowest])
        return left[~is_lowest & (left.bound < self.distance[left.grasp])]

    def _measure(self, asked: _PartPiecePairs) -> None:
        asked = asked[asked.bound < self.distance[asked.grasp]]
        if not len(asked.grasp):
            return
        grasp, body = asked.grasp, asked.body
        X_BG = self._boxes.X_BW[body] @ self.X_WG[grasp]
        found = distances(
            *(self._parts, asked.part, self._pieces, asked.piece, X_BG), self.distance[grasp]
        )
        order = np.lexsort((found, grasp))
        best = order[np.diff(grasp[order], prepend=-1) != 0]
        best = best[found[best] < self.distance[grasp[best]]]
        self.nearest[grasp[best]], self.distance[grasp[best]] = body[best], found[best]


@dataclass(frozen=True, eq=False)
class _PartPiecePairs:
    """T pairs of a part of the hand and a piece of a body, in the order of the grasps.

    Attributes:
        grasp, part, body, piece: (T,) indices; `piece` is one of all pieces.
        bound: (T,) lower bounds of their distance [m].
    """

    grasp: Indices
    part: Indices
    body: Indices
    piece: Indices
    bound: Array

    @property
    def pairs(self) -> Pairs:
        """Grasps, parts and bodies."""
        return self.grasp, self.part, self.body

    def __getitem__(self, chosen: NDArray[np.bool_]) -> _PartPiecePairs:
        at = np.flatnonzero(chosen)
        grasp, part, body, piece = (v[at] for v in (*self.pairs, self.piece))
        return _PartPiecePairs(grasp, part, body, piece, self.bound[at])

    def above(self, bound: Array) -> _PartPiecePairs:
        """With further lower bounds (T,) [m]."""
        return replace(self, bound=np.maximum(self.bound, bound))
