"""All that a comparison says of one judge: how often it was right, where, and by what numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.experiment.comparison.disagreement import Disagreement
from burg_drake.experiment.comparison.groups import (
    FactorGroup,
    Stopped,
    by_factor,
    outcome_table,
    stopped,
)
from burg_drake.experiment.comparison.placement_error import PlacementAgreement
from burg_drake.experiment.pairing import VerdictPairs
from burg_drake.experiment.statistics import (
    Agreement,
    MarginCalibration,
    Paired,
    agreement,
    calibrations,
    grouped,
    matrix_of,
    paired,
)


@dataclass(frozen=True, eq=False)
class Strata:
    """What trials were chosen from.

    Attributes:
        index: (N,) stratum of each trial.
        population: (S,) grasps that there were to choose from.
    """

    index: NDArray[np.intp]
    population: Array

    @property
    def weight(self) -> Array:
        """(N,) grasps that each trial stands for."""
        size = np.bincount(self.index, minlength=len(self.population))
        return (self.population / np.maximum(size, 1))[self.index]

    @property
    def missing(self) -> int:
        """Grasps that no trial stands for."""
        size = np.bincount(self.index, minlength=len(self.population))
        return int(self.population[size == 0].sum())


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """What a comparison says of one judge.

    Attributes:
        selected: figures of the trials themselves.
        all_grasps: figures of all grasps that they were chosen from, each trial standing for so
            many; None if nothing says what they were chosen from.
        not_represented: grasps that could have been chosen and that no trial stands for.
        bias: predicted against actual success: whether it promises too much or too little.
        objects, scenes, stages: figures by object, by scene, and by the stage that decided.
        stopped: what became of the grasps by verdict and body in the way.
        outcomes: trials by verdict and what happened.
        calibration: what the margins tell about success.
        placement: agreement by placement error; None without real trials.
        disagreements: the wrong verdicts.
    """

    selected: Agreement
    all_grasps: Agreement | None
    not_represented: int
    bias: Paired
    objects: tuple[FactorGroup, ...]
    scenes: tuple[FactorGroup, ...]
    stages: tuple[FactorGroup, ...]
    stopped: tuple[Stopped, ...]
    outcomes: dict[str, dict[str, int]]
    calibration: tuple[MarginCalibration, ...]
    placement: PlacementAgreement | None
    disagreements: tuple[Disagreement, ...]


def judgement(
    pairs: VerdictPairs,
    *,
    scenes: Mapping[str, str],
    strata: Strata | None = None,
    placement: PlacementAgreement | None = None,
    disagreements: tuple[Disagreement, ...] = (),
    seed: int = 0,
) -> Judgement:
    """Works out all figures.

    Args:
        pairs: verdicts and what happened.
        scenes: names of the scenes by their content.
        strata: what the trials were chosen from; None if that is not known.
        placement, disagreements: what was found of them.
        seed: of the intervals' resampling.
    """
    weight, represented = None, None
    counts = matrix_of(pairs.predicted, pairs.actual)[None]
    if strata is not None:
        weight = strata.weight
        counts = grouped(pairs.predicted, pairs.actual, strata.index, len(strata.population))
        represented = agreement(counts, population=strata.population, seed=seed)
    return Judgement(
        selected=agreement(counts, seed=seed),
        all_grasps=represented,
        not_represented=0 if strata is None else strata.missing,
        bias=paired(pairs.predicted, pairs.actual, seed=seed),
        objects=by_factor(pairs, pairs.object, seed=seed),
        scenes=by_factor(pairs, pairs.scene, scenes, seed=seed),
        stages=by_factor(pairs, pairs.stage, seed=seed),
        stopped=stopped(pairs),
        outcomes=outcome_table(pairs),
        calibration=calibrations(pairs.margins, pairs.actual, weight),
        placement=placement,
        disagreements=disagreements,
    )
