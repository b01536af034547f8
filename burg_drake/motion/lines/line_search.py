"""What a search for the straight parts of a grasp's motion answers, whichever way it finds them.

A chain is a motion of the arm from pregrasp to grasp, back along the approach, and along the lift.
A search proposes chains, the most promising ones first; whoever asked holds them against the scene,
and says which of them do not do, and where.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome


@dataclass(frozen=True, eq=False)
class Chain:
    """Arm positions along the straight parts of a grasp's motion.

    Between two rows the arm moves straight in joint space, and the hand straight, up to a small
    deviation.

    Attributes:
        flip: which of the two grasps with fingers swapped it is, 0 or 1.
        q: (M, n) from the pregrasp over the grasp to the top of the lift.
        at_grasp: row of the grasp.
        at_retreated: row at which the retreat ends and the lift begins.
        moved_W: (M, 3) how far the target has been moved in the world [m]; 0 up to the grasp.
        lower: (M,) lower bound of the arm's clearance, without the hand [m].
        place: of the search, to know the chain again.
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
        excess: how far the best configuration is beyond the joint limits that are kept [rad or m];
            NaN where that is not the reason.
        q: (K, n) configurations that are in the way of it, the nearest to being free first.
        moved_W: (K, 3) how far the target has been moved there [m].
    """

    outcome: Outcome
    excess: float = np.nan
    q: Array = field(default_factory=lambda: np.empty((0, 0)))
    moved_W: Array = field(default_factory=lambda: np.empty((0, 3)))


class LineSearchBatch(Protocol):
    """The search of a batch of N grasps; what it answers about one depends on no other."""

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """The most promising chain of each of some grasps among those not refused; None if there
        is none (left)."""
        ...

    def refuse(self, grasp: int, chain: Chain, row: int | None) -> None:
        """Puts out of the search what keeps a chain from being free.

        Args:
            grasp: index of the grasp.
            chain: the chain.
            row: the row at which, or just before which, the arm is in collision; None if the arm
                does not get to its pregrasp.
        """
        ...

    def close(self, grasp: int, flip: int) -> None:
        """Leaves one way to put the fingers of a grasp out: the hand itself is in the way of
        something, and no posture of the arm helps."""
        ...

    def failure(self, grasp: int) -> Failure:
        """Why there is no chain (left)."""
        ...


class LineSearch(Protocol):
    """Looks for chains of an arm in a scene."""

    def lifted(self, height: float) -> LineSearch:
        """The same search with a lift to another height [m]."""
        ...

    def begin(self, X_AG: Array, clearance: Array) -> LineSearchBatch:
        """Begins with a batch.

        Args:
            X_AG: (N, 2, 4, 4) grasps in the arm's base frame, with the fingers either way; which of
                the two comes first does not depend on how a grasp was given.
            clearance: (N, 2) of the hand on its way with the fingers either way [m]: the hand may
                deviate from the straight segment by a fraction of it.
        """
        ...
