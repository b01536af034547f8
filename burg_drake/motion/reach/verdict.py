"""What the arm can do with a grasp: a motion, or what failed first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.motion.reach.witness import Witness


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
        witness: the motion; None if there is none.
        lift: of a yes, length of its lift [m]; NaN of a no.
    """

    outcome: Outcome | None
    blocker: str = ""
    clearance: float = np.nan
    excess: float = np.nan
    witness: Witness | None = None
    lift: float = np.nan

    @property
    def q_grasp(self) -> Array | None:
        """(n,) arm positions at the grasp [rad]; None if it is not reached."""
        return None if self.witness is None else self.witness.approach[-1]

    @property
    def q_pregrasp(self) -> Array | None:
        """(n,) arm positions at the pregrasp [rad]; None if it is not reached."""
        return None if self.witness is None else self.witness.approach[0]
