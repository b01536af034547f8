"""Bodies of convex pieces, the convex parts of an open hand, and the volumes that they sweep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, inverse, make_pose, transform_points
from burg_drake.geometry.convex_shapes import Ball, Boxes, Cylinder, Shape, penetration_depths
from burg_drake.geometry.polytopes import PRISM_SIDES, Polytope
from burg_drake.geometry.poses import Poses, rotate

CONTACT_TOLERANCE = 1e-9
"""Overlaps up to this depth are no collision, metres. The rounding of poses is 1e-15."""

NARROW_PHASE_BLOCK = 2**14
"""Numbers in an array of the narrow phase; fits a processor's caches."""


class HandParts:
    """The convex parts of an open hand.

    Attributes:
        shapes: the parts, in the grasp frame G.
        half: (H, 3) half extents of their bounding boxes [m].
        radius: (H,) radii of their bounding spheres [m].
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
class HandBodyPairs:
    """K pairs of a grasp and a part of the hand that is near a body B.

    Attributes:
        grasp: (K,) indices of the grasps.
        part: (K,) indices of the parts.
        X_HB: (K,) poses of the body in the parts' frames.
    """

    grasp: Indices
    part: Indices
    X_HB: Poses

    def __getitem__(self, chosen: Indices) -> HandBodyPairs:
        return HandBodyPairs(self.grasp[chosen], self.part[chosen], self.X_HB[chosen])


class Body:
    """A rigid body of convex pieces at a pose in the world.

    Args:
        X_WB: (4, 4) pose of the body.
        pieces: its convex pieces in the body's frame, at least one.

    Attributes:
        X_WB: the pose.
        size: number of pieces.
        pieces: the pieces.
        center, half: (size, 3) boxes around the pieces along the body's axes [m].
        low, high: (3,) corners of the box around all pieces, in the body's frame [m].
    """

    def __init__(self, X_WB: Array, pieces: Sequence[Shape]) -> None:
        self.X_WB = Poses.of(X_WB)
        self.size = len(pieces)
        self.pieces = tuple(pieces)
        self._polytopes = [
            None if piece.polytope is None else piece.polytope.moved(piece.X_BP) for piece in pieces
        ]
        X_BP = Poses.of(np.array([piece.X_BP for piece in pieces]))
        self.center = X_BP.p
        self.half = rotate(np.abs(X_BP.R), np.array([piece.half for piece in pieces]))
        self._curved = np.array([piece.curved for piece in pieces])
        self._edges = [PRISM_SIDES if p is None else len(p.edge_faces) for p in self._polytopes]
        self.low = (self.center - self.half).min(axis=0)
        self.high = (self.center + self.half).max(axis=0)

    def is_near(self, centers: Array, radii: Array) -> NDArray[np.bool_]:
        """Whether spheres (...,) about points (..., 3) in the world reach the bounding box."""
        p_B = self.X_WB.inverse().apply(centers)
        x, y, z = np.moveaxis(np.maximum(np.maximum(self.low - p_B, p_B - self.high), 0.0), -1, 0)
        return np.asarray(x * x + y * y + z * z < radii * radii)

    def depths(
        self, hand: HandParts, pairs: HandBodyPairs, n: int, *, faces_only: bool = False
    ) -> Array:
        """Depth of the deepest overlap in each of n grasps (n,) [m]; 0 without an overlap.

        With `faces_only` it is an upper bound that is above 0 if no face of a part or piece
        separates the two; see `penetration_depths`.
        """
        depth = np.zeros(n)
        pair, piece, bound = self._overlapping_boxes(hand, pairs)
        pairs = pairs[pair]
        order = np.lexsort((-bound, pairs.grasp))
        pairs, piece, bound = pairs[order], piece[order], bound[order]
        first = np.diff(pairs.grasp, prepend=-1) != 0
        for chosen in (np.flatnonzero(first), np.flatnonzero(~first)):
            chosen = chosen[
                bound[chosen] > np.maximum(depth[pairs.grasp[chosen]], CONTACT_TOLERANCE)
            ]
            chosen_pairs = pairs[chosen]
            floor = np.maximum(depth[chosen_pairs.grasp], CONTACT_TOLERANCE)
            found = self._exact_depths(hand, chosen_pairs, piece[chosen], floor, faces_only)
            np.maximum.at(depth, chosen_pairs.grasp, np.where(found > floor, found, 0.0))
        return depth

    def _overlapping_boxes(
        self, hand: HandParts, pairs: HandBodyPairs
    ) -> tuple[Indices, Indices, Array]:
        """Pairs and pieces (L,) whose bounding boxes are not separated along the axes of body and
        part, and upper bounds of their depth (L,) [m]."""
        half = hand.half[pairs.part]
        X_BH = pairs.X_HB.inverse()
        reach = rotate(np.abs(X_BH.R), half)
        overlaps = (
            reach[:, k, None] + self.half[:, k] - np.abs(X_BH.p[:, k, None] - self.center[:, k])
            for k in range(3)
        )
        bound = np.minimum(np.minimum(next(overlaps), next(overlaps)), next(overlaps))
        pair, piece = np.nonzero(bound > CONTACT_TOLERANCE)
        X_HB = pairs.X_HB[pair]
        reach = rotate(np.abs(X_HB.R), self.half[piece])
        overlap = half[pair] + reach - np.abs(X_HB.apply(self.center[piece]))
        bound = np.minimum(bound[pair, piece], overlap.min(axis=1))
        left = np.flatnonzero(bound > CONTACT_TOLERANCE)
        return pair[left], piece[left], bound[left]

    def _exact_depths(
        self, hand: HandParts, pairs: HandBodyPairs, piece: Indices, floor: Array, faces_only: bool
    ) -> Array:
        """(L,) depths of pairs with one piece each [m]; for depths below the floor (L,), any number
        up to the floor."""
        found = np.empty(len(piece))
        alone = ~hand.is_box[pairs.part] | self._curved[piece]
        group = piece * (len(hand.shapes) + 1) + np.where(alone, pairs.part + 1, 0)
        for chosen in _group_indices(group):
            block = max(1, NARROW_PHASE_BLOCK // self._edges[piece[chosen[0]]])
            for k in range(0, len(chosen), block):
                part = chosen[k : k + block]
                one = int(piece[part[0]])
                found[part] = self._piece_depths(hand, pairs[part], one, floor[part], faces_only)
        return found

    def _piece_depths(
        self, hand: HandParts, pairs: HandBodyPairs, piece: int, floor: Array, faces_only: bool
    ) -> Array:
        """`_exact_depths` for one piece, and for one part of the hand or any number of boxes."""
        target, one = self.pieces[piece], self._polytopes[piece]
        part = hand.shapes[pairs.part[0]]
        other = Boxes(hand.half[pairs.part]) if hand.is_box[pairs.part[0]] else part.convex
        if one is not None and (part.curved or not target.curved):
            return penetration_depths(one, other, pairs.X_HB, floor, faces_only=faces_only)
        X_HP = pairs.X_HB @ Poses.of(target.X_BP)
        if part.polytope is not None:
            X_PH = X_HP.inverse()
            return penetration_depths(
                part.polytope, target.convex, X_PH, floor, faces_only=faces_only
            )
        x, y, z = X_HP.p.T
        return np.asarray(target.half[0] + part.half[0] - np.sqrt(x * x + y * y + z * z))


def _group_indices(key: Indices) -> Iterator[Indices]:
    """Yields the indices of equal keys, group by group."""
    order = np.argsort(key, kind="stable")
    return iter(np.split(order, np.flatnonzero(np.diff(key[order])) + 1) if len(key) else ())


SWEPT_CYLINDER_SIDES = 64
"""Sides of the prism around a cylinder swept across its axis: 0.12 % of the radius too large."""


def swept_shape(shape: Shape, shift_B: Array) -> list[Shape]:
    """Shapes whose union is the swept volume of a shape along a straight segment.

    Args:
        shape: the shape, in a body's frame B.
        shift_B: (3,) translation from start to end [m].

    Returns:
        One shape in B, or three for a ball: a cylinder and the balls at its ends. They are exact,
        except for a cylinder that is swept across its axis: see `SWEPT_CYLINDER_SIDES`.
    """
    length = float(np.linalg.norm(shift_B))
    if length == 0.0:
        return [shape]
    X_BP = shape.X_BP
    R_BP, middle = X_BP[:3, :3], make_pose(p_AB=shift_B / 2) @ X_BP
    match shape.convex:
        case Ball(radius=radius):
            R_BC = _rotation_to_axis(shift_B / length)
            tube = Shape.cylinder(make_pose(R_BC, middle[:3, 3]), radius, length / 2)
            return [shape, Shape.ball(make_pose(p_AB=shift_B) @ X_BP, radius), tube]
        case Cylinder(radius=radius, half_length=half_length):
            if np.linalg.norm(np.cross(R_BP[:, 2], shift_B / length)) <= 1e-9:  # along its axis
                return [Shape.cylinder(middle, radius, half_length + length / 2)]
            prism = Polytope.prism(
                radius / np.cos(np.pi / SWEPT_CYLINDER_SIDES), half_length, SWEPT_CYLINDER_SIDES
            )
            return [_swept_hull(prism.vertices, X_BP, shift_B)]
    assert shape.polytope is not None  # only a ball has none
    return [_swept_hull(shape.polytope.vertices, X_BP, shift_B)]


def swept_body(body: Body, shift_W: Array) -> Body:
    """The swept volume of a body along `shift_W` (3,) [m] in the world, as a body."""
    X_WB = make_pose(body.X_WB.R, body.X_WB.p)
    placed = [replace(piece, X_BP=X_WB @ piece.X_BP) for piece in body.pieces]
    return Body(np.eye(4), [shape for piece in placed for shape in swept_shape(piece, shift_W)])


def _swept_hull(points: Array, X_BP: Array, shift_B: Array) -> Shape:
    """The hull of points (N, 3) in P and of the points shifted by `shift_B`."""
    p_B = transform_points(X_BP, points)
    return Shape.hull(np.eye(4), np.concatenate([p_B, p_B + shift_B]))


def _rotation_to_axis(u: Array) -> Array:
    """(3, 3) a rotation whose z axis is the unit vector `u` (3,)."""
    x = np.cross(u, np.eye(3)[np.abs(u).argmin()])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(u, x), u])
