"""A place on the board for more objects, by their bounds."""

from __future__ import annotations

import numpy as np

from burg_drake.compose.checker import lost
from burg_drake.compose.footprint import bounds
from burg_drake.compose.state import State
from burg_drake.core.frames import Array

PITCH = 0.01
"""Between the places that are tried [m]; of large boards, a sixtieth of their longer side."""
CLEARANCE = 0.005
"""Between the new objects' bounds and those of others [m]."""


def free_spot(standing: Array, state: State) -> tuple[float, float]:
    """The place nearest to the board's middle where an object is beside all others.

    Args:
        standing: (2, 3) bounds of the object in its pose, its centre of mass above the origin [m].
        state: what is there already.

    Returns:
        x and y of its centre of mass [m]; the middle of the board if there is no room.
    """
    middle = np.array(state.document.board.size) / 2 - standing[:, :2].mean(axis=0)
    offset = free_offset(standing[None, :, :2] + middle, state)
    x, y = np.round(middle if offset is None else middle + offset, 6)
    return float(x), float(y)


def free_offset(boxes: Array, state: State) -> Array | None:
    """The shortest way by which objects can be shifted to be on the board and beside all that is
    there.

    Args:
        boxes: (N, 2, 2) lower and upper corners of their bounds along x and y [m].
        state: what is there already.

    Returns:
        (2,) the way [m]; None if there is no room.
    """
    size = np.array(state.document.board.size)
    pitch = max(PITCH, float(size.max()) / 60)
    ticks = [np.arange(-(s // pitch), s // pitch + 1) * pitch for s in size]
    offsets = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    offsets = offsets[np.argsort((offsets**2).sum(axis=1), kind="stable")]
    lower, upper = boxes.min(axis=(0, 1)) + offsets, boxes.max(axis=(0, 1)) + offsets
    offsets = offsets[((lower >= 0.0) & (upper <= size)).all(axis=1)]
    for name in set(state.instances) - set(lost(state)):
        other = bounds(state, name)[:, :2]
        for box in boxes:
            beyond = box[0] + offsets > other[1] + CLEARANCE
            before = box[1] + offsets < other[0] - CLEARANCE
            offsets = offsets[(beyond | before).any(axis=1)]
    return offsets[0] if len(offsets) else None
