"""Searches for the straight segments of a grasp's motion: their interface, and two in succession.

A chain is a motion of the arm from pregrasp to grasp, back along the approach, and along the lift.
A search proposes chains, the most promising first. The caller checks them against the scene and
refuses those in collision.

The closed form searches all values of the redundant joint on a grid, which is too coarse where the
arm is nearly singular. The numeric search follows few postures, but moves any joint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from burg_drake.core import Array, Outcome


@dataclass(frozen=True, eq=False)
class Chain:
    """Arm positions along the straight parts of a grasp's motion.

    Between two rows the arm moves straight in joint space, and the hand straight, up to a small
    deviation.

    Attributes:
        flip: finger assignment, 0 or 1.
        q: (M, n) from the pregrasp over the grasp to the top of the lift.
        at_grasp: row of the grasp.
        at_retreated: row at which the retreat ends and the lift begins.
        moved_W: (M, 3) displacement of the target in the world [m]; 0 up to the grasp.
        lower: (M,) lower bound of the arm's clearance, without the hand [m].
        place: the search's own reference to the chain.
    """

    flip: int
    q: Array
    at_grasp: int
    at_retreated: int
    moved_W: Array
    lower: Array
    place: Any = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Failure:
    """Why there is no chain.

    Attributes:
        outcome: `NO_IK`, `JOINT_LIMIT`, `ARM_COLLISION`, `APPROACH_LINE`, `RETREAT_LINE` or
            `LIFT_LINE`.
        excess: smallest excess of a configuration over the joint limits, including the margin [rad
            or m]; NaN if that is not the reason.
        q: (K, n) colliding configurations, the nearest to being free first.
        moved_W: (K, 3) displacement of the target at these configurations [m].
        reason: in words, where neither a joint limit nor a collision is the reason; or "".
    """

    outcome: Outcome
    excess: float = np.nan
    q: Array = field(default_factory=lambda: np.empty((0, 0)))
    moved_W: Array = field(default_factory=lambda: np.empty((0, 3)))
    reason: str = ""

    @classmethod
    def of_line(cls, outcome: Outcome, excess: float) -> Failure:
        """A segment that the arm cannot follow although nothing is in its way.

        Args:
            outcome: `APPROACH_LINE`, `RETREAT_LINE` or `LIFT_LINE`.
            excess: smallest excess of a configuration at the first and the last pose that no chain
                reaches [rad or m], the larger one; infinite if one has none even without limits.
        """
        if 0.0 < excess < np.inf:
            return cls(outcome, excess=excess)
        name = outcome.value.removesuffix("_line")
        if excess == np.inf:
            return cls(outcome, reason=f"part of the {name} is out of the arm's reach")
        return cls(outcome, reason=f"no joint motion connects the arm's postures on the {name}")


class LineSearchBatch(Protocol):
    """The search of a batch of N grasps; the results do not depend on each other."""

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """The most promising chain of each grasp that has not been refused; None if none is
        left."""
        ...

    def refuse(self, grasp: int, chain: Chain, row: int | None) -> None:
        """Excludes a chain, and others that would fail in the same way, from the search.

        Args:
            grasp: index of the grasp.
            chain: the chain.
            row: the row at which, or just before which, the arm is in collision; None if no path
                leads to the pregrasp posture.
        """
        ...

    def close(self, grasp: int, flip: int) -> None:
        """Excludes one finger assignment of a grasp: the hand itself collides, so that no posture
        of the arm helps."""
        ...

    def failure(self, grasp: int) -> Failure:
        """Why no chain is left."""
        ...


class LineSearch(Protocol):
    """Searches chains of an arm in a scene."""

    def lifted(self, height: float) -> LineSearch:
        """The same search with a lift to another height [m]."""
        ...

    def begin(self, X_AG: Array, clearance: Array) -> LineSearchBatch:
        """Begins the search of a batch.

        Args:
            X_AG: (N, 2, 4, 4) grasps in the arm's base frame, with both finger assignments. Their
                order does not depend on how a grasp was given.
            clearance: (N, 2) room of the hand on its path [m], see `GraspBatch.room`; the hand may
                deviate from the straight segment by a fraction of it.
        """
        ...


RETRIED_OUTCOMES = (Outcome.APPROACH_LINE, Outcome.RETREAT_LINE, Outcome.LIFT_LINE)
"""Outcomes after which the second search is tried, in order of progress."""


class SuccessiveLineSearch:
    """Tries a second search where the first one fails; see `LineSearch`.

    Args:
        first: the search for every grasp.
        second: makes the second search when it is first needed.
    """

    def __init__(self, first: LineSearch, second: Callable[[], LineSearch]) -> None:
        self._first, self._make_second = first, second

    @cached_property
    def second(self) -> LineSearch:
        """The second search."""
        return self._make_second()

    def lifted(self, height: float) -> SuccessiveLineSearch:
        """See `LineSearch`."""
        return SuccessiveLineSearch(self._first.lifted(height), lambda: self.second.lifted(height))

    def begin(self, X_AG: Array, clearance: Array) -> _SuccessiveBatch:
        """See `LineSearch`."""
        return _SuccessiveBatch(self, self._first.begin(X_AG, clearance), X_AG, clearance)


class _SuccessiveBatch:
    """See `LineSearchBatch`."""

    def __init__(
        self, search: SuccessiveLineSearch, first: LineSearchBatch, X_AG: Array, clearance: Array
    ) -> None:
        self._search, self._first = search, first
        self._X_AG, self._clearance = X_AG, clearance
        self._closed = np.zeros((len(X_AG), 2), dtype=bool)
        self._first_failures: dict[int, Failure] = {}
        self._second_batches: dict[int, tuple[LineSearchBatch, int]] = {}

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """See `LineSearchBatch`."""
        found: dict[int, Chain | None] = dict.fromkeys(grasps)
        fresh = [g for g in grasps if g not in self._first_failures]
        found.update(zip(fresh, self._first.propose(fresh), strict=True))
        self._switch_search([g for g in fresh if found[g] is None])
        by_search: dict[int, tuple[LineSearchBatch, list[int]]] = {}
        for g in grasps:
            if g in self._second_batches:
                batch, _ = self._second_batches[g]
                by_search.setdefault(id(batch), (batch, []))[1].append(g)
        for batch, members in by_search.values():
            chains = batch.propose([self._second_batches[g][1] for g in members])
            found.update(zip(members, chains, strict=True))
        return [found[g] for g in grasps]

    def refuse(self, grasp: int, chain: Chain, row: int | None) -> None:
        """See `LineSearchBatch`."""
        batch, index = self._second_batches.get(grasp, (self._first, grasp))
        batch.refuse(index, chain, row)

    def close(self, grasp: int, flip: int) -> None:
        """See `LineSearchBatch`."""
        self._closed[grasp, flip] = True
        batch, index = self._second_batches.get(grasp, (self._first, grasp))
        batch.close(index, flip)

    def failure(self, grasp: int) -> Failure:
        """See `LineSearchBatch`; the failure of the search that got farther or explains more."""
        first = self._first_failures.get(grasp) or self._first.failure(grasp)
        if grasp not in self._second_batches:
            return first
        batch, index = self._second_batches[grasp]
        second = batch.failure(index)
        farther = max(first, second, key=_failure_rank)
        if first.outcome != second.outcome or not (len(first.q) and len(second.q)):
            return farther
        q, moved_W = np.concatenate([first.q, second.q]), [first.moved_W, second.moved_W]
        return replace(farther, q=q, moved_W=np.concatenate(moved_W))

    def _switch_search(self, grasps: Sequence[int]) -> None:
        """Hands grasps over to the second search if it may succeed."""
        if not grasps:
            return
        self._first_failures |= {g: self._first.failure(g) for g in grasps}
        left = [g for g in grasps if self._first_failures[g].outcome in RETRIED_OUTCOMES]
        if not left:
            return
        batch = self._search.second.begin(self._X_AG[left], self._clearance[left])
        for index, g in enumerate(left):
            self._second_batches[g] = batch, index
            for flip in np.flatnonzero(self._closed[g]):
                batch.close(index, int(flip))


def _failure_rank(failure: Failure) -> tuple[int, bool]:
    """Sort key: how far a search got, and whether it explains the failure."""
    far = RETRIED_OUTCOMES.index(failure.outcome) if failure.outcome in RETRIED_OUTCOMES else -1
    return far, bool(len(failure.q)) or bool(np.isfinite(failure.excess))
