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
        room: (N,) how much deeper the object may still get into bodies that it touches or overlaps
            at its placement [m]; infinite where there are none on the path, 0 where it is blocked.
    """

    by: NDArray[np.object_]
    depth: Array
    at: Array
    room: Array

    @classmethod
    def empty(cls, n: int) -> PathBlockers:
        """No obstacles on n paths."""
        nothing, infinite = np.full(n, "", dtype=object), np.full(n, np.inf)
        return cls(nothing, np.zeros(n), np.full(n, np.nan), infinite)

    def repeated(self, n: int) -> PathBlockers:
        """Repeats the single path n times."""
        depth, at, room = (np.repeat(value, n) for value in (self.depth, self.at, self.room))
        return PathBlockers(np.repeat(self.by, n), depth, at, room)


MIN_STRAIGHTNESS = 2e-5
"""Metres by which the hand may leave a straight segment, however little room there is."""
PATH_RESERVE = 2.0 * MIN_STRAIGHTNESS
"""Metres of overlap that the check of the straight path leaves to the deviation of the arm."""


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
                depth = screen.deepest(path[rows], [name])[1]  # of all the path at once
                free = depth <= self._allowed(name)
                self._limit_room(name, found, rows[free], depth[free])
                rows = rows[~free]
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
        if not len(rows):
            return
        places = np.linspace(0.0, length, int(np.ceil(length / 1e-3)) + 1)
        size = max(1, 2**17 // len(places))  # bounds the memory to about 20 MB
        allowed = self._allowed(name)
        for k in range(0, len(rows), size):
            batch = slice(k, k + size)
            start, u, mine = start_W[batch], u_W[batch], rows[batch]
            depths = self._depths(name, start, u, np.repeat(places[None], len(start), axis=0))
            deepest = depths.argmax(axis=1)
            depth, at = depths[np.arange(len(depths)), deepest], places[deepest]
            if self._touches(name):
                self._deepen(name, start, u, places, depths, depth, at)
            hit = depth > allowed
            self._limit_room(name, found, mine, depth)
            found.by[mine[hit]] = name
            found.depth[mine[hit]], found.at[mine[hit]] = depth[hit], at[hit]

    def _deepen(
        self,
        name: str,
        start_W: Array,
        u_W: Array,
        places: Array,
        depths: Array,
        depth: Array,
        at: Array,
    ) -> None:
        """Updates the deepest overlaps on S paths by those between the samples.

        A depth changes by at most the distance moved. Samples are added until the deepest overlap
        can be deeper than found by at most half of the room that is left.

        Args:
            name: the body.
            start_W, u_W: (S, 3) starts of the paths [m], and unit vectors along them.
            places, depths: (P,) distances of the samples from the start, and (S, P) depths [m].
            depth, at: (S,) deepest overlaps and their distances from the start [m]; changed.
        """
        pieces, finest = 10, 1e-5  # Metres between the last samples.
        allowed = self._allowed(name)

        def may_matter(path: Indices, d: Array) -> tuple[Indices, Indices]:
            """Pairs of neighbouring samples of rows (R, P) between which depths may decide."""
            limit = 0.5 * (depth[path] + allowed + PATH_RESERVE) + CONTACT_TOLERANCE
            limit[depth[path] > allowed] = np.inf
            row, piece = np.nonzero(0.5 * (d[:, :-1] + d[:, 1:] + step) > limit[:, None])
            return row, piece

        step = places[1] - places[0] if len(places) > 1 else 0.0
        path, first = may_matter(np.arange(len(depth)), depths)
        begin, ends = places[first], np.stack([depths[path, first], depths[path, first + 1]], 1)
        while len(path) and step > finest:
            step /= pieces
            s = begin[:, None] + step * np.arange(1, pieces)
            inner = self._depths(name, start_W[path], u_W[path], s)
            for k, row in enumerate(path.tolist()):
                if inner[k].max() > depth[row]:
                    depth[row], at[row] = inner[k].max(), s[k, inner[k].argmax()]
            inner = np.column_stack([ends[:, :1], inner, ends[:, 1:]])
            chosen, piece = may_matter(path, inner)
            path, begin = path[chosen], begin[chosen] + step * piece
            ends = np.stack([inner[chosen, piece], inner[chosen, piece + 1]], 1)

    def _depths(self, name: str, start_W: Array, u_W: Array, s: Array) -> Array:
        """Depths (S, P) in a body at distances (S, P) along paths [m]."""
        p_W = start_W[:, None] + s[..., None] * u_W[:, None]
        found = self._still.deepest(self._poses(p_W.reshape(-1, 3)), [name])[1]
        return found.reshape(s.shape)

    def _limit_room(self, name: str, found: PathBlockers, rows: Indices, depth: Array) -> None:
        """Enters the room that depths (S,) in a body [m] leave on the paths `rows` (S,)."""
        if self._touches(name):
            room = np.maximum(self._allowed(name) + PATH_RESERVE - depth, 0.0)
            found.room[rows] = np.minimum(found.room[rows], room)

    def _touches(self, name: str) -> bool:
        """Whether the object touches or overlaps a body at its placement."""
        return self._allowed(name) > CONTACT_TOLERANCE

    def _allowed(self, name: str) -> float:
        """Largest overlap with a body that does not block the straight path [m]."""
        depth_tolerance = 1e-3  # Metres deeper than at rest that a moved object may get.
        if name not in self._depths_allowed:
            at_rest = self._X_WO[None]
            depth = float(self._still.deepest(at_rest, [name])[1][0])
            alone = HandScreen(self._target.pieces, {name: self._others[name]})
            touches = depth > 0.0 or alone.nearest(at_rest)[1][0] <= depth_tolerance
            deeper = depth + depth_tolerance - PATH_RESERVE
            self._depths_allowed[name] = deeper if touches else CONTACT_TOLERANCE
        return self._depths_allowed[name]

    def _poses(self, moved_W: Array) -> Array:
        """(N, 4, 4) poses of the object after displacements (N, 3) [m]."""
        X = np.repeat(self._X_WO[None], len(moved_W), axis=0)
        X[:, :3, 3] += moved_W
        return X
