"""The outcome group of every row, as numbers: what charts and pictures take their colours from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.report.elements.blocks import Html
from burg_drake.evaluation.report.elements.charts import legend
from burg_drake.evaluation.report.elements.style import STYLES
from burg_drake.evaluation.store import member_codes
from burg_drake.visualization.style import GROUPS

INDEX = {outcome: k for k, group in enumerate(GROUPS) for outcome in group.outcomes}
LIFTED = INDEX[Outcome.LIFTED]
"""Index of the group that is success."""


def group_indices(outcomes: NDArray[np.str_]) -> NDArray[np.int8]:
    """Index into `GROUPS` (N,) of each outcome (N,); one pass an outcome, not one a row."""
    return groups_of_codes(member_codes(outcomes, tuple(Outcome)))


def groups_of_codes(outcomes: NDArray[np.int8]) -> NDArray[np.int8]:
    """Index into `GROUPS` (N,) of outcomes that are given by their places in `Outcome`."""
    return np.array([INDEX[outcome] for outcome in Outcome], dtype=np.int8)[outcomes]


def present(groups: NDArray[np.int8]) -> list[int]:
    """Which groups there are, best first."""
    counts = np.bincount(groups[groups >= 0], minlength=len(GROUPS))
    return np.flatnonzero(counts).tolist()


def group_legend(indices: Sequence[int]) -> Html:
    """The colours of groups and their names."""
    return legend([(STYLES[GROUPS[k].name], GROUPS[k].name) for k in indices])
