"""Figures of a set of grasps, and of two sets held against each other."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.comparison.matching import Share, coverage, nearest_grasps
from burg_drake.grasping.similarity import (
    DISTANCE_VERSION,
    INSTANCE,
    LEVER,
    Tolerance,
    neighbour_distances,
)

Mask = NDArray[np.bool_]

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)

POSITION = ("x", "y", "z")
"""Names of the coordinates of the grasp frame's origin among the numbers of a set."""


@dataclass(frozen=True)
class Distribution:
    """Of numbers; those that are not finite are counted and left out.

    Attributes:
        count: finite numbers.
        missing: others.
        mean: of the finite ones; NaN if there are none.
        quantiles: at `QUANTILES`, least to greatest; NaN likewise.
    """

    count: int
    missing: int
    mean: float
    quantiles: tuple[float, ...]

    @property
    def median(self) -> float:
        """The middle of the quantiles."""
        return self.quantiles[QUANTILES.index(0.5)]


@dataclass(frozen=True)
class ObjectSummary:
    """Grasps of one object, or of all.

    Attributes:
        grasps: how many.
        instances: how many instances they are on; 0 if the set does not say.
        duplicates: grasps that another one of the same object and instance equals.
        neighbour: distance of each to the nearest other one [m], see `neighbour_distances`.
        width: distance of the contacts [m].
        score: of the grasps.
    """

    grasps: int
    instances: int
    duplicates: int
    neighbour: Distribution
    width: Distribution
    score: Distribution


@dataclass(frozen=True)
class SetSummary:
    """Figures of a set of grasps.

    Attributes:
        overall: of all grasps.
        objects: by name of the object.
        numbers: of each column of numbers, and of the coordinates `x`, `y`, `z` [m].
        truths: grasps for which each column of truth values holds.
        texts: how often each value of each column of text occurs, the most frequent first.
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
    """Grasps of one object, or of all, of a reference and of another set.

    Attributes:
        coverage: share of the reference with a match in the other set.
        precision: share of the other set with a match in the reference.
        to_grasps: combined distance of each grasp of the reference to the nearest other one [m].
        to_reference: the same of each other grasp to the nearest of the reference [m].
        translation, angle: between each grasp of the reference and that nearest one [m, rad].
    """

    coverage: Share
    precision: Share
    to_grasps: Distribution
    to_reference: Distribution
    translation: Distribution
    angle: Distribution


@dataclass(frozen=True)
class SetComparison:
    """Two sets of grasps held against each other.

    Attributes:
        overall: of all grasps.
        objects: by name, of every object of either set.
        shared_ids: identifiers that both sets have.
        tolerance: what counts as a match.
        version: `DISTANCE_VERSION`.
    """

    overall: ObjectComparison
    objects: dict[str, ObjectComparison]
    shared_ids: int
    tolerance: Tolerance
    version: int = field(default=DISTANCE_VERSION)


def distribution(values: ArrayLike) -> Distribution:
    """Of (N,) numbers."""
    all_values = np.asarray(values, dtype=float)
    finite = all_values[np.isfinite(all_values)]
    missing = len(all_values) - len(finite)
    if not len(finite):
        return Distribution(0, missing, np.nan, (np.nan,) * len(QUANTILES))
    quantiles = tuple(np.quantile(finite, QUANTILES).tolist())
    return Distribution(len(finite), missing, float(finite.mean()), quantiles)


def summarize(grasps: GraspSet, *, lever: float = LEVER) -> SetSummary:
    """Figures of a set.

    Args:
        grasps: the set.
        lever: weight of the angle in distances [m/rad].

    Raises:
        InvalidInputError: the lever is negative or not finite.
    """
    neighbour = neighbour_distances(grasps, lever=lever)
    everything = np.full(len(grasps), True)
    objects = {name: grasps.object == name for name in np.unique(grasps.object).tolist()}
    numbers = {name: distribution(grasps.X_OG[:, k, 3]) for k, name in enumerate(POSITION)}
    truths, texts = {}, {}
    for name in grasps.column_names:
        values = grasps.column(name)
        if values.dtype.kind == "b":
            truths[name] = _share(values)
        elif values.dtype.kind != "U":
            numbers[name] = distribution(values)
        elif name not in ("id", "object"):
            texts[name] = _occurrences(values.tolist())
    return SetSummary(
        overall=_summarize(grasps, neighbour, everything),
        objects={name: _summarize(grasps, neighbour, of) for name, of in objects.items()},
        numbers=numbers,
        truths=truths,
        texts=texts,
    )


def compare_grasps(
    reference: GraspSet, grasps: GraspSet, tolerance: Tolerance | None = None
) -> SetComparison:
    """Holds a set of grasps against a reference.

    Args:
        reference: what is to be covered.
        grasps: the other set.
        tolerance: what counts as a match, and the lever of distances; the default one if None.
    """
    tolerance = tolerance or Tolerance()
    bounds = {name: getattr(tolerance, name) for name in ("translation", "angle", "distance")}
    lever = tolerance.lever
    covered = coverage(reference, grasps, **bounds, lever=lever).matched
    precise = coverage(grasps, reference, **bounds, lever=lever).matched
    nearest = nearest_grasps(reference, grasps, lever=lever)
    back = nearest_grasps(grasps, reference, lever=lever).distance

    def part(of: Mask, others: Mask) -> ObjectComparison:
        return ObjectComparison(
            coverage=_share(covered[of]),
            precision=_share(precise[others]),
            to_grasps=distribution(nearest.distance[of]),
            to_reference=distribution(back[others]),
            translation=distribution(nearest.translation[of]),
            angle=distribution(nearest.angle[of]),
        )

    names = np.union1d(reference.object, grasps.object).tolist()
    return SetComparison(
        overall=part(np.full(len(reference), True), np.full(len(grasps), True)),
        objects={name: part(reference.object == name, grasps.object == name) for name in names},
        shared_ids=len(np.intersect1d(reference.id, grasps.id)),
        tolerance=tolerance,
    )


def _summarize(grasps: GraspSet, neighbour: Array, of: Mask) -> ObjectSummary:
    instances = grasps.columns.get(INSTANCE)
    return ObjectSummary(
        grasps=int(of.sum()),
        instances=0 if instances is None else len(set(instances[of].tolist())),
        duplicates=int((neighbour[of] == 0.0).sum()),
        neighbour=distribution(neighbour[of]),
        width=distribution(grasps.width[of]),
        score=distribution(grasps.score[of]),
    )


def _share(values: Mask) -> Share:
    return Share(int(values.sum()), len(values))


def _occurrences(values: list[str]) -> dict[str, int]:
    """How often each value occurs, the most frequent first, then by name."""
    return dict(sorted(Counter(values).items(), key=lambda item: (-item[1], item[0])))
