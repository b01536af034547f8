"""The open hand against a scene at rest, for many grasps at once.

From broad to narrow: spheres about the parts of the hand against boxes around bodies, boxes against
boxes around convex pieces, then exact depths. Bodies are asked in order of priority, and of the
pairs of part and piece first the one whose boxes overlap most, so that little more is measured than
what decides.

Nothing here depends on what else is in a batch, not in its last bit: see `grasping.convex`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.frames import Array, inverse
from burg_drake.grasping.convex import Boxes
from burg_drake.grasping.penetration import penetration_depths
from burg_drake.grasping.polytope import PRISM_SIDES
from burg_drake.grasping.poses import Poses, rotate
from burg_drake.grasping.shape import Shape

TOUCHING = 1e-9
"""Overlaps up to this depth count as touching, which is no collision [m]: far above the rounding of
poses (1e-15), far below what matters in a trial."""

CHUNK = 2048
"""Grasps that are looked at together, where the scene's bodies have few pieces."""

PAIRS = 2**20
"""Bounding boxes that are looked at together; bounds the memory to some 100 MB."""

BLOCK = 2**14
"""Numbers in an array of the narrow phase: what fits a processor's caches."""

Indices = NDArray[np.intp]


class HandParts:
    """The convex parts of an open hand.

    Attributes:
        shapes: the parts, in the grasp frame G.
        half: (H, 3) half extents of their bounding boxes [m].
        radius: (H,) of their bounding spheres [m].
        X_HG: (H,) poses of G in the parts' frames.
        is_box: (H,) whether a part is a box.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self.shapes = tuple(shapes)
        self.half = np.array([shape.half for shape in shapes])
        self.radius = np.sqrt((self.half**2).sum(axis=1))
        self.X_HG = Poses.of(np.array([inverse(shape.X_BP) for shape in shapes]))
        self.is_box = np.array([isinstance(shape.convex, Boxes) for shape in shapes])


@dataclass(frozen=True, eq=False)
class Pairs:
    """K pairs of a grasp and a part of the hand that is near a body B.

    Attributes:
        grasp: (K,) indices of the grasps.
        part: (K,) indices of the parts.
        X_HB: (K,) poses of the body in the parts' frames.
    """

    grasp: Indices
    part: Indices
    X_HB: Poses

    def __getitem__(self, chosen: Indices) -> Pairs:
        return Pairs(self.grasp[chosen], self.part[chosen], self.X_HB[chosen])


class Body:
    """Convex pieces that stand somewhere in the world, rigid to each other.

    Args:
        X_WB: (4, 4) pose of the body.
        pieces: at least one, in the body's frame.

    Attributes:
        X_WB: the pose.
        size: number of pieces.
    """

    def __init__(self, X_WB: Array, pieces: Sequence[Shape]) -> None:
        self.X_WB = Poses.of(X_WB)
        self.size = len(pieces)
        self._pieces = tuple(pieces)
        self._polytopes = [
            None if piece.polytope is None else piece.polytope.moved(piece.X_BP) for piece in pieces
        ]
        X_BP = Poses.of(np.array([piece.X_BP for piece in pieces]))
        self._center = X_BP.p
        self._half = rotate(np.abs(X_BP.R), np.array([piece.half for piece in pieces]))
        self._curved = np.array([piece.curved for piece in pieces])
        self._edges = [PRISM_SIDES if p is None else len(p.edge_faces) for p in self._polytopes]
        self._low = (self._center - self._half).min(axis=0)
        self._high = (self._center + self._half).max(axis=0)

    def is_near(self, centers: Array, radii: Array) -> NDArray[np.bool_]:
        """Whether spheres (...,) about points (..., 3) in the world reach the bounding box."""
        p_B = self.X_WB.inverse().apply(centers)
        x, y, z = np.moveaxis(np.maximum(np.maximum(self._low - p_B, p_B - self._high), 0.0), -1, 0)
        return np.asarray(x * x + y * y + z * z < radii * radii)

    def depths(self, hand: HandParts, pairs: Pairs, n: int) -> Array:
        """Depth of the deepest overlap in each of n grasps (n,) [m]; 0 where there is none."""
        depth = np.zeros(n)
        pair, piece, bound = self._overlapping_boxes(hand, pairs)
        pairs = pairs[pair]
        order = np.lexsort((-bound, pairs.grasp))
        pairs, piece, bound = pairs[order], piece[order], bound[order]
        first = np.diff(pairs.grasp, prepend=-1) != 0
        for chosen in (np.flatnonzero(first), np.flatnonzero(~first)):
            chosen = chosen[bound[chosen] > np.maximum(depth[pairs.grasp[chosen]], TOUCHING)]
            asked = pairs[chosen]
            floor = np.maximum(depth[asked.grasp], TOUCHING)
            found = self._measured(hand, asked, piece[chosen], floor)
            np.maximum.at(depth, asked.grasp, np.where(found > floor, found, 0.0))
        return depth

    def _overlapping_boxes(self, hand: HandParts, pairs: Pairs) -> tuple[Indices, Indices, Array]:
        """Pairs and pieces (L,) whose bounding boxes are not told apart by the axes of body and
        part, and upper bounds of their depth (L,) [m]."""
        half = hand.half[pairs.part]
        X_BH = pairs.X_HB.inverse()
        reach = rotate(np.abs(X_BH.R), half)
        overlaps = (
            reach[:, k, None] + self._half[:, k] - np.abs(X_BH.p[:, k, None] - self._center[:, k])
            for k in range(3)
        )
        bound = np.minimum(np.minimum(next(overlaps), next(overlaps)), next(overlaps))
        pair, piece = np.nonzero(bound > TOUCHING)
        X_HB = pairs.X_HB[pair]
        reach = rotate(np.abs(X_HB.R), self._half[piece])
        overlap = half[pair] + reach - np.abs(X_HB.apply(self._center[piece]))
        bound = np.minimum(bound[pair, piece], overlap.min(axis=1))
        left = np.flatnonzero(bound > TOUCHING)
        return pair[left], piece[left], bound[left]

    def _measured(self, hand: HandParts, pairs: Pairs, piece: Indices, floor: Array) -> Array:
        """(L,) depths of pairs with one piece each [m]; below the floor (L,) some number that is
        not above it."""
        found = np.empty(len(piece))
        alone = ~hand.is_box[pairs.part] | self._curved[piece]
        group = piece * (len(hand.shapes) + 1) + np.where(alone, pairs.part + 1, 0)
        for chosen in _groups(group):
            block = max(1, BLOCK // self._edges[piece[chosen[0]]])
            for k in range(0, len(chosen), block):
                some = chosen[k : k + block]
                found[some] = self._of_piece(hand, pairs[some], int(piece[some[0]]), floor[some])
        return found

    def _of_piece(self, hand: HandParts, pairs: Pairs, piece: int, floor: Array) -> Array:
        """The same for one piece, and for one part or any number of boxes."""
        target, one = self._pieces[piece], self._polytopes[piece]
        part = hand.shapes[pairs.part[0]]
        other = Boxes(hand.half[pairs.part]) if hand.is_box[pairs.part[0]] else part.convex
        if one is not None and (part.curved or not target.curved):
            return penetration_depths(one, other, pairs.X_HB, floor)
        X_HP = pairs.X_HB @ Poses.of(target.X_BP)
        if part.polytope is not None:
            return penetration_depths(part.polytope, target.convex, X_HP.inverse(), floor)
        x, y, z = X_HP.p.T
        return np.asarray(target.half[0] + part.half[0] - np.sqrt(x * x + y * y + z * z))


class HandScreen:
    """Measures how deep the open hand is in the bodies of a scene.

    Args:
        hand: convex parts of the open hand, in the grasp frame.
        bodies: by name.

    Attributes:
        bodies: the bodies.
    """

    def __init__(self, hand: Sequence[Shape], bodies: Mapping[str, Body]) -> None:
        self._hand = HandParts(hand)
        self.bodies = dict(bodies)
        most = max((body.size for body in bodies.values()), default=1)
        self._chunk = max(1, min(CHUNK, PAIRS // (len(hand) * most)))

    def deepest(self, X_WG: Array, order: Sequence[str]) -> tuple[NDArray[np.object_], Array]:
        """The first body, in a given order, that the hand overlaps.

        Args:
            X_WG: (N, 4, 4) grasps in the world.
            order: names of all bodies that count.

        Returns:
            Names (N,) of the bodies, "" where the hand overlaps none of them, and depths (N,) of
            the deepest overlap with that body [m].
        """
        names, depths = np.full(len(X_WG), "", dtype=object), np.zeros(len(X_WG))
        for k in range(0, len(X_WG), self._chunk):
            chunk = slice(k, k + self._chunk)
            self._screen(X_WG[chunk], order, names[chunk], depths[chunk])
        return names, depths

    def _screen(
        self, X_WG: Array, order: Sequence[str], names: NDArray[np.object_], depths: Array
    ) -> None:
        """Fills in names and depths of a chunk."""
        X_HW = self._hand.X_HG[None] @ Poses.of(X_WG)[:, None].inverse()
        p_WH = X_HW.inverse().p
        left = np.arange(len(X_WG))
        for name in order:
            body = self.bodies[name]
            row, part = np.nonzero(body.is_near(p_WH[left], self._hand.radius))
            if not len(row):
                continue
            grasp = left[row]
            pairs = Pairs(grasp, part, X_HW[grasp, part] @ body.X_WB)
            depth = body.depths(self._hand, pairs, len(X_WG))
            names[depth > 0.0], depths[depth > 0.0] = name, depth[depth > 0.0]
            left = left[depth[left] == 0.0]


def _groups(key: Indices) -> Iterator[Indices]:
    """Places of equal keys, group by group."""
    order = np.argsort(key, kind="stable")
    return iter(np.split(order, np.flatnonzero(np.diff(key[order])) + 1) if len(key) else ())
