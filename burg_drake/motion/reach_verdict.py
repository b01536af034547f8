"""Verdict of the arm on a grasp: a motion, or what failed first."""

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
        X_WG: (4, 4) the grasp in the world with the chosen finger assignment: as given, or with
            the fingers swapped.
        transfer: (M, n) rows from the home posture to the pregrasp; M is at least 2.
        approach: (K, n) rows from pregrasp to grasp; the hand moves straight.
        lift: (L, n) rows along the lift; a single one if the lift has no height.
        retreat: (J, n) rows from the grasp straight back along the approach, with the target;
            None if the lift begins at the grasp.
        clearance: lower bound of the clearance of the hand on approach, retreat and lift; where
            the held target touches or overlaps a body at the start, at most the depth that it may
            still get into it [m]. NaN if it is not known.
    """

    X_WG: Array
    transfer: Array
    approach: Array
    lift: Array
    clearance: float = np.nan
    retreat: Array | None = None


@dataclass(frozen=True, eq=False)
class Reach:
    """Verdict of the arm on a grasp.

    Attributes:
        outcome: what failed first; None if the arm can execute the grasp.
        blocker: obstacle of the motion that came closest: a body, or an arm link and a body such as
            `panda_link5 vs mug`; empty if there was none. After success with a shortened lift, the
            obstacle of the whole lift.
        clearance: after success, lower bound of the clearance of hand and arm on the straight
            segments [m]; 0 if they are only known to be free. After a failure, clearance from the
            blocker, negative if it overlaps; NaN without a blocker.
        excess: how far the best configuration is beyond a joint limit, less
            `ReachSettings.limit_margin` [rad or m]; NaN if that is not the reason. If a segment
            fails, the larger one of the first and the last pose that no motion reaches.
        path: the motion; None after a failure.
        lift: length of the lift [m]; NaN after a failure.
        reason: why the arm cannot follow a segment, where neither an obstacle nor a joint limit is
            the reason; or "".
    """

    outcome: Outcome | None
    blocker: str = ""
    clearance: float = np.nan
    excess: float = np.nan
    path: ArmPath | None = None
    lift: float = np.nan
    reason: str = ""

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
        """Deprecated name of `path`; to be removed in 0.2."""
        warnings.warn("Reach.witness is Reach.path since 0.1", DeprecationWarning, stacklevel=2)
        return self.path
