"""What the arm does to execute a grasp, as positions along its way, without time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core.frames import Array


@dataclass(frozen=True, eq=False)
class Witness:
    """A collision-free motion of an arm with n joints.

    Between two rows the arm moves straight in joint space.

    Attributes:
        X_WG: (4, 4) the grasp in the world with the fingers as the arm puts them: as it was asked
            for, or with the two swapped.
        transfer: (M, n) from the home posture to the pregrasp; M is at least 2.
        approach: (K, n) from pregrasp to grasp; the hand moves straight.
        lift: (L, n) from the grasp straight up in the world.
        clearance: of the hand, with what it holds, from everything on approach and lift, at least
            [m]; NaN if it is not known.
    """

    X_WG: Array
    transfer: Array
    approach: Array
    lift: Array
    clearance: float = np.nan
