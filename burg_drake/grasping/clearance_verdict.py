"""Verdicts on the open hand at a grasp: whether it is clear, by how much, and of what."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Outcome

CLEARANCE_VERSION = 1
"""Raised when the same grasps get other clearances or outcomes."""


@dataclass(frozen=True)
class Clearance:
    """Verdict on one grasp.

    Attributes:
        outcome: one of the `COLLISION_*` outcomes, or None if the hand is clear.
        blocker: name of the instance, obstacle or `table` that decided the outcome; "" if clear.
        overlap: depth of the deepest overlap with it [m]; 0 if there is none.
        clearance: signed distance of the open hand from `nearest` [m]; minus the depth if they
            overlap.
        nearest: the `blocker` if the hand overlaps it; else the nearest body.
    """

    outcome: Outcome | None
    blocker: str
    overlap: float
    clearance: float
    nearest: str


@dataclass(frozen=True, eq=False)
class ClearanceBatch:
    """Verdicts on N grasps.

    Attributes:
        outcome: (N,) values of `Outcome`; "" where the hand is clear.
        blocker, overlap, clearance, nearest: (N,) as in `Clearance`.
    """

    outcome: NDArray[np.str_]
    blocker: NDArray[np.str_]
    overlap: Array
    clearance: Array
    nearest: NDArray[np.str_]

    @property
    def clear(self) -> NDArray[np.bool_]:
        """(N,) whether the hand is clear."""
        return np.asarray(self.outcome == "")

    def __len__(self) -> int:
        return len(self.outcome)

    def __iter__(self) -> Iterator[Clearance]:
        columns = (self.outcome, self.blocker, self.overlap, self.clearance, self.nearest)
        for outcome, *others in zip(*(column.tolist() for column in columns), strict=True):
            yield Clearance(Outcome(outcome) if outcome else None, *others)
