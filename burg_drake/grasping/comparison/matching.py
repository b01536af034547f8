"""Comparing sets of grasps: what one has of the other, and how far apart they are.

Coverage is the share of a reference that has a grasp of the other set nearby (coverage_1 of Eppner,
Mousavian and Fox, "A Billion Ways to Grasp", ISRR 2019); precision is the share of the other set
that has a grasp of the reference nearby. Distances are those of `similarity`. Grasps of different
objects never match, nor do, where both sets have the column `instance`, grasps on different
instances.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.similarity import (
    DISTANCE_VERSION,
    LEVER,
    Tolerance,
    by_shared_target,
    check_lever,
    components,
    find_nearest,
    find_within,
    pair_angle,
    pair_translation,
)

DEFAULT = Tolerance()


@dataclass(frozen=True)
class Share:
    """How many of how many.

    Attributes:
        count: grasps with a match.
        total: grasps.
    """

    count: int
    total: int

    @property
    def value(self) -> float:
        """The share in [0, 1]; NaN of nothing."""
        return self.count / self.total if self.total else math.nan


@dataclass(frozen=True, eq=False)
class Matches:
    """Which grasps of a set have a match in another one.

    Attributes:
        matched: (N,) bool, in the order of the set.
        object: (N,) names of the objects.
        tolerance: what counted as a match.
        version: `DISTANCE_VERSION`.
    """

    matched: NDArray[np.bool_]
    object: NDArray[np.str_]
    tolerance: Tolerance
    version: int = field(default=DISTANCE_VERSION)

    @property
    def overall(self) -> Share:
        """The share of all grasps; each counts the same, whatever its object."""
        return Share(int(self.matched.sum()), len(self.matched))

    @property
    def by_object(self) -> dict[str, Share]:
        """The share of each object's grasps, by name."""
        names, inverse = np.unique(self.object, return_inverse=True)
        total = np.bincount(inverse, minlength=len(names)).tolist()
        count = np.bincount(inverse[self.matched], minlength=len(names)).tolist()
        return {str(n): Share(c, t) for n, c, t in zip(names, count, total, strict=True)}


@dataclass(frozen=True, eq=False)
class Nearest:
    """For each grasp of a set, the nearest one of another set.

    Attributes:
        index: (N,) in the other set, see `find_nearest` for ties; -1 if it has none of that object.
        distance: (N,) combined distance [m]; infinite if there is none, as are the other two.
        translation: (N,) [m].
        angle: (N,) modulo the swap of the fingers [rad].
        lever: of the combined distance [m/rad].
        version: `DISTANCE_VERSION`.
    """

    index: NDArray[np.intp]
    distance: Array
    translation: Array
    angle: Array
    lever: float
    version: int = field(default=DISTANCE_VERSION)


def coverage(
    reference: GraspSet,
    grasps: GraspSet,
    *,
    translation: float = DEFAULT.translation,
    angle: float = DEFAULT.angle,
    distance: float = DEFAULT.distance,
    lever: float = LEVER,
) -> Matches:
    """Which grasps of a reference have one of `grasps` within all bounds.

    Args:
        reference: the set to be covered.
        grasps: the set that covers it.
        translation: largest translation [m].
        angle: largest angle modulo the swap of the fingers [rad].
        distance: largest combined distance [m]; not bounded by default.
        lever: weight of the angle in it [m/rad].

    Returns:
        For each grasp of the reference.

    Raises:
        InvalidInputError: a bound is negative or NaN.
    """
    tolerance = Tolerance(translation, angle, distance, lever)
    matched = np.zeros(len(reference), dtype=bool)
    for rows, columns in by_shared_target(reference, grasps):
        G, F = components(reference.X_OG[rows]), components(grasps.X_OG[columns])
        matched[rows] = find_within(G, F, tolerance)
    return Matches(matched, reference.object, tolerance)


def precision(
    grasps: GraspSet,
    reference: GraspSet,
    *,
    translation: float = DEFAULT.translation,
    angle: float = DEFAULT.angle,
    distance: float = DEFAULT.distance,
    lever: float = LEVER,
) -> Matches:
    """Which of `grasps` have a grasp of a reference within all bounds; see `coverage`.

    Returns:
        For each of `grasps`.

    Raises:
        InvalidInputError: a bound is negative or NaN.
    """
    return coverage(
        grasps, reference, translation=translation, angle=angle, distance=distance, lever=lever
    )


def nearest_grasps(grasps: GraspSet, others: GraspSet, *, lever: float = LEVER) -> Nearest:
    """The nearest grasp of another set to each grasp, by combined distance.

    Args:
        grasps: N grasps.
        others: M grasps.
        lever: weight of the angle [m/rad].

    Raises:
        InvalidInputError: the lever is negative or not finite.
    """
    check_lever(lever)
    index = np.full(len(grasps), -1, dtype=np.intp)
    distance, translation, angle = (np.full(len(grasps), np.inf) for _ in range(3))
    for rows, columns in by_shared_target(grasps, others):
        G, F = components(grasps.X_OG[rows]), components(others.X_OG[columns])
        found, distance[rows] = find_nearest(G, F, lever=lever)
        index[rows] = columns[found]
        translation[rows] = pair_translation(G, F[:, found])
        angle[rows] = pair_angle(G, F[:, found])
    return Nearest(index, distance, translation, angle, lever)
