"""Whether an arm can move along straight joint segments: bounds of its clearance prove what lies
between the configurations that Drake's collision checker is asked about.

A yes in exact mode is always one that Drake has seen: at rows at most `ROWS` apart where the bounds
prove what is between, at both ends of every stretch of at most `edge_screen.FINE` where they do
not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, content_hash
from burg_drake.motion.collision.checker import STILL, ArmCollision
from burg_drake.motion.collision.edge_screen import FINE, GRAZE, GUESS, EdgeBounds, screen_edges
from burg_drake.motion.proximity import ArmProximity

ROWS = 0.20
"""Displacement between rows that Drake is asked about although bounds prove what is between [m].
What bounds a displacement counts every joint by itself: 0.53 m for 10 cm of a Panda's straight
approach."""


SHARED = 8
"""From so many segments a polyline on it pays to look at shared corners first, and once."""


class EdgeChecker:
    """Judges straight joint segments of one arm in one scene.

    Attributes:
        proximity: the fast tier.
        collision: Drake's checker.
        exact: whether Drake is asked; otherwise the best guess of the fast tier counts.
        checks: how often Drake has been asked so far.
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
        """Hash of what the fast tier's answers follow from."""
        return content_hash(self.proximity.content, self.exact)

    def is_free(self, q_a: Array, q_b: Array) -> bool:
        """Whether the arm can move straight in joint space from `q_a` (n,) to `q_b` (n,)."""
        return self.first_blocked(np.stack([q_a, q_b])) is None

    def screen(self, q_a: Array, q_b: Array, *, fine: float | None = None) -> EdgeBounds:
        """What the fast tier says of (E, n) segments, in one batch; stretches no longer than `fine`
        [m of displacement] may be left undecided."""
        fine = self._fine(hand=True) if fine is None else fine
        return screen_edges(self.proximity, q_a, q_b, fine=fine)

    def _fine(self, *, hand: bool) -> float:
        """Longest stretch that is left undecided [m of displacement]."""
        if not self.exact:
            return GUESS
        return GRAZE if hand else FINE

    def seem_free(self, screened: EdgeBounds, *, guess: bool = False) -> NDArray[np.bool_]:
        """(E,) segments that are worth a closer look: with `exact` those that nothing is proven
        against; otherwise, and with `guess`, those that are free by the best guess."""
        return np.isinf(screened.blocked_at if self.exact and not guess else screened.doubted_at)

    def confirm(self, q_a: Array, q_b: Array, screened: EdgeBounds, edge: int) -> bool:
        """The verdict on one of the segments (E, n) that `screen` has looked at.

        Without `exact` that is the screen's guess.
        """
        if not self.exact:
            return bool(np.isinf(screened.doubted_at[edge]))
        if screened.blocked[edge]:
            return False
        step = q_b[edge] - q_a[edge]
        return all(self._is_free(q_a[edge] + share * step) for _, share in _rows(screened, edge, 1))

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
            hand: whether the fast tier counts the hand against the scene; without, the motion of
                the hand has been judged otherwise. Drake counts it all the same.
            carried: instance that the hand carries, if any. The fast tier, which sees it where the
                scene has it, then proves nothing blocked, and Drake alone sees it against the arm.
            moved_W: (M, 3) how far the carried instance is from its place at each corner [m];
                straight between corners.
            width: distance between the pads that carry it [m]; NaN if the hand is open.

        Returns:
            Index of a corner that is not free, or of the one that a blocked segment leads to: the
            first that the bounds refute, else the first that Drake does; None if all is free.
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
        """`first_blocked` of each of several polylines, with one batch of the fast tier; what is
        said of one does not depend on the others.

        Args:
            paths, carried, moved_W, width: one entry for each.
            hand: for all.
            lower: lower bounds of the clearance at the corners, if they have been found before,
                where nothing spoke against them [m].
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
        if lower is None and sum(counts) >= SHARED * len(paths):
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
        """Lower bounds at the corners of paths, each looked at once; None if something speaks
        against one, for then the segments have to know."""
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
        """The verdict on a polyline whose segments begin at the `first` of those screened."""
        at = screened.blocked_at if self.exact else screened.doubted_at
        hit = np.flatnonzero(np.isfinite(at[first : first + len(q) - 1]))
        if len(hit):
            return 0 if hit[0] == 0 and at[first] == 0.0 else int(hit[0]) + 1
        for row, share in _rows(screened, first, len(q) - 1) if self.exact else ():
            edge = row - first
            place = q[edge] + share * (q[edge + 1] - q[edge])
            moved = moved_W[edge] + share * (moved_W[edge + 1] - moved_W[edge])
            if not self._is_free(place, carried, moved if carried else STILL, width):
                return edge if share == 0.0 else edge + 1
        return None

    def _is_free(
        self,
        q: Array,
        carried: str | None = None,
        moved_W: ArrayLike = STILL,
        width: float = np.nan,
    ) -> bool:
        self.checks += 1
        return self.collision.is_free(q, carried=carried, moved_W=moved_W, width=width)


def _rows(screened: EdgeBounds, first: int, count: int) -> Iterator[tuple[int, float]]:
    """What to ask Drake about along `count` segments that follow one another, from the `first`:
    segment and share of it, in order. A corner is asked about as the start of a segment."""
    end = first + count
    since = np.inf
    begin, stop = np.searchsorted(screened.open_edge, (first, end))
    undecided = set(screened.open_edge[begin:stop].tolist())
    for edge, length in enumerate(screened.length[first:end].tolist(), first):
        pieces = max(1, math.ceil(length / ROWS))
        shares = set(screened.open_shares(edge).tolist()) if edge in undecided else set()
        shares.update(k / pieces for k in range(1, pieces))
        if since + length > ROWS:
            shares.add(0.0)
        if edge + 1 == end:
            shares.add(1.0)
        since = length * (1.0 - max(shares)) if shares else since + length
        if 1.0 in shares and edge + 1 < end:  # asked about as the start of the next one
            shares.remove(1.0)
            since = np.inf
        yield from ((edge, share) for share in sorted(shares))
