"""Checks whether an arm can move along straight joint segments.

Bounds of the clearance decide most of a segment. Drake's collision checker decides the rest.

A lower bound c of the clearance proves everything within a displacement of c free (Schwarzer, Saha
and Latombe, "Adaptive dynamic collision checking for single and multiple articulated robots in
complex environments", IEEE T-RO 21(3), 2005). A stretch that two bounds do not prove is divided,
down to a fixed length.

In exact mode Drake has checked every segment that counts as free, in rows at most
`EdgeCheckSettings.row_spacing` apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, content_hash
from burg_drake.motion.arm_collision import NO_DISPLACEMENT, ArmCollision
from burg_drake.motion.clearance_bounds import ArmProximity


class EdgeCheckSettings:
    """Lengths down to which segments are divided, and spacing of Drake's checks."""

    coarse_length = 0.08  # Metres of displacement. Longest stretch at the beginning.
    fine_length = 0.003  # Metres of displacement. Longest stretch left undecided.
    hand_fine_length = 0.001  # Metres, where the hand passes objects and has not been swept.
    guess_length = 0.012  # Metres, where a best guess decides in the end.
    pieces = 3  # Pieces into which an undecided stretch is divided.
    row_spacing = 0.20  # Metres of displacement between rows that Drake checks in any case.
    # Mean number of segments per polyline above which shared corners are checked first.
    min_shared_segments = 8


@dataclass(frozen=True, eq=False)
class EdgeBounds:
    """Verdicts of the fast tier on E segments.

    Attributes:
        length: (E,) displacement of each segment [m].
        blocked_at: (E,) smallest checked share of each segment at which a collision is proven;
            infinite if there is none.
        doubted_at: (E,) smallest checked share at which a collision is proven or the best guess.
        open_edge, open_from, open_to: (G,) undecided stretches of segments that are not blocked:
            index of the segment, rising, and shares of it at which the stretch begins and ends.
    """

    length: Array
    blocked_at: Array
    doubted_at: Array
    open_edge: NDArray[np.intp]
    open_from: Array
    open_to: Array

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """(E,) segments that collide."""
        return np.isfinite(self.blocked_at)

    @property
    def proven(self) -> NDArray[np.bool_]:
        """(E,) segments that are free in all their length."""
        proven = ~self.blocked
        proven[self.open_edge] = False
        return proven

    def open_shares(self, edge: int) -> Array:
        """(g,) shares of a segment at which undecided stretches begin or end, rising."""
        begin, end = np.searchsorted(self.open_edge, (edge, edge + 1))
        return np.unique(np.concatenate([self.open_from[begin:end], self.open_to[begin:end]]))


def screen_edges(
    proximity: ArmProximity,
    q_a: Array,
    q_b: Array,
    *,
    hand: bool = True,
    refutes: bool | NDArray[np.bool_] = True,
    path: NDArray[np.intp] | None = None,
    known: Array | None = None,
    fine: float = EdgeCheckSettings.fine_length,
) -> EdgeBounds:
    """Judges straight joint segments by bounds of the arm's clearance.

    Args:
        proximity: the fast tier.
        q_a, q_b: (E, n) ends of the segments.
        hand: whether the hand counts against the scene.
        refutes: whether an upper bound below zero proves a collision, for all or (E,); otherwise it
            leaves the stretch undecided.
        path: (E,) number of the path that a segment belongs to; by default each is its own path.
            Undecided stretches of a blocked path are not divided further.
        known: (2, E) lower bounds of the clearance at both ends [m], if they have been computed
            before and neither end was blocked or doubted.
        fine: longest stretch that may be left undecided [m of displacement].

    Returns:
        The verdicts, with the stretches that remain undecided.
    """
    if not len(q_a):
        none = np.empty(0)
        return EdgeBounds(none, none, none, none.astype(np.intp), none, none)
    length = proximity.displacement(q_a, q_b)
    blocked_at, doubted_at = np.full((2, len(q_a)), np.inf)
    refutes = np.broadcast_to(np.asarray(refutes), len(q_a))
    path = np.arange(len(q_a)) if path is None else path
    is_decided = np.zeros(path.max() + 1, dtype=bool)

    def lower(edge: NDArray[np.intp], share: Array) -> Array:
        """Lower bounds of the clearance at (R,) places; records blocked and doubted ones."""
        q = q_a[edge] + share[:, None] * (q_b[edge] - q_a[edge])
        bounds = proximity.bounds(q, hand=hand)
        hit = (bounds.upper < 0.0) & refutes[edge]
        np.minimum.at(blocked_at, edge[hit], share[hit])
        is_decided[path[edge[hit]]] = True
        hit |= ~bounds.likely_free
        np.minimum.at(doubted_at, edge[hit], share[hit])
        return bounds.lower

    pieces = np.maximum(1, np.ceil(length / EdgeCheckSettings.coarse_length).astype(np.intp))
    edge = np.repeat(np.arange(len(q_a)), pieces + 1)
    share = _concatenate_ranges(pieces + 1) / pieces[edge]
    clearance = np.empty(len(edge))
    unknown = np.ones(len(edge), dtype=bool)
    if known is not None:
        unknown = (share > 0.0) & (share < 1.0)
        clearance[~unknown] = known.T.ravel()
    clearance[unknown] = lower(edge[unknown], share[unknown])
    inner = np.flatnonzero(edge[1:] == edge[:-1])
    edge, start, end = edge[inner], share[inner], share[inner + 1]
    c_start, c_end = clearance[inner], clearance[inner + 1]
    while True:
        displacement = (end - start) * length[edge]
        keep = (c_start + c_end <= displacement) & ~is_decided[path[edge]]
        edge, start, end, displacement = edge[keep], start[keep], end[keep], displacement[keep]
        if not len(edge) or displacement.max() <= fine:
            return EdgeBounds(length, blocked_at, doubted_at, edge, start, end)
        c_start, c_end = c_start[keep], c_end[keep]
        count = EdgeCheckSettings.pieces
        places = start[:, None] + np.arange(count + 1) / count * (end - start)[:, None]
        places[:, -1] = end
        inside = lower(np.repeat(edge, count - 1), places[:, 1:-1].ravel())
        inside = inside.reshape(len(edge), -1)
        edge = np.repeat(edge, count)
        start, end = places[:, :-1].ravel(), places[:, 1:].ravel()
        clearance = np.column_stack([c_start, inside, c_end])
        c_start, c_end = clearance[:, :-1].ravel(), clearance[:, 1:].ravel()


def _concatenate_ranges(counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """0 to count - 1 for each of the counts, one after the other."""
    ends = np.cumsum(counts)
    return np.arange(ends[-1]) - np.repeat(ends - counts, counts)


class EdgeChecker:
    """Judges straight joint segments of one arm in one scene.

    Attributes:
        proximity: the fast tier.
        collision: Drake's checker.
        exact: whether Drake's checker decides; otherwise the best guess of the fast tier counts.
        checks: number of Drake's checks so far.
    """

    def __init__(
        self, proximity: ArmProximity, collision: ArmCollision, *, exact: bool = True
    ) -> None:
        self.proximity = proximity
        self.collision = collision
        self.exact = exact
        self.checks = 0

    @property
    def content(self) -> str:
        """Hash of the fast tier's inputs."""
        return content_hash(self.proximity.content, self.exact)

    def is_free(self, q_a: Array, q_b: Array) -> bool:
        """Whether the arm can move straight in joint space from `q_a` (n,) to `q_b` (n,)."""
        return self.first_blocked(np.stack([q_a, q_b])) is None

    def screen(self, q_a: Array, q_b: Array, *, fine: float | None = None) -> EdgeBounds:
        """Verdicts of the fast tier on (E, n) segments, in one batch; stretches no longer than
        `fine` [m of displacement] may be left undecided."""
        fine = self._fine(hand=True) if fine is None else fine
        return screen_edges(self.proximity, q_a, q_b, fine=fine)

    def _fine(self, *, hand: bool) -> float:
        """Longest stretch that is left undecided [m of displacement]."""
        if not self.exact:
            return EdgeCheckSettings.guess_length
        return EdgeCheckSettings.hand_fine_length if hand else EdgeCheckSettings.fine_length

    def seem_free(self, screened: EdgeBounds, *, guess: bool = False) -> NDArray[np.bool_]:
        """(E,) segments worth an exact check: with `exact` those without a proven collision;
        otherwise, and with `guess`, those that are free by the best guess."""
        return np.isinf(screened.blocked_at if self.exact and not guess else screened.doubted_at)

    def confirm(self, q_a: Array, q_b: Array, screened: EdgeBounds, edge: int) -> bool:
        """Whether a segment of a screened batch (E, n) is free.

        Without `exact` this is the screen's guess.
        """
        if not self.exact:
            return bool(np.isinf(screened.doubted_at[edge]))
        if screened.blocked[edge]:
            return False
        step = q_b[edge] - q_a[edge]
        return all(
            self._is_free(q_a[edge] + share * step)
            for _, share in _rows_to_check(screened, edge, 1)
        )

    def first_blocked(
        self,
        q: Array,
        *,
        hand: bool = True,
        carried: str | None = None,
        moved_W: Array | None = None,
        width: float = np.nan,
    ) -> int | None:
        """Where a polyline in joint space is blocked.

        Args:
            q: (M, n) its corners, at least one.
            hand: whether the fast tier includes the hand against the scene. False if the hand's
                motion has been checked before. Drake always includes it.
            carried: instance that the hand carries, if any. The fast tier sees it at its placement,
                so it then proves no collision, and Drake alone checks it against the arm.
            moved_W: (M, 3) displacement of the carried instance at each corner [m]; linear between
                corners.
            width: distance between the pads that carry it [m]; NaN if the hand is open.

        Returns:
            Index of a corner that is not free, or of the end of a blocked segment: the first that
            the bounds refute, else the first that Drake refutes; None if all is free.
        """
        return self.first_blocked_each(
            [q],
            hand=hand,
            carried=[carried],
            moved_W=None if moved_W is None else [moved_W],
            width=[width],
        )[0]

    def first_blocked_each(
        self,
        paths: Sequence[Array],
        *,
        hand: bool = True,
        carried: Sequence[str | None] | None = None,
        moved_W: Sequence[Array] | None = None,
        width: Sequence[float] | None = None,
        lower: Sequence[Array] | None = None,
    ) -> list[int | None]:
        """`first_blocked` of several polylines, with one batch of the fast tier. The results do
        not depend on each other.

        Args:
            paths, carried, moved_W, width: one entry for each polyline.
            hand: see `first_blocked`; the same for all.
            lower: lower bounds of the clearance at the corners [m], if they have been computed
                before and no corner was blocked or doubted.
        """
        if not len(paths):
            return []
        names = carried or [None] * len(paths)
        corners = [np.asarray(q if len(q) > 1 else [*q, *q], dtype=float) for q in paths]
        places = [np.zeros((len(q), 3)) for q in corners]
        for place, given in zip(places, moved_W or (), strict=False):
            place[:] = given  # that of a single corner counts at both ends
        counts = [len(q) - 1 for q in corners]
        path = np.repeat(np.arange(len(paths)), counts)
        if lower is None and sum(counts) >= EdgeCheckSettings.min_shared_segments * len(paths):
            lower = self._lower_at_corners(corners, hand)
        known = None
        if lower is not None:
            bounds = [c if len(c) > 1 else np.repeat(c, 2) for c in lower]
            known = np.stack(
                [np.concatenate([c[:-1] for c in bounds]), np.concatenate([c[1:] for c in bounds])]
            )
        screened = screen_edges(
            self.proximity,
            np.concatenate([q[:-1] for q in corners]),
            np.concatenate([q[1:] for q in corners]),
            hand=hand,
            fine=self._fine(hand=hand),
            refutes=np.array([not name for name in names])[path],
            path=path,
            known=known,
        )
        first = np.cumsum([0, *counts])
        widths = [np.nan] * len(paths) if width is None else width
        return [
            self._first_blocked(screened, int(first[k]), corners[k], names[k], places[k], widths[k])
            for k in range(len(paths))
        ]

    def _lower_at_corners(self, corners: Sequence[Array], hand: bool) -> list[Array] | None:
        """Lower bounds at the corners of paths, each computed once; None if any corner is blocked
        or doubted, as the screen of the segments has to record that."""
        bounds = self.proximity.bounds(np.concatenate(corners), hand=hand)
        if bounds.blocked.any() or not bounds.likely_free.all():
            return None
        return np.split(bounds.lower, np.cumsum([len(q) for q in corners])[:-1])

    def _first_blocked(
        self,
        screened: EdgeBounds,
        first: int,
        q: Array,
        carried: str | None,
        moved_W: Array,
        width: float,
    ) -> int | None:
        """`first_blocked` of a polyline whose segments begin at index `first` of `screened`."""
        at = screened.blocked_at if self.exact else screened.doubted_at
        hit = np.flatnonzero(np.isfinite(at[first : first + len(q) - 1]))
        if len(hit):
            return 0 if hit[0] == 0 and at[first] == 0.0 else int(hit[0]) + 1
        for row, share in _rows_to_check(screened, first, len(q) - 1) if self.exact else ():
            edge = row - first
            place = q[edge] + share * (q[edge + 1] - q[edge])
            moved = moved_W[edge] + share * (moved_W[edge + 1] - moved_W[edge])
            if not self._is_free(place, carried, moved if carried else NO_DISPLACEMENT, width):
                return edge if share == 0.0 else edge + 1
        return None

    def _is_free(
        self,
        q: Array,
        carried: str | None = None,
        moved_W: ArrayLike = NO_DISPLACEMENT,
        width: float = np.nan,
    ) -> bool:
        self.checks += 1
        return self.collision.is_free(q, carried=carried, moved_W=moved_W, width=width)


def _rows_to_check(screened: EdgeBounds, first: int, count: int) -> Iterator[tuple[int, float]]:
    """Places for Drake to check along `count` successive segments from the `first`: segment and
    share of it, in order. A corner is checked as the start of a segment."""
    end = first + count
    since = np.inf
    begin, stop = np.searchsorted(screened.open_edge, (first, end))
    undecided = set(screened.open_edge[begin:stop].tolist())
    for edge, length in enumerate(screened.length[first:end].tolist(), first):
        pieces = max(1, math.ceil(length / EdgeCheckSettings.row_spacing))
        shares = set(screened.open_shares(edge).tolist()) if edge in undecided else set()
        shares.update(k / pieces for k in range(1, pieces))
        if since + length > EdgeCheckSettings.row_spacing:
            shares.add(0.0)
        if edge + 1 == end:
            shares.add(1.0)
        since = length * (1.0 - max(shares)) if shares else since + length
        if 1.0 in shares and edge + 1 < end:  # checked as the start of the next segment
            shares.remove(1.0)
            since = np.inf
        yield from ((edge, share) for share in sorted(shares))
