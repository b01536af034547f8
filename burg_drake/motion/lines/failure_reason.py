"""Why there is no chain of postures: what of it is beyond the arm, or in collision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.motion.lines.grid_builder import PostureGridBuilder
from burg_drake.motion.lines.line_search import Failure
from burg_drake.motion.lines.posture_grid import PostureGrid

GridPlace = tuple[PostureGrid, int]
"""A grid, and the number of a grasp in it."""

EXPLAINED = 3
"""Postures that are named as being in the way."""


def failure(
    search: PostureGridBuilder, X_AG: Array, places: Sequence[GridPlace], farthest: float
) -> Failure:
    """Why a grasp has no chain.

    Args:
        search: where postures are looked for.
        X_AG: (2, 4, 4) the grasp with its fingers either way.
        places: its grids, the coarsest first.
        farthest: the layer that the best of the refused chains got to.
    """
    grid, i = places[-1]
    ends = [0, search.at_grasp]
    if not grid.exists[ends, i].any(axis=(1, 2, 3)).all():
        return _beyond_limits(search, X_AG)
    for layer in ends:
        if not _is_free(search, places, layer):
            return _blocking(search, X_AG, places, Outcome.ARM_COLLISION, layer)
    last = grid.reached(i) + 1
    if not 0 < last < grid.poses:
        # Where there still are chains, they have been given up: the best of them got this far.
        last = int(np.ceil(farthest))
    outcome = search.lines.outcome(last)
    return _blocking(search, X_AG, places, outcome, last)


def _is_free(search: PostureGridBuilder, places: Sequence[GridPlace], layer: int) -> bool:
    """Whether any posture at a layer is free as far as is known; if none of those that chains lead
    over is, all those of the first grid that has any are looked at."""
    if any(grid.measured_free(layer, i) for grid, i in places):
        return True
    grid, i = next((g, i) for g, i in places if g.exists[layer, i].any())
    search.measure(grid, np.array([layer]), np.array([i]), grid.exists)
    return grid.measured_free(layer, i)


def _blocking(
    search: PostureGridBuilder,
    X_AG: Array,
    places: Sequence[GridPlace],
    outcome: Outcome,
    layer: int,
) -> Failure:
    """Names the postures at a layer that are nearest to being free; where none is in collision,
    how far the nearest one is beyond its limits."""
    for grid, i in places:
        search.measure(grid, np.array([layer]), np.array([i]), grid.exists)
        blocked = grid.exists[layer, i] & ~grid.usable(layer, i)
        if blocked.any():
            break
    else:
        excess = _excess(search, X_AG, layer)
        return Failure(outcome, excess=excess if 0.0 < excess < np.inf else np.nan)
    where = np.argwhere(blocked)
    order = np.argsort(-grid.upper[layer, i][blocked], kind="stable")[:EXPLAINED]
    chosen = tuple(where[order].T)
    q = grid.q[(slice(None), layer, i, *chosen)].T
    moved_W = search.lines.carried(X_AG[chosen[0]], search.layers[[layer]])
    return Failure(outcome, q=q, moved_W=moved_W)


def _beyond_limits(search: PostureGridBuilder, X_AG: Array) -> Failure:
    """Whether there are postures beyond the joint limits, and by how much at least."""
    excess = max(_excess(search, X_AG, layer) for layer in (0, search.at_grasp))
    if excess == np.inf:
        return Failure(Outcome.NO_IK)
    return Failure(Outcome.JOINT_LIMIT, excess=excess)


def _excess(search: PostureGridBuilder, X_AG: Array, layer: int) -> float:
    """How far the best posture at a layer is beyond the joint limits [rad]; infinite if there is
    none whatever the limits."""
    ik = search.ik
    half = np.full(len(ik.lower), np.pi)
    centre = np.where(np.arange(len(half)) == 5, 0.5 * (ik.lower + ik.upper), 0.0)
    free = replace(ik, lower=centre - half, upper=centre + half)
    count = search.settings.redundant[-1]
    values = np.linspace(-np.pi, np.pi, count, endpoint=False)
    q = free.solve(search.lines.X_AH(X_AG, search.layers[layer]), values).q
    beyond = np.maximum(ik.lower - q, q - ik.upper).max(axis=1)
    return max(0.0, float(beyond.min(initial=np.inf)))
