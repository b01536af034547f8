"""Which verdicts of a table are contested, and which were settled by a second engine."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import CONTESTED

NEEDED = ("confidence", "judged_again")
"""Columns that tell."""


def contested_rows(confidence: Array, settled: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows (N,) whose verdict is contested, as `Verdict.contested` has it.

    Args:
        confidence: (N,) NaN where there is none.
        settled: (N,) whether another engine has judged again.
    """
    return (np.nan_to_num(confidence, nan=1.0) < CONTESTED) & ~settled


def settled_rows(judged_again: NDArray[Any]) -> NDArray[np.bool_]:
    """Rows (N,) that another engine has judged again, from their texts."""
    return np.asarray(judged_again != "", dtype=bool)
