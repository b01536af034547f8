"""Penetration depth and distance of the open hand in a scene at rest, for many grasps at once.

Bounding boxes and spheres give lower bounds of distances; exact distances are computed only for
pairs that may be the nearest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.geometry.bodies import Body, HandBodyPairs, HandParts
from burg_drake.geometry.convex_distance import ShapeBatch, shape_distances
from burg_drake.geometry.convex_shapes import Shape
from burg_drake.geometry.poses import Poses, rotate

Pairs = tuple[Indices, ...]
"""Grasps, parts of the hand and bodies, (K,) each."""


class SceneBoxes:
    """Spheres about the parts of a hand, and boxes around bodies and around their pieces.

    Args:
        hand: convex parts of the open hand.
        bodies: the bodies, at least one.

    Attributes:
        X_BW: (B,) poses of the world in the bodies.
        parts, pieces: the parts of the hand, and the pieces of all bodies.
    """

    def __init__(self, hand: HandParts, bodies: Sequence[Body]) -> None:
        self.parts = ShapeBatch.of(hand.shapes)
        self.pieces = ShapeBatch.of([piece for body in bodies for piece in body.pieces])
        self._X_GH = hand.X_HG.inverse()
        self._hand_half, self._radius = hand.half, hand.radius
        inverses = [body.X_WB.inverse() for body in bodies]
        self.X_BW = Poses(np.array([X.R for X in inverses]), np.array([X.p for X in inverses]))
        self._low = np.array([body.low for body in bodies])
        self._high = np.array([body.high for body in bodies])
        self._size = np.array([body.size for body in bodies])
        self._start = np.cumsum(self._size) - self._size
        self._center = np.concatenate([body.center for body in bodies]).T.copy()
        self._half = np.concatenate([body.half for body in bodies]).T.copy()

    def body_bounds(self, X_WG: Poses) -> Array:
        """Lower bounds (N, H, B) [m] for N grasps, H parts of the hand and B bodies: distances of
        the part's bounding sphere from the body's bounding box."""
        p_WH = (X_WG[:, None] @ self._X_GH[None]).p
        p_B = self.X_BW.apply(p_WH[:, :, None])
        gaps = np.maximum(self._low - p_B, p_B - self._high)
        return (
            _signed_box_distance(gaps[..., 0], gaps[..., 1], gaps[..., 2]) - self._radius[:, None]
        )

    def piece_bounds(self, X_WG: Poses, pairs: Pairs) -> tuple[Indices, Indices, Array]:
        """Lower bounds for all pieces of the bodies: distances of boxes along the bodies' axes.

        Args:
            X_WG: (N,) grasps.
            pairs: K grasps, parts and bodies.

        Returns:
            Indices (T,) of the pairs, indices (T,) among all pieces, and bounds (T,) [m].
        """
        grasp, part, body = pairs
        X_BH = self.X_BW[body] @ X_WG[grasp] @ self._X_GH[part]
        reach = rotate(np.abs(X_BH.R), self._hand_half[part])
        count = self._size[body]
        pair = np.repeat(np.arange(len(grasp)), count)
        first = self._start[body] - (np.cumsum(count) - count)
        piece = np.arange(len(pair)) + np.repeat(first, count)
        x, y, z = (
            np.abs(np.repeat(X_BH.p[:, k], count) - self._center[k, piece])
            - np.repeat(reach[:, k], count)
            - self._half[k, piece]
            for k in range(3)
        )
        return pair, piece, _signed_box_distance(x, y, z)

    def refined_piece_bounds(self, X_WG: Poses, pairs: Pairs, piece: Indices) -> Array:
        """Lower bounds (K,) for one piece each [m]: distances of boxes along the parts' axes."""
        grasp, part, body = pairs
        X_HB = (self.X_BW[body] @ X_WG[grasp] @ self._X_GH[part]).inverse()
        p_H = X_HB.apply(self._center[:, piece].T)
        reach = rotate(np.abs(X_HB.R), self._half[:, piece].T)
        x, y, z = (np.abs(p_H) - reach - self._hand_half[part]).T
        return _signed_box_distance(x, y, z)


def _signed_box_distance(x: Array, y: Array, z: Array) -> Array:
    """Signed distance of two boxes with common axes from the gaps along these axes; minus the depth
    if they overlap."""
    far = np.maximum(x, 0.0), np.maximum(y, 0.0), np.maximum(z, 0.0)
    distance = np.sqrt(far[0] * far[0] + far[1] * far[1] + far[2] * far[2])
    return np.asarray(distance + np.minimum(np.maximum(np.maximum(x, y), z), 0.0))


class _NearestSearch:
    """The search for the body that is nearest to the open hand.

    Args:
        X_WG: N grasps at which the hand overlaps nothing.
        boxes: boxes of the scene, which has at least one body.

    Attributes:
        nearest, distance: (N,) indices of the nearest bodies found so far and their distances [m].
    """

    def __init__(self, X_WG: Poses, boxes: SceneBoxes) -> None:
        self.X_WG, self._boxes = X_WG, boxes
        self.nearest = np.zeros(len(X_WG.p), dtype=np.intp)
        self.distance = np.full(len(X_WG.p), np.inf)

    def run(self) -> None:
        """Measures the pairs with the lowest bounds first, then those that may be nearer."""
        bound = self._boxes.body_bounds(self.X_WG)
        first = bound <= np.maximum(bound.min(axis=(1, 2), keepdims=True), 0.0)
        self._measure_pairs(np.nonzero(first))
        self._measure_pairs(np.nonzero(~first & (bound < self.distance[:, None, None])))

    def _measure_pairs(self, pairs: Pairs) -> None:
        """Measures pairs of parts and bodies, ordered by grasp, that may be the nearest."""
        pair, pieces, bound = self._boxes.piece_bounds(self.X_WG, pairs)
        grasp, part, body = pairs
        left = _PartPiecePairs(grasp[pair], part[pair], body[pair], pieces, bound)
        left = self._measure_lowest(left)
        left = left.with_bounds(self._boxes.refined_piece_bounds(self.X_WG, left.pairs, left.piece))
        left = self._measure_lowest(left)
        self._measure(left)

    def _measure_lowest(self, left: _PartPiecePairs) -> _PartPiecePairs:
        """Measures the pairs with the lowest bound of each grasp; returns those left that may be
        nearer."""
        left = left[left.bound < self.distance[left.grasp]]
        if not len(left.grasp):
            return left
        start = np.diff(left.grasp, prepend=-1) != 0
        lowest = np.minimum.reduceat(left.bound, np.flatnonzero(start))
        is_lowest = left.bound == lowest[np.cumsum(start) - 1]
        self._measure(left[is_lowest])
        return left[~is_lowest & (left.bound < self.distance[left.grasp])]

    def _measure(self, pairs: _PartPiecePairs) -> None:
        pairs = pairs[pairs.bound < self.distance[pairs.grasp]]
        if not len(pairs.grasp):
            return
        grasp, body = pairs.grasp, pairs.body
        X_BG = self._boxes.X_BW[body] @ self.X_WG[grasp]
        found = shape_distances(
            *(self._boxes.parts, pairs.part, self._boxes.pieces, pairs.piece, X_BG),
            self.distance[grasp],
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

    def with_bounds(self, bound: Array) -> _PartPiecePairs:
        """The pairs with the larger of their own and further lower bounds (T,) [m]."""
        return replace(self, bound=np.maximum(self.bound, bound))


GRASP_CHUNK = 2048
"""Grasps in a batch."""


class HandScreen:
    """Measures the penetration depth or the distance of the open hand in a scene.

    Args:
        hand: convex parts of the open hand, in the grasp frame.
        bodies: the bodies of the scene by name.

    Attributes:
        bodies: the bodies.
    """

    def __init__(self, hand: Sequence[Shape], bodies: Mapping[str, Body]) -> None:
        max_pairs = 2**20  # Bounding boxes in a batch; bounds the memory to some 100 MB.
        self._hand = HandParts(hand)
        self.bodies = dict(bodies)
        self._boxes = SceneBoxes(self._hand, list(bodies.values())) if bodies else None
        sizes = [body.size for body in bodies.values()]
        self._deepest_chunk, self._nearest_chunk = (
            max(1, min(GRASP_CHUNK, max_pairs // (len(hand) * max(pieces, 1))))
            for pieces in (max(sizes, default=1), sum(sizes))
        )

    def deepest(
        self, X_WG: Array, order: Sequence[str], *, faces_only: bool = False
    ) -> tuple[NDArray[np.object_], Array]:
        """The first body, in a given order, that the hand overlaps.

        Args:
            X_WG: (N, 4, 4) grasps in the world.
            order: names of all bodies to check.
            faces_only: count pairs that no face separates as overlaps, with upper bounds as depths;
                see `penetration_depths`.

        Returns:
            Names (N,) of the bodies, "" where the hand overlaps none, and depths (N,) of the
            deepest overlap with that body [m].
        """
        names, depths = np.full(len(X_WG), "", dtype=object), np.zeros(len(X_WG))
        for k in range(0, len(X_WG), self._deepest_chunk):
            chunk = slice(k, k + self._deepest_chunk)
            hand = _PlacedHand(self._hand, X_WG[chunk])
            left = np.arange(len(X_WG[chunk]))
            for name in order:
                depth = hand.depths(self.bodies[name], left, faces_only)
                hit = depth > 0.0
                names[chunk][hit], depths[chunk][hit] = name, depth[hit]
                left = left[~hit[left]]
        return names, depths

    def nearest(self, X_WG: Array) -> tuple[NDArray[np.object_], Array]:
        """The body that is nearest to the hand.

        Args:
            X_WG: (N, 4, 4) grasps in the world at which the hand overlaps nothing.

        Returns:
            Names (N,) of the bodies and distances (N,) [m], to within `DISTANCE_TOLERANCE`; ""
            and inf in a scene without bodies.
        """
        names, distances = np.full(len(X_WG), "", dtype=object), np.full(len(X_WG), np.inf)
        if self._boxes is None:
            return names, distances
        body_names = np.array(list(self.bodies), dtype=object)
        for k in range(0, len(X_WG), self._nearest_chunk):
            chunk = slice(k, k + self._nearest_chunk)
            search = _NearestSearch(Poses.of(X_WG[chunk]), self._boxes)
            search.run()
            names[chunk], distances[chunk] = body_names[search.nearest], search.distance
        return names, distances


class _PlacedHand:
    """The hand at N grasps (N, 4, 4) in the world."""

    def __init__(self, hand: HandParts, X_WG: Array) -> None:
        self._hand = hand
        self._X_HW = hand.X_HG[None] @ Poses.of(X_WG)[:, None].inverse()
        self._p_WH = self._X_HW.inverse().p

    def depths(self, body: Body, grasps: Indices, faces_only: bool) -> Array:
        """Depths (N,) in a body [m], see `Body.depths`; 0 at grasps not in `grasps`."""
        row, part = np.nonzero(body.is_near(self._p_WH[grasps], self._hand.radius))
        if not len(row):
            return np.zeros(len(self._p_WH))
        grasp = grasps[row]
        pairs = HandBodyPairs(grasp, part, self._X_HW[grasp, part] @ body.X_WB)
        return body.depths(self._hand, pairs, len(self._p_WH), faces_only=faces_only)
