"""Candidates for the motion of one grasp: how far each of them got, and what was in the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices

GRASP, APPROACH, RETREAT, LIFT, WHOLE = range(5)
"""Where a candidate ended: at the grasp, on the way there, back, or up, or not at all."""
SAME = 0.05
"""Postures whose joints differ by no more than this are taken for the same [rad or m]."""


@dataclass(eq=False)
class ChainCandidates:
    """C postures at a grasp, each with its continuation at L poses of the way.

    Attributes:
        flip: (C,) which of the two ways to put the fingers.
        q: (C, L, n) arm positions; NaN where the continuation has not got to.
        stage: (C,) where it ended.
        cost: (C,) of those that have not ended.
        open: (C,) whether it may still be proposed.
    """

    flip: Indices
    q: Array
    stage: Indices
    cost: Array
    open: NDArray[np.bool_]
    _blocked: list[tuple[int, float, Array, Array]] = field(default_factory=list)
    _closed: set[int] = field(default_factory=set)

    @classmethod
    def none(cls, poses: int, joints: int) -> Self:
        """Of a grasp of which nothing is known yet."""
        index = np.empty(0, np.intp)
        return cls(index, np.empty((0, poses, joints)), index, np.empty(0), np.empty(0, dtype=bool))

    def __len__(self) -> int:
        return len(self.flip)

    def add(self, flip: Indices, q: Array, pose: int) -> Indices:
        """Adds postures at one of the poses, without those that are there already.

        Args:
            flip: (S,) which way to put the fingers.
            q: (S, n) arm positions.
            pose: index of the pose.

        Returns:
            Indices of what is new.
        """
        first = len(self)
        if not len(q):
            return np.empty(0, np.intp)
        every_flip, every = np.append(self.flip, flip), np.concatenate([self.q[:, pose], q])
        same = np.abs(every[first:, None] - every).max(axis=-1) <= SAME
        same &= every_flip[first:, None] == every_flip
        kept = np.flatnonzero(same.argmax(axis=1) == np.arange(first, len(every)))
        count = len(kept)
        new = np.full((count, *self.q.shape[1:]), np.nan)
        new[:, pose] = q[kept]
        self.flip = np.append(self.flip, flip[kept])
        self.q = np.concatenate([self.q, new])
        self.stage = np.append(self.stage, np.full(count, GRASP))
        self.cost = np.append(self.cost, np.full(count, np.inf))
        self.open = np.append(self.open, np.zeros(count, dtype=bool))
        return np.arange(first, first + count)

    def complete(self, k: int, q: Array, cost: float) -> None:
        """Takes the continuation (L, n) of a candidate over, which may be proposed from now on."""
        self.q[k], self.cost[k], self.stage[k] = q, cost, WHOLE
        self.open[k] = self.flip[k] not in self._closed

    def stop(self, k: int, stage: int) -> None:
        """A candidate ends at a stage, as its continuation does not exist."""
        self.stage[k], self.open[k] = stage, False

    def block(self, k: int, stage: int, q: Array, moved_W: Array, upper: float) -> None:
        """A candidate ends at a stage, as it is in collision there.

        Args:
            k: its index.
            stage: where it ends.
            q: (n,) the arm positions in collision.
            moved_W: (3,) how far the target has been moved there [m].
            upper: bound of the clearance there [m].
        """
        self.stop(k, stage)
        self._blocked.append((stage, upper, q.copy(), moved_W))

    def close(self, flip: int) -> None:
        """Proposes nothing any more with the fingers in one way."""
        self._closed.add(flip)
        self.open[self.flip == flip] = False

    def best(self) -> int | None:
        """Index of the cheapest candidate that may be proposed; None if there is none."""
        which = np.flatnonzero(self.open)
        return int(which[self.cost[which].argmin()]) if len(which) else None

    def blocking(self, stage: int, count: int) -> tuple[Array, Array]:
        """Arm positions (K, n) in collision at a stage, the nearest to being free first, and how
        far the target has been moved there (K, 3) [m]; K is at most `count`."""
        of = sorted((b for b in self._blocked if b[0] == stage), key=lambda b: -b[1])[:count]
        q = np.array([b[2] for b in of]).reshape(len(of), self.q.shape[-1])
        return q, np.array([b[3] for b in of]).reshape(len(of), 3)
