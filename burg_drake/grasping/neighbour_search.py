"""Nearest grasps of a set, grasps within tolerances, and diverse subsets.

Grasps become points: the position, and twice the unit quaternion in both signs and both finger
assignments, each times a weight. The Euclidean distance of two points is a lower bound of the
grasp distance, so a k-d tree yields candidates, which are then compared pair by pair. Results are
those of brute force, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, DisplayUnit, GraspSet, Indices, InvalidInputError, Units, setting
from burg_drake.grasping.grasp_distance import (
    DISTANCE_LEVER,
    POSITION_ROW,
    by_target,
    check_lever,
    grasp_components,
    pair_angle,
    pair_translation,
)

SettlePairs = Callable[[Indices, Indices, Indices, Array], NDArray[np.bool_]]
"""Evaluates candidate pairs: takes the open rows, pairs as positions among these rows and columns,
and the search radius of each row; returns which rows stay open."""


class NeighbourSearchSettings:
    """Batch sizes and error margins of the search."""

    candidates = 4  # Points seen at first; four times as many in each further round.
    max_pairs = 200_000  # Pairs in one step. Bounds the memory to some ten megabytes.
    tree_size = 50_000  # Grasps in a tree.
    angle_error = 1e-5  # Radians. Rotation matrices may be 1e-6 off orthonormal.
    rounding = 1e-12  # Relative error of a distance between points, and metres.


MILLIMETRES_PER_DEGREE = DisplayUnit(
    "mm", lambda x: 1e-3 * x / math.radians(1.0), lambda x: 1e3 * x * math.radians(1.0)
)


@dataclass(frozen=True)
class Tolerance:
    """Bounds within which two grasps match; all three have to hold.

    Attributes:
        translation: between the origins [m].
        angle: modulo the swap of the fingers [rad].
        distance: translation + lever * angle [m]. BURG-Toolkit's coverage uses 15 mm, which is
            narrower than 15 mm and 15 degrees.
        lever: weight of the angle in `distance` [m/rad].
    """

    translation: float = setting(
        0.015, "largest distance between grasp frames", unit=Units.millimetres, low=0
    )
    angle: float = setting(
        math.radians(15.0), "largest angle between grasp frames", unit=Units.degrees, low=0
    )
    distance: float = setting(
        math.inf,
        "largest combined distance, see {lever} (default: no limit)",
        unit=Units.millimetres,
        low=0,
    )
    lever: float = setting(
        DISTANCE_LEVER,
        "millimetres that one degree counts in combined distances",
        unit=MILLIMETRES_PER_DEGREE,
        name="mm_per_deg",
        low=0,
    )

    def __post_init__(self) -> None:
        check_lever(self.lever)
        for name in ("translation", "angle", "distance"):
            value = getattr(self, name)
            if not value >= 0.0:
                raise InvalidInputError(f"tolerance {name} is {value}; expected a number from 0")


def find_nearest(
    G: Array, F: Array, *, lever: float = DISTANCE_LEVER, same: bool = False
) -> tuple[Indices, Array]:
    """The nearest grasp by combined distance.

    Args:
        G: (12, N) `grasp_components` of the query grasps.
        F: (12, M) `grasp_components` of the grasps to search.
        lever: weight of the angle [m/rad].
        same: whether G and F are the same set, so that a grasp does not match itself.

    Returns:
        (N,) indices into F and (N,) distances [m]; -1 and infinity if F has no (other) grasp. Ties
        go to the first grasp, unless the distance is 0.
    """
    check_lever(lever)
    nearest = np.full(G.shape[1], -1, dtype=np.intp)
    distance = np.full(G.shape[1], np.inf)

    def settle(rows: Indices, i: Indices, column: Indices, reach: Array) -> NDArray[np.bool_]:
        g, f = G[:, rows[i]], F[:, column]
        d = pair_translation(g, f) + lever * pair_angle(g, f)
        if same:
            d[column == rows[i]] = np.inf
        first = np.flatnonzero(np.diff(i, prepend=-1))  # pairs come row by row
        best = np.minimum.reduceat(d, first)
        tied = d == np.repeat(best, np.diff(first, append=len(d)))
        column = np.minimum.reduceat(np.where(tied, column, F.shape[1]), first)
        row, d = rows[i[first]], best
        better = (d < distance[row]) | ((d == distance[row]) & (column < nearest[row]))
        distance[row[better]], nearest[row[better]] = d[better], column[better]
        rounding = NeighbourSearchSettings.rounding
        least = reach * (1.0 - rounding) - lever * NeighbourSearchSettings.angle_error - rounding
        return (least <= distance[rows]) & (distance[rows] > 0.0)

    for tree in _build_trees(F, 1.0, lever):
        _search(tree, G, np.arange(G.shape[1]), math.inf, settle)
    return nearest, distance


def find_within(G: Array, F: Array, tolerance: Tolerance) -> NDArray[np.bool_]:
    """Whether any grasp of a set is within tolerance.

    Args:
        G: (12, N) `grasp_components` of the query grasps.
        F: (12, M) `grasp_components` of the grasps to search.
        tolerance: bounds of a match.

    Returns:
        (N,) True where a grasp of F is within the tolerance.
    """
    found = np.zeros(G.shape[1], dtype=bool)

    def settle(rows: Indices, i: Indices, column: Indices, reach: Array) -> NDArray[np.bool_]:
        g, f = G[:, rows[i]], F[:, column]
        translation, angle = pair_translation(g, f), pair_angle(g, f)
        near = (translation <= tolerance.translation) & (angle <= tolerance.angle)
        near &= translation + tolerance.lever * angle <= tolerance.distance
        found[rows[i[near]]] = True
        return ~found[rows]

    per_metre, per_radian, radius = _match_radius(tolerance)
    for tree in _build_trees(F, per_metre, per_radian):
        _search(tree, G, np.flatnonzero(~found), radius, settle)
    return found


def _match_radius(tolerance: Tolerance) -> tuple[float, float, float]:
    """Scales of translation and angle, and the radius of a ball that contains all matches.

    Scaled by the tolerances, translation and angle are at most 1 each, and their hypotenuse at most
    the root of 2. If only the combined distance matters, their sum is at most 1.
    """
    lever, distance = tolerance.lever, tolerance.distance
    angle = min(tolerance.angle, math.pi)
    sum_decides = distance <= min(tolerance.translation, lever * angle)
    if distance < lever * angle:
        angle = distance / lever
    per_metre = 1.0 / max(min(tolerance.translation, distance), 1e-9)
    per_radian = 1.0 / max(angle, 1e-6)
    slack = per_metre * NeighbourSearchSettings.rounding
    slack += per_radian * NeighbourSearchSettings.angle_error
    return per_metre, per_radian, (1.0 if sum_decides else math.sqrt(2.0)) + slack


@dataclass(frozen=True, eq=False)
class _GraspTree:
    """Grasps as points, with both signs of the quaternion and both finger assignments.

    Attributes:
        points: k-d tree of (4 M, 7) points.
        start: index of its first grasp in the set.
        count: number M of grasps.
        per_metre, per_radian: scales of the points.
    """

    points: cKDTree
    start: int
    count: int
    per_metre: float
    per_radian: float


def _build_trees(F: Array, per_metre: float, per_radian: float) -> Iterator[_GraspTree]:
    size = NeighbourSearchSettings.tree_size
    for start in range(0, F.shape[1], size):
        points = _grasp_points(F[:, start : start + size], per_metre, per_radian)
        x, y, z, w = points[:, 3:].T
        swapped = np.hstack([points[:, :3], np.stack([y, -x, w, -z], axis=1)])  # times (0, 0, 1, 0)
        forms = np.vstack([points, swapped])
        negative = np.hstack([forms[:, :3], -forms[:, 3:]])
        tree = cKDTree(np.vstack([forms, negative]))
        yield _GraspTree(tree, start, len(points), per_metre, per_radian)


def _grasp_points(G: Array, per_metre: float, per_radian: float) -> Array:
    """(12, N) components -> (N, 7) points.

    Quaternions of rotations that differ by an angle are 2 sin(angle / 4) apart; twice that is at
    most the angle.
    """
    R = np.transpose(G[:POSITION_ROW].reshape(3, 3, -1), (2, 1, 0))
    q = Rotation.from_matrix(R).as_quat()
    return np.hstack([per_metre * G[POSITION_ROW:].T, 2.0 * per_radian * q])


def _search(tree: _GraspTree, G: Array, rows: Indices, radius: float, settle: SettlePairs) -> None:
    """Passes the nearest points within a radius to `settle`, and more for rows that stay open."""
    count = min(NeighbourSearchSettings.candidates, tree.points.n)
    while len(rows):
        size = max(1, NeighbourSearchSettings.max_pairs // count)
        parts = [rows[k : k + size] for k in range(0, len(rows), size)]
        found = [_search_round(tree, G, part, radius, count, settle) for part in parts]
        rows = np.concatenate(found)
        if count == tree.points.n:
            return
        count = min(4 * count, tree.points.n)


def _search_round(
    tree: _GraspTree, G: Array, rows: Indices, radius: float, count: int, settle: SettlePairs
) -> Indices:
    """Passes the `count` nearest points of each row to `settle`; returns the rows still open."""
    points = _grasp_points(G[:, rows], tree.per_metre, tree.per_radian)
    reach, column = tree.points.query(points, k=range(1, count + 1), distance_upper_bound=radius)
    i, k = np.nonzero(np.isfinite(reach))
    stays = settle(rows, i, tree.start + column[i, k] % tree.count, reach[:, -1])
    kept: Indices = rows[stays & np.isfinite(reach[:, -1])]
    return kept


def farthest_points(
    X_OG: ArrayLike, n: int, *, lever: float = DISTANCE_LEVER, first: int | None = None
) -> NDArray[np.intp]:
    """Indices of n diverse grasps: each is the grasp farthest from all selected before.

    Greedy farthest-point selection (T. F. Gonzalez, Theoretical Computer Science 38, 1985) under
    the combined distance. At every length the selection covers the set with a radius of at most
    twice the smallest possible for that many grasps. It depends on the physical grasps alone, not
    on the finger assignment; ties go to the first grasp, and duplicates come last, in order.

    Args:
        X_OG: (N, 4, 4) grasp poses in one frame.
        n: number of grasps to select, at most N.
        lever: weight of the angle in the distance [m/rad].
        first: index of the first grasp; by default the one whose position is farthest from the
            middle of the box around all positions.

    Returns:
        (n,) indices in the order of selection.

    Raises:
        InvalidInputError: n or first is out of range, or the lever is negative or not finite.
    """
    check_lever(lever)
    G = grasp_components(X_OG)
    total = G.shape[1]
    if not 0 <= n <= total:
        raise InvalidInputError(f"cannot select {n} of {total} grasps; give 0 to {total}")
    if n == 0:
        return np.empty(0, dtype=np.intp)
    if first is not None and not 0 <= first < total:
        raise InvalidInputError(f"first is {first}; expected an index from 0 to {total - 1}")
    selected = np.empty(n, dtype=np.intp)
    distance = np.full(total, np.inf)
    new = _outermost_grasp(G) if first is None else first
    for k in range(n):
        selected[k] = new
        _lower_distances(distance, G, new, lever)
        distance[new] = -np.inf  # never selected again, not even among duplicates
        new = int(np.argmax(distance))
    return selected


def neighbour_distances(grasps: GraspSet, *, lever: float = DISTANCE_LEVER) -> Array:
    """Distance of each grasp to the nearest other grasp of its object and instance.

    Repetitive sets have small distances; the mean measures diversity, but compares only between
    sets of equal size.

    Args:
        grasps: N grasps.
        lever: weight of the angle in the distance [m/rad].

    Returns:
        (N,) combined distances [m]; infinity for the only grasp of an object.
    """
    distance = np.full(len(grasps), np.inf)
    for rows in by_target(grasps):
        G = grasp_components(grasps.X_OG[rows])
        _, distance[rows] = find_nearest(G, G, lever=lever, same=True)
    return distance


def _lower_distances(distance: Array, G: Array, new: int, lever: float) -> None:
    """Updates the distances (N,) to the selection after grasp `new` joins it.

    The translation is a lower bound, so that angles are only computed where it is small: after a
    few steps, for the neighbours of the new grasp.
    """
    F = G[:, new : new + 1]
    translation = pair_translation(G, F)
    near = np.flatnonzero(translation < distance)
    moved = translation[near] + lever * pair_angle(G[:, near], F)
    distance[near] = np.minimum(distance[near], moved)


def _outermost_grasp(G: Array) -> int:
    """The grasp whose position is farthest from the middle of all positions."""
    p = G[POSITION_ROW : POSITION_ROW + 3]
    middle = 0.5 * (p.min(axis=1) + p.max(axis=1))
    offset = p - middle[:, None]
    return int(np.argmax(offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2))
