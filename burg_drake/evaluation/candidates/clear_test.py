"""Which sampled grasps the hand can take as it is: the open hand is clear, the pads meet what they
should. What is in the way of the others is counted."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.grasping.quality import are_antipodal, grasp_contacts

if TYPE_CHECKING:
    from burg_drake.evaluation.candidates.sampling_settings import SamplingSettings
    from burg_drake.geometry import Surface
    from burg_drake.grasping.clearance import ClearanceMode, HandClearance
    from burg_drake.grasping.quality import Jaws

PADS = "pads"
"""Stands among what is in the way for grasps whose pads do not meet the object antipodally, though
the two points do that the grasp was made of: a pad covers more than a point."""


class ClearTest:
    """Keeps grasps of one object, see `grasping.sampling.antipodal.Accept`.

    Args:
        screen: of the open hand.
        name: of the object in the screen.
        X_WO: (4, 4) where it is in the screen's world.
        surface: the object's.
        jaws: the hand's.
        friction: coefficient between object and pads.
        settings: margin and mode of the screen.

    Attributes:
        blocked: number of grasps by the body that the open hand hits, the object itself among them,
            and under `PADS`.
    """

    def __init__(
        self,
        screen: HandClearance,
        name: str,
        X_WO: Array,
        surface: Surface,
        jaws: Jaws,
        friction: float,
        settings: SamplingSettings,
    ) -> None:
        self._screen, self._name, self._X_WO = screen, name, X_WO
        self._surface, self._jaws, self._friction = surface, jaws, friction
        self._mode: ClearanceMode = "conservative" if settings.conservative else "exact"
        self._margin = settings.margin
        self.blocked: Counter[str] = Counter()

    def __call__(self, X_OG: Array) -> NDArray[np.bool_]:
        """Which of the grasps (N, 4, 4) to keep, (N,)."""
        X_WG = self._X_WO @ X_OG
        found = self._screen.measure(self._name, X_WG, mode=self._mode, margin=self._margin)
        passed = found.clear
        self.blocked.update(found.blocker[~passed].tolist())
        clear = np.flatnonzero(passed)
        contacts = grasp_contacts(self._surface, X_OG[clear], self._jaws)
        passed[clear] = are_antipodal(contacts, X_OG[clear], self._friction)
        self.blocked[PADS] += len(clear) - int(passed.sum())
        return passed
