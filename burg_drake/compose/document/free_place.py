"""A place on the board for more objects, by the convex polygons that they cover of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.compose.document.bounds_on_board import shadow
from burg_drake.compose.document.checker import missing_objects
from burg_drake.compose.document.state import State
from burg_drake.core import Array
from burg_drake.scene.arrangement import distances, no_fit_polygon

PLACE_SPACING = 0.01
"""Between the places that are tried [m]; of large boards, a sixtieth of their longer side."""
CLEARANCE = 0.005
"""Between the new objects and others, seen from above [m]."""


def free_spot(
    polygon: Array, state: State, obstacles: Sequence[Array] = ()
) -> tuple[float, float] | None:
    """The place nearest to the board's middle where an object is beside all others.

    Args:
        polygon: (N, 2) what it covers, its centre of mass above the origin [m].
        state: what is there already.
        obstacles: (N, 2) convex polygons of what else is in the way [m].

    Returns:
        x and y of its centre of mass [m]; None if there is no room.
    """
    middle = np.array(state.document.board.size) / 2
    middle -= (polygon.min(axis=0) + polygon.max(axis=0)) / 2
    offset = free_offset([polygon + middle], state, obstacles)
    if offset is None:
        return None
    x, y = np.round(middle + offset, 6)
    return float(x), float(y)


def free_offset(
    polygons: Sequence[Array], state: State, obstacles: Sequence[Array] = ()
) -> Array | None:
    """The shortest way by which objects can be shifted to be on the board and beside all that is
    there.

    Args:
        polygons: (N, 2) what each covers now [m].
        state: what is there already.
        obstacles: (N, 2) convex polygons of what else is in the way [m].

    Returns:
        (2,) the way [m]; None if there is no room.
    """
    size = np.array(state.document.board.size)
    pitch = max(PLACE_SPACING, float(size.max()) / 60)
    ticks = [np.arange(-(s // pitch), s // pitch + 1) * pitch for s in size]
    offsets = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    offsets = offsets[np.argsort((offsets**2).sum(axis=1), kind="stable")]
    corners = np.concatenate(list(polygons))
    lower, upper = corners.min(axis=0) + offsets, corners.max(axis=0) + offsets
    offsets = offsets[((lower >= 0.0) & (upper <= size)).all(axis=1)]
    missing = missing_objects(state)
    others = [shadow(state, name) for name in state.instances if name not in missing]
    for other in (*others, *obstacles):
        for polygon in polygons:
            if len(offsets):
                distance = distances(no_fit_polygon(other, polygon), offsets)
                offsets = offsets[distance >= CLEARANCE]
    return offsets[0] if len(offsets) else None
