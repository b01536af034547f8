"""Diverse subsets of grasps, and how diverse a set is, under the distance of `similarity`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, InvalidInputError
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.similarity.neighbour_search import find_nearest
from burg_drake.grasping.similarity.pose_distance import (
    LEVER,
    P,
    check_lever,
    components,
    pair_angle,
    pair_translation,
)
from burg_drake.grasping.similarity.targets import by_target


def farthest_points(
    X_OG: ArrayLike, n: int, *, lever: float = LEVER, first: int | None = None
) -> NDArray[np.intp]:
    """Indices of n diverse grasps: each is the one farthest from all before it.

    Greedy farthest-point selection (T. F. Gonzalez, Theoretical Computer Science 38, 1985) under
    the combined distance of `similarity`. At every length the selection covers the set with a
    radius of at most twice the smallest that so many grasps can have. Depends on the physical
    grasps alone, not on their finger form; of equally far grasps the first one is taken, and
    duplicates come last, in order.

    Args:
        X_OG: (N, 4, 4) grasp poses in one frame.
        n: how many, at most N.
        lever: weight of the angle in the distance [m/rad].
        first: index of the grasp to begin with; by default the one whose position is farthest
            from the middle of the box around all positions.

    Returns:
        (n,) indices in the order of selection.

    Raises:
        InvalidInputError: n or first is out of range, or the lever is no weight.
    """
    check_lever(lever)
    G = components(X_OG)
    total = G.shape[1]
    if not 0 <= n <= total:
        raise InvalidInputError(f"cannot select {n} of {total} grasps; give 0 to {total}")
    if n == 0:
        return np.empty(0, dtype=np.intp)
    if first is not None and not 0 <= first < total:
        raise InvalidInputError(f"first is {first}; expected an index from 0 to {total - 1}")
    selected = np.empty(n, dtype=np.intp)
    distance = np.full(total, np.inf)
    new = _outermost(G) if first is None else first
    for k in range(n):
        selected[k] = new
        _lower(distance, G, new, lever)
        distance[new] = -np.inf  # never again, not even among duplicates
        new = int(np.argmax(distance))
    return selected


def neighbour_distances(grasps: GraspSet, *, lever: float = LEVER) -> Array:
    """How far each grasp is from the nearest other one of its object and instance.

    A set that repeats itself has small ones; the mean is a figure of its diversity, to be compared
    between sets of equal size only.

    Args:
        grasps: N grasps.
        lever: weight of the angle in the distance [m/rad].

    Returns:
        (N,) combined distances [m]; infinity for a grasp that is the only one.
    """
    distance = np.full(len(grasps), np.inf)
    for rows in by_target(grasps):
        G = components(grasps.X_OG[rows])
        _, distance[rows] = find_nearest(G, G, lever=lever, same=True)
    return distance


def _lower(distance: Array, G: Array, new: int, lever: float) -> None:
    """Lowers the distances (N,) to the selection by a grasp that joins it.

    The translation alone is a lower bound, so that angles are computed where it is small only:
    after a few steps for the neighbours of the new grasp.
    """
    F = G[:, new : new + 1]
    translation = pair_translation(G, F)
    near = np.flatnonzero(translation < distance)
    moved = translation[near] + lever * pair_angle(G[:, near], F)
    distance[near] = np.minimum(distance[near], moved)


def _outermost(G: Array) -> int:
    """The grasp whose position is farthest from the middle of all positions."""
    p = G[P : P + 3]
    middle = 0.5 * (p.min(axis=1) + p.max(axis=1))
    offset = p - middle[:, None]
    return int(np.argmax(offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2))
