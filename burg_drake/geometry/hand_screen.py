"""The open hand against a scene at rest, for many grasps at once: overlaps and distances.

For overlaps bodies are asked in order of priority, spheres about the parts of the hand against
boxes around bodies first; see `geometry.body` for what follows, and `geometry.nearest_body` for
distances.

Nothing here depends on what else is in a batch, not in its last bit: see `geometry.convex`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.geometry.body import Body, HandBodyPairs, HandParts
from burg_drake.geometry.nearest_body import NearestBody
from burg_drake.geometry.poses import Poses
from burg_drake.geometry.shape import Shape

CHUNK = 2048
"""Grasps that are looked at together, where the scene's bodies have few pieces."""

PAIRS = 2**20
"""Bounding boxes that are looked at together; bounds the memory to some 100 MB."""


class HandScreen:
    """Measures how deep the open hand is in the bodies of a scene, or how far it is from them.

    Args:
        hand: convex parts of the open hand, in the grasp frame.
        bodies: by name.

    Attributes:
        bodies: the bodies.
    """

    def __init__(self, hand: Sequence[Shape], bodies: Mapping[str, Body]) -> None:
        self._hand = HandParts(hand)
        self.bodies = dict(bodies)
        self._nearest = NearestBody(self._hand, list(bodies.values())) if bodies else None
        sizes = [body.size for body in bodies.values()]
        self._chunk = max(1, min(CHUNK, PAIRS // (len(hand) * max(sizes, default=1))))
        self._chunk_of_all = max(1, min(CHUNK, PAIRS // (len(hand) * max(sum(sizes), 1))))

    def deepest(
        self, X_WG: Array, order: Sequence[str], *, faces_only: bool = False
    ) -> tuple[NDArray[np.object_], Array]:
        """The first body, in a given order, that the hand overlaps.

        Args:
            X_WG: (N, 4, 4) grasps in the world.
            order: names of all bodies that count.
            faces_only: take for overlaps what no face separates, and upper bounds for depths; see
                `penetration.penetration_depths`.

        Returns:
            Names (N,) of the bodies, "" where the hand overlaps none of them, and depths (N,) of
            the deepest overlap with that body [m].
        """
        names, depths = np.full(len(X_WG), "", dtype=object), np.zeros(len(X_WG))
        for k in range(0, len(X_WG), self._chunk):
            chunk = slice(k, k + self._chunk)
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
            Names (N,) of the bodies and distances (N,) [m], to within `distance.TOLERANCE`; ""
            and inf in a scene without bodies.
        """
        names, distances = np.full(len(X_WG), "", dtype=object), np.full(len(X_WG), np.inf)
        if self._nearest is None:
            return names, distances
        every = np.array(list(self.bodies), dtype=object)
        for k in range(0, len(X_WG), self._chunk_of_all):
            chunk = slice(k, k + self._chunk_of_all)
            body, distances[chunk] = self._nearest.measure(X_WG[chunk])
            names[chunk] = every[body]
        return names, distances


class _PlacedHand:
    """The hand at N grasps (N, 4, 4) in the world."""

    def __init__(self, hand: HandParts, X_WG: Array) -> None:
        self._hand = hand
        self._X_HW = hand.X_HG[None] @ Poses.of(X_WG)[:, None].inverse()
        self._p_WH = self._X_HW.inverse().p

    def depths(self, body: Body, asked: Indices, faces_only: bool) -> Array:
        """Depths (N,) in a body [m], see `Body.depths`; 0 at grasps that are not asked for."""
        row, part = np.nonzero(body.is_near(self._p_WH[asked], self._hand.radius))
        if not len(row):
            return np.zeros(len(self._p_WH))
        grasp = asked[row]
        pairs = HandBodyPairs(grasp, part, self._X_HW[grasp, part] @ body.X_WB)
        return body.depths(self._hand, pairs, len(self._p_WH), faces_only=faces_only)
