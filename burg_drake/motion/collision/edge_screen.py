"""The fast tier along straight joint segments, many at a time.

A lower bound `c` of the clearance at a configuration proves free whatever lies within a
displacement of `c` (Schwarzer, Saha and Latombe, "Adaptive dynamic collision checking for single
and multiple articulated robots in complex environments", IEEE T-RO 21(3), 2005). A stretch between
two configurations is therefore proven free where their bounds add up to more than the displacement
between them; where they do not, it is divided, down to a fixed length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.motion.proximity import ArmProximity

COARSE = 0.08
"""Longest stretch that the screen begins with [m of displacement]."""
FINE = 0.003
"""Longest stretch that is left undecided [m of displacement]."""
GRAZE = 0.001
"""The same where the hand passes objects without having been swept: at 3 mm a hand was missed that
cut a corner by 0.2 mm."""
GUESS = 0.012
"""The same where a best guess decides in the end."""
PIECES = 3
"""Into how many pieces a stretch is divided. Halving would need fewer configurations, but more
batches, whose overhead counts where there are few segments."""


@dataclass(frozen=True, eq=False)
class EdgeBounds:
    """What the fast tier says of E segments.

    Attributes:
        length: (E,) displacement of each segment [m].
        blocked_at: (E,) smallest share of each segment at which a collision is proven, among those
            that were looked at; infinite if none is.
        doubted_at: (E,) the same where a collision is the best guess.
        open_edge, open_from, open_to: (G,) undecided stretches of segments that are not blocked:
            index of the segment, ordered, and share of it at which the stretch begins and ends.
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
        """(g,) where on a segment the undecided stretches begin and end, rising."""
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
    fine: float = FINE,
) -> EdgeBounds:
    """Judges straight joint segments by bounds of the arm's clearance.

    Args:
        proximity: the fast tier.
        q_a, q_b: (E, n) ends of the segments.
        hand: whether the hand counts against the scene.
        refutes: whether an upper bound below zero proves a collision, for all or (E,); otherwise it
            leaves the stretch undecided.
        path: (E,) number of the path that a segment belongs to, each its own by default; what is
            undecided on a blocked path is left as it is.
        known: (2, E) lower bounds of the clearance at both ends, if they have been found before,
            where nothing spoke against them [m].
        fine: longest stretch that may be left undecided [m of displacement].

    Returns:
        What is proven, what is blocked, and which stretches are neither.
    """
    if not len(q_a):
        none = np.empty(0)
        return EdgeBounds(none, none, none, none.astype(np.intp), none, none)
    length = proximity.displacement(q_a, q_b)
    blocked_at, doubted_at = np.full((2, len(q_a)), np.inf)
    refutes = np.broadcast_to(np.asarray(refutes), len(q_a))
    path = np.arange(len(q_a)) if path is None else path
    over = np.zeros(path.max() + 1, dtype=bool)

    def lower(edge: NDArray[np.intp], share: Array) -> Array:
        """Lower bounds of the clearance at (R,) places; notes what they say of their segments."""
        q = q_a[edge] + share[:, None] * (q_b[edge] - q_a[edge])
        bounds = proximity.bounds(q, hand=hand)
        hit = (bounds.upper < 0.0) & refutes[edge]
        np.minimum.at(blocked_at, edge[hit], share[hit])
        over[path[edge[hit]]] = True
        hit |= ~bounds.likely_free
        np.minimum.at(doubted_at, edge[hit], share[hit])
        return bounds.lower

    pieces = np.maximum(1, np.ceil(length / COARSE).astype(np.intp))
    edge = np.repeat(np.arange(len(q_a)), pieces + 1)
    share = _within(pieces + 1) / pieces[edge]
    clearance = np.empty(len(edge))
    ask = np.ones(len(edge), dtype=bool)
    if known is not None:
        ask = (share > 0.0) & (share < 1.0)
        clearance[~ask] = known.T.ravel()
    clearance[ask] = lower(edge[ask], share[ask])
    inner = np.flatnonzero(edge[1:] == edge[:-1])
    edge, start, end = edge[inner], share[inner], share[inner + 1]
    c_start, c_end = clearance[inner], clearance[inner + 1]
    while True:
        displacement = (end - start) * length[edge]
        keep = (c_start + c_end <= displacement) & ~over[path[edge]]
        edge, start, end, displacement = edge[keep], start[keep], end[keep], displacement[keep]
        if not len(edge) or displacement.max() <= fine:
            return EdgeBounds(length, blocked_at, doubted_at, edge, start, end)
        c_start, c_end = c_start[keep], c_end[keep]
        places = start[:, None] + np.arange(PIECES + 1) / PIECES * (end - start)[:, None]
        places[:, -1] = end
        inside = lower(np.repeat(edge, PIECES - 1), places[:, 1:-1].ravel()).reshape(len(edge), -1)
        edge = np.repeat(edge, PIECES)
        start, end = places[:, :-1].ravel(), places[:, 1:].ravel()
        clearance = np.column_stack([c_start, inside, c_end])
        c_start, c_end = clearance[:, :-1].ravel(), clearance[:, 1:].ravel()


def _within(counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """0 to count - 1 for each of the counts, one after the other."""
    ends = np.cumsum(counts)
    return np.arange(ends[-1]) - np.repeat(ends - counts, counts)
