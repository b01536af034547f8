"""Agreement where the objects stood where they should, and over how far off they were."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.experiment.pairing import VerdictPairs
from burg_drake.experiment.statistics import (
    Agreement,
    MarginCalibration,
    agreements,
    calibration,
    grouped,
)
from burg_drake.experiment.trials import RealTrial

LIMIT_MM = 2.0


@dataclass(frozen=True, kw_only=True)
class PlacementAgreement:
    """Agreement by how far the objects were from their targets before a trial.

    Attributes:
        limit_mm: how far off every object may be to stand where it should [mm].
        within: trials in which every object did.
        beyond: trials in which one was measured farther off.
        unmeasured: trials in which one of the scene was not measured, and none farther off.
        largest: share of right verdicts over the largest offset of any object [mm].
        target: the same over the offset of the target [mm].
    """

    limit_mm: float
    within: Agreement
    beyond: Agreement
    unmeasured: Agreement
    largest: MarginCalibration
    target: MarginCalibration


def placement_agreement(
    pairs: VerdictPairs,
    largest: Array,
    target: Array,
    *,
    limit_mm: float = LIMIT_MM,
    seed: int = 0,
) -> PlacementAgreement:
    """Compares trials by their placement.

    Args:
        pairs: N trials.
        largest: (N,) largest offset of any object [mm]; NaN where one is not measured, and none is
            known to be beyond the limit.
        target: (N,) offset of the target [mm]; NaN where it is not measured.
        limit_mm: how far off every object may be [mm].
        seed: of the intervals' resampling.
    """
    group = np.where(np.isnan(largest), 2, (largest > limit_mm).astype(int))
    counts = grouped(pairs.predicted, pairs.actual, group, 3)
    within, beyond, unmeasured = agreements(counts, seed=seed)
    right = pairs.predicted == pairs.actual

    def over(name: str, values: Array) -> MarginCalibration:
        return calibration(name, values, right, smaller_is_better=True)

    return PlacementAgreement(
        limit_mm=limit_mm,
        within=within,
        beyond=beyond,
        unmeasured=unmeasured,
        largest=over("largest_offset_mm", largest),
        target=over("target_offset_mm", target),
    )


def offsets(
    trials: Sequence[RealTrial],
    instances: Sequence[Collection[str]],
    limit_mm: float = LIMIT_MM,
) -> tuple[Array, Array]:
    """Offsets of the objects before trials [mm].

    Args:
        trials: N trials.
        instances: the free instances of the scene of each.
        limit_mm: see `placement_agreement`.

    Returns:
        (N,) the largest of any object, and (N,) that of the target; NaN where unknown.
    """
    pairs = zip(trials, instances, strict=True)
    largest = np.array([_largest(trial, there, limit_mm) for trial, there in pairs], dtype=float)
    target = np.array([_measured(trial).get(trial.instance, math.nan) for trial in trials])
    return largest, target.astype(float)


def _largest(trial: RealTrial, instances: Collection[str], limit_mm: float) -> float:
    """Largest offset; NaN if an object was not measured, unless another one is beyond the limit."""
    measured = _measured(trial)
    most = max(measured.values(), default=math.nan)
    return most if set(instances) <= set(measured) or most > limit_mm else math.nan


def _measured(trial: RealTrial) -> dict[str, float]:
    """Offsets of the objects that were measured."""
    return {
        name: math.hypot(*place.offset_mm)
        for name, place in trial.placement.items()
        if place.status == "measured" and place.offset_mm is not None
    }
