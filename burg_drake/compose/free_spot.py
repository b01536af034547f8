"""A place on the board for one more object."""

from __future__ import annotations

import numpy as np

from burg_drake.compose.checker import lost
from burg_drake.compose.footprint import bounds
from burg_drake.compose.state import State
from burg_drake.core.frames import Array

PITCH = 0.01
"""Between the places that are tried [m]; of large boards, a sixtieth of their longer side."""
CLEARANCE = 0.005
"""Between the new object's bounds and those of others [m]."""


def free_spot(standing: Array, state: State) -> tuple[float, float]:
    """The place nearest to the board's middle where an object is beside all others.

    Args:
        standing: (2, 3) bounds of the object in its pose, its centre of mass above the origin [m].
        state: what is there already.

    Returns:
        x and y of its centre of mass [m]; the middle of the board if there is no room.
    """
    size = np.array(state.document.board.size)
    pitch = max(PITCH, float(size.max()) / 60)
    ticks = [np.arange(-(s // (2 * pitch)), s // (2 * pitch) + 1) * pitch for s in size]
    offsets = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    offsets = offsets[np.argsort((offsets**2).sum(axis=1), kind="stable")]
    middle = size / 2 - standing[:, :2].mean(axis=0)
    spots = middle + offsets
    lower, upper = spots + standing[0, :2], spots + standing[1, :2]
    free = ((lower >= 0.0) & (upper <= size)).all(axis=1)
    for name in set(state.instances) - set(lost(state)):
        other = bounds(state, name)[:, :2]
        apart = (lower > other[1] + CLEARANCE) | (upper < other[0] - CLEARANCE)
        free &= apart.any(axis=1)
    x, y = np.round(spots[free.argmax()] if free.any() else middle, 6)
    return float(x), float(y)
