"""What the arm can do with a grasp: a motion, or what failed first."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Outcome


@dataclass(frozen=True, eq=False)
class ArmPath:
    """A collision-free path of an arm with n joints, from home to the top of the lift.

    Between two rows the arm moves straight in joint space.

    Attributes:
        X_WG: (4, 4) the grasp in the world with the fingers as the arm puts them: as it was asked
            for, or with the two swapped.
        transfer: (M, n) from the home posture to the pregrasp; M is at least 2.
        approach: (K, n) from pregrasp to grasp; the hand moves straight.
        lift: (L, n) from there along the lift; a single row if it has no height.
        retreat: (J, n) from the grasp straight back along the approach, with the target; None if
            the lift begins at the grasp.
        clearance: of the hand, with what it holds, from everything on approach, retreat and
            lift, at least [m]; NaN if it is not known.
    """

    X_WG: Array
    transfer: Array
    approach: Array
    lift: Array
    clearance: float = np.nan
    retreat: Array | None = None


@dataclass(frozen=True, eq=False)
class Reach:
    """What the arm can do with a grasp.

    Attributes:
        outcome: what failed first; None if nothing did.
        blocker: what was in the way: a body, or an arm link and a body such as `panda_link5 vs
            mug`, of the motion that came closest; empty if nothing was. Of a yes whose lift is not
            whole, what was in the way of the whole one.
        clearance: of a yes, how far hand and arm stay away from everything on the straight parts,
            at least, where 0 means that no more than "free" is known; of a no, that of what was in
            the way, negative where it overlaps [m]; NaN where nothing was.
        excess: how far the best configuration is beyond a joint limit, less
            `ReachSettings.limit_margin` [rad or m]; NaN if that is not the reason.
        path: the motion; None if there is none.
        lift: of a yes, length of its lift [m]; NaN of a no.
    """

    outcome: Outcome | None
    blocker: str = ""
    clearance: float = np.nan
    excess: float = np.nan
    path: ArmPath | None = None
    lift: float = np.nan

    @property
    def q_grasp(self) -> Array | None:
        """(n,) arm positions at the grasp [rad]; None if it is not reached."""
        return None if self.path is None else self.path.approach[-1]

    @property
    def q_pregrasp(self) -> Array | None:
        """(n,) arm positions at the pregrasp [rad]; None if it is not reached."""
        return None if self.path is None else self.path.approach[0]

    @property
    def witness(self) -> ArmPath | None:
        """`path`, by its earlier name; goes with 0.2."""
        warnings.warn("Reach.witness is Reach.path since 0.1", DeprecationWarning, stacklevel=2)
        return self.path
