"""Statistics of a set of grasps, and comparison of two sets: coverage, precision, nearest grasps.

Coverage is the share of a reference that has a grasp of the other set nearby (coverage_1 of
Eppner, Mousavian and Fox, "A Billion Ways to Grasp", ISRR 2019). Precision is the share of the
other set that has a grasp of the reference nearby. Only grasps of the same object match, and of
the same instance if both sets have the column `instance`.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, GraspSet
from burg_drake.grasping.grasp_distance import (
    DISTANCE_LEVER,
    DISTANCE_VERSION,
    INSTANCE_COLUMN,
    by_shared_target,
    check_lever,
    grasp_components,
    pair_angle,
    pair_translation,
)
from burg_drake.grasping.neighbour_search import (
    Tolerance,
    find_nearest,
    find_within,
    neighbour_distances,
)

DEFAULT_TOLERANCE = Tolerance()  # Tolerances of `coverage` and `precision`.


@dataclass(frozen=True)
class Share:
    """A count and its share of a total.

    Attributes:
        count: number of grasps with a match.
        total: number of grasps.
    """

    count: int
    total: int

    @property
    def value(self) -> float:
        """The share in [0, 1]; NaN if the total is 0."""
        return self.count / self.total if self.total else math.nan


@dataclass(frozen=True, eq=False)
class Matches:
    """Whether grasps of a set have a match in another set.

    Attributes:
        matched: (N,) bool, in the order of the set.
        object: (N,) names of the objects.
        tolerance: bounds of a match.
        version: `DISTANCE_VERSION`.
    """

    matched: NDArray[np.bool_]
    object: NDArray[np.str_]
    tolerance: Tolerance
    version: int = field(default=DISTANCE_VERSION)

    @property
    def overall(self) -> Share:
        """The share of all grasps, with the same weight for each grasp."""
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
    """For each grasp of a set, the nearest grasp of another set.

    Attributes:
        index: (N,) indices in the other set, see `find_nearest` for ties; -1 if it has no grasp of
            that object. Distance, translation and angle are infinite then.
        distance: (N,) combined distance [m].
        translation: (N,) [m].
        angle: (N,) modulo the swap of the fingers [rad].
        lever: lever of rotations in the combined distance [m/rad].
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
    translation: float = DEFAULT_TOLERANCE.translation,
    angle: float = DEFAULT_TOLERANCE.angle,
    distance: float = DEFAULT_TOLERANCE.distance,
    lever: float = DISTANCE_LEVER,
) -> Matches:
    """Matches of the grasps of a reference among `grasps`.

    Args:
        reference: the set to be covered.
        grasps: the set that covers it.
        translation: largest translation [m].
        angle: largest angle modulo the swap of the fingers [rad].
        distance: largest combined distance [m]; not bounded by default.
        lever: weight of the angle in it [m/rad].

    Returns:
        Whether each grasp of the reference has a match.

    Raises:
        InvalidInputError: a bound is negative or NaN.
    """
    return _matches(reference, grasps, Tolerance(translation, angle, distance, lever))


def _matches(reference: GraspSet, grasps: GraspSet, tolerance: Tolerance) -> Matches:
    """Matches of the grasps of a reference among `grasps`, within a tolerance."""
    matched = np.zeros(len(reference), dtype=bool)
    for rows, columns in by_shared_target(reference, grasps):
        G, F = grasp_components(reference.X_OG[rows]), grasp_components(grasps.X_OG[columns])
        matched[rows] = find_within(G, F, tolerance)
    return Matches(matched, reference.object, tolerance)


def precision(
    grasps: GraspSet,
    reference: GraspSet,
    *,
    translation: float = DEFAULT_TOLERANCE.translation,
    angle: float = DEFAULT_TOLERANCE.angle,
    distance: float = DEFAULT_TOLERANCE.distance,
    lever: float = DISTANCE_LEVER,
) -> Matches:
    """Matches of `grasps` among the grasps of a reference; see `coverage`.

    Returns:
        Whether each of `grasps` has a match.

    Raises:
        InvalidInputError: a bound is negative or NaN.
    """
    return _matches(grasps, reference, Tolerance(translation, angle, distance, lever))


def nearest_grasps(grasps: GraspSet, others: GraspSet, *, lever: float = DISTANCE_LEVER) -> Nearest:
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
        G, F = grasp_components(grasps.X_OG[rows]), grasp_components(others.X_OG[columns])
        found, distance[rows] = find_nearest(G, F, lever=lever)
        index[rows] = columns[found]
        translation[rows] = pair_translation(G, F[:, found])
        angle[rows] = pair_angle(G, F[:, found])
    return Nearest(index, distance, translation, angle, lever)


Mask = NDArray[np.bool_]

DISTRIBUTION_QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)  # Quantiles of a `Distribution`.


@dataclass(frozen=True)
class Distribution:
    """Statistics of the finite values among numbers.

    Attributes:
        count: number of finite values.
        missing: number of other values.
        mean: mean of the finite values; NaN if there are none.
        quantiles: values at `DISTRIBUTION_QUANTILES`, rising; NaN if there are none.
    """

    count: int
    missing: int
    mean: float
    quantiles: tuple[float, ...]

    @property
    def median(self) -> float:
        """The median; NaN if there are no finite values."""
        return self.quantiles[DISTRIBUTION_QUANTILES.index(0.5)]


@dataclass(frozen=True)
class ObjectSummary:
    """Statistics of the grasps of one object, or of all.

    Attributes:
        grasps: number of grasps.
        instances: number of instances with grasps; 0 if the set has no such column.
        duplicates: number of grasps that equal another grasp of the same object and instance.
        neighbour: distances to the nearest other grasp [m], see `neighbour_distances`.
        width: distance of the contacts [m].
        score: scores of the grasps.
    """

    grasps: int
    instances: int
    duplicates: int
    neighbour: Distribution
    width: Distribution
    score: Distribution


@dataclass(frozen=True)
class SetSummary:
    """Statistics of a set of grasps.

    Attributes:
        overall: statistics of all grasps.
        objects: statistics of the grasps of each object, by its name.
        numbers: distribution of each column of numbers, and of the coordinates `x`, `y`, `z` [m].
        truths: share of true values of each column of truth values.
        texts: count of each value of each text column, the most frequent first.
        version: `DISTANCE_VERSION`.
    """

    overall: ObjectSummary
    objects: dict[str, ObjectSummary]
    numbers: dict[str, Distribution]
    truths: dict[str, Share]
    texts: dict[str, dict[str, int]]
    version: int = field(default=DISTANCE_VERSION)


@dataclass(frozen=True)
class ObjectComparison:
    """Comparison of a reference and another set for one object, or for all.

    Attributes:
        coverage: share of the reference with a match in the other set.
        precision: share of the other set with a match in the reference.
        to_grasps: combined distances from the reference to the nearest grasps of the other set [m].
        to_reference: combined distances from the other set to the nearest reference grasps [m].
        translation, angle: parts of `to_grasps` [m, rad].
    """

    coverage: Share
    precision: Share
    to_grasps: Distribution
    to_reference: Distribution
    translation: Distribution
    angle: Distribution


@dataclass(frozen=True)
class SetComparison:
    """Comparison of two sets of grasps.

    Attributes:
        overall: comparison of all grasps.
        objects: comparison for every object of either set, by its name.
        shared_ids: number of identifiers in both sets.
        tolerance: bounds of a match.
        version: `DISTANCE_VERSION`.
    """

    overall: ObjectComparison
    objects: dict[str, ObjectComparison]
    shared_ids: int
    tolerance: Tolerance
    version: int = field(default=DISTANCE_VERSION)


def distribution(values: ArrayLike) -> Distribution:
    """Computes the statistics of (N,) numbers."""
    all_values = np.asarray(values, dtype=float)
    finite = all_values[np.isfinite(all_values)]
    missing = len(all_values) - len(finite)
    if not len(finite):
        return Distribution(0, missing, np.nan, (np.nan,) * len(DISTRIBUTION_QUANTILES))
    quantiles = tuple(np.quantile(finite, DISTRIBUTION_QUANTILES).tolist())
    return Distribution(len(finite), missing, float(finite.mean()), quantiles)


def summarize(grasps: GraspSet, *, lever: float = DISTANCE_LEVER) -> SetSummary:
    """Computes the statistics of a set.

    Args:
        grasps: the set.
        lever: weight of the angle in distances [m/rad].

    Raises:
        InvalidInputError: the lever is negative or not finite.
    """
    neighbour = neighbour_distances(grasps, lever=lever)
    everything = np.full(len(grasps), True)
    objects = {name: grasps.object == name for name in np.unique(grasps.object).tolist()}
    numbers = {name: distribution(grasps.X_OG[:, k, 3]) for k, name in enumerate(("x", "y", "z"))}
    truths, texts = {}, {}
    for name in grasps.column_names:
        values = grasps.column(name)
        if values.dtype.kind == "b":
            truths[name] = _finite_share(values)
        elif values.dtype.kind != "U":
            numbers[name] = distribution(values)
        elif name not in ("id", "object"):
            texts[name] = _count_values(values.tolist())
    return SetSummary(
        overall=_summarize_object(grasps, neighbour, everything),
        objects={n: _summarize_object(grasps, neighbour, rows) for n, rows in objects.items()},
        numbers=numbers,
        truths=truths,
        texts=texts,
    )


def compare_grasps(
    reference: GraspSet, grasps: GraspSet, tolerance: Tolerance | None = None
) -> SetComparison:
    """Compares a set of grasps with a reference.

    Args:
        reference: the set to be covered.
        grasps: the other set.
        tolerance: bounds of a match, and the lever of distances; the defaults if None.
    """
    tolerance = tolerance or Tolerance()
    covered = _matches(reference, grasps, tolerance).matched
    precise = _matches(grasps, reference, tolerance).matched
    nearest = nearest_grasps(reference, grasps, lever=tolerance.lever)
    back = nearest_grasps(grasps, reference, lever=tolerance.lever).distance

    def part(rows: Mask, other_rows: Mask) -> ObjectComparison:
        return ObjectComparison(
            coverage=_finite_share(covered[rows]),
            precision=_finite_share(precise[other_rows]),
            to_grasps=distribution(nearest.distance[rows]),
            to_reference=distribution(back[other_rows]),
            translation=distribution(nearest.translation[rows]),
            angle=distribution(nearest.angle[rows]),
        )

    names = np.union1d(reference.object, grasps.object).tolist()
    return SetComparison(
        overall=part(np.full(len(reference), True), np.full(len(grasps), True)),
        objects={name: part(reference.object == name, grasps.object == name) for name in names},
        shared_ids=len(np.intersect1d(reference.id, grasps.id)),
        tolerance=tolerance,
    )


def _summarize_object(grasps: GraspSet, neighbour: Array, rows: Mask) -> ObjectSummary:
    instances = grasps.columns.get(INSTANCE_COLUMN)
    return ObjectSummary(
        grasps=int(rows.sum()),
        instances=0 if instances is None else len(set(instances[rows].tolist())),
        duplicates=int((neighbour[rows] == 0.0).sum()),
        neighbour=distribution(neighbour[rows]),
        width=distribution(grasps.width[rows]),
        score=distribution(grasps.score[rows]),
    )


def _finite_share(values: Mask) -> Share:
    return Share(int(values.sum()), len(values))


def _count_values(values: list[str]) -> dict[str, int]:
    """Counts of the values, the most frequent first, then by name."""
    return dict(sorted(Counter(values).items(), key=lambda item: (-item[1], item[0])))
