"""Says what of a set of grasps a file of another project has no place for."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import listing
from burg_drake.core.grasps import GraspSet


def conversion_losses(grasps: GraspSet, carried: Collection[str], title: str) -> tuple[str, ...]:
    """A sentence about the columns that get lost, `id` among them; none if nothing gets lost.

    Args:
        grasps: what is written.
        carried: columns that the file has a place for.
        title: of the format.
    """
    lost = [
        name
        for name in grasps.column_names
        if name not in carried and _holds_something(grasps.column(name))
    ]
    return (f"{title} has no place for {listing(lost)}.",) if lost else ()


def _holds_something(values: NDArray[Any]) -> bool:
    if values.dtype.kind == "U":
        return bool((values != "").any())
    return values.dtype.kind != "f" or bool(np.isfinite(values).any())
