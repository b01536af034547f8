"""Two searches for chains, one after the other: the second is asked where the first says that the
arm cannot follow a line.

The closed form looks at all values of the redundant joint, but on a grid, which is too coarse where
the arm is nearly singular: joints turn far from one value to the next there. Following postures
numerically looks at few of them, and turns whichever joint the line needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.motion.lines.line_search import Chain, Failure, LineSearch, LineSearchBatch

STUCK = (Outcome.APPROACH_LINE, Outcome.RETREAT_LINE, Outcome.LIFT_LINE)
"""Outcomes of the first search that the second has another look at, the farther one last."""


class SuccessiveLineSearch:
    """Looks for chains by two searches; see `LineSearch`.

    Args:
        first: the search that is asked about every grasp.
        second: makes the other one, once it is needed.
    """

    def __init__(self, first: LineSearch, second: Callable[[], LineSearch]) -> None:
        self._first, self._make = first, second

    @cached_property
    def second(self) -> LineSearch:
        """The other search."""
        return self._make()

    def lifted(self, height: float) -> SuccessiveLineSearch:
        """See `LineSearch`."""
        return SuccessiveLineSearch(self._first.lifted(height), lambda: self.second.lifted(height))

    def begin(self, X_AG: Array, clearance: Array) -> _SuccessiveBatch:
        """See `LineSearch`."""
        return _SuccessiveBatch(self, self._first.begin(X_AG, clearance), X_AG, clearance)


class _SuccessiveBatch:
    """See `line_search.LineSearch`."""

    def __init__(
        self, search: SuccessiveLineSearch, first: LineSearchBatch, X_AG: Array, clearance: Array
    ) -> None:
        self._search, self._first = search, first
        self._X_AG, self._clearance = X_AG, clearance
        self._closed = np.zeros((len(X_AG), 2), dtype=bool)
        self._failed: dict[int, Failure] = {}
        self._again: dict[int, tuple[LineSearchBatch, int]] = {}

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """See `LineSearchBatch`."""
        found: dict[int, Chain | None] = dict.fromkeys(grasps)
        fresh = [g for g in grasps if g not in self._failed]
        found.update(zip(fresh, self._first.propose(fresh), strict=True))
        self._switch_search([g for g in fresh if found[g] is None])
        by_search: dict[int, tuple[LineSearchBatch, list[int]]] = {}
        for g in grasps:
            if g in self._again:
                lines, _ = self._again[g]
                by_search.setdefault(id(lines), (lines, []))[1].append(g)
        for lines, members in by_search.values():
            chains = lines.propose([self._again[g][1] for g in members])
            found.update(zip(members, chains, strict=True))
        return [found[g] for g in grasps]

    def refuse(self, grasp: int, chain: Chain, row: int | None) -> None:
        """See `LineSearchBatch`."""
        lines, number = self._again.get(grasp, (self._first, grasp))
        lines.refuse(number, chain, row)

    def close(self, grasp: int, flip: int) -> None:
        """See `LineSearchBatch`."""
        self._closed[grasp, flip] = True
        lines, number = self._again.get(grasp, (self._first, grasp))
        lines.close(number, flip)

    def failure(self, grasp: int) -> Failure:
        """See `LineSearchBatch`: what the search says that got farther, or else has more to say."""
        first = self._failed[grasp] if grasp in self._failed else self._first.failure(grasp)
        if grasp not in self._again:
            return first
        lines, number = self._again[grasp]
        second = lines.failure(number)
        return max(first, second, key=_rank)

    def _switch_search(self, grasps: Sequence[int]) -> None:
        """Leaves grasps to the second search where that may help."""
        if not grasps:
            return
        self._failed |= {g: self._first.failure(g) for g in grasps}
        left = [g for g in grasps if self._failed[g].outcome in STUCK]
        if not left:
            return
        lines = self._search.second.begin(self._X_AG[left], self._clearance[left])
        for number, g in enumerate(left):
            self._again[g] = lines, number
            for flip in np.flatnonzero(self._closed[g]):
                lines.close(number, int(flip))


def _rank(failure: Failure) -> tuple[int, bool]:
    """How far a search got, and whether it says why it got no farther."""
    far = STUCK.index(failure.outcome) if failure.outcome in STUCK else -1
    return far, bool(len(failure.q)) or bool(np.isfinite(failure.excess))
