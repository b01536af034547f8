"""What the arm does to execute a grasp, as positions along its way, without time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array


@dataclass(frozen=True, eq=False)
class Witness:
    """A collision-free motion of an arm with n joints.

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
