"""All that a comparison says of one judge: how often it was right, where, and by what numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import RealOutcome
from burg_drake.experiment.comparison.disagreement import Disagreement
from burg_drake.experiment.comparison.groups import (
    FactorGroup,
    Stopped,
    by_factor,
    outcome_table,
    stopped,
)
from burg_drake.experiment.comparison.placement_error import PlacementAgreement
from burg_drake.experiment.comparison.standing_out import OutlierGroup, standing_out
from burg_drake.experiment.pairing import VerdictPairs
from burg_drake.experiment.statistics import (
    Agreement,
    Flags,
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

    def keep(self, rows: Flags) -> Strata:
        """Without some trials, the others standing for as many grasps as before."""
        every = np.bincount(self.index, minlength=len(self.population))
        kept = np.bincount(self.index[rows], minlength=len(self.population))
        return Strata(self.index[rows], self.population * kept / np.maximum(every, 1))

    def agreement(self, first: Flags, second: Flags, *, seed: int = 0) -> Agreement:
        """Figures of all grasps, from two answers, (N,), about each trial."""
        counts = grouped(first, second, self.index, len(self.population))
        return agreement(counts, population=self.population, seed=seed)

    @property
    def missing(self) -> int:
        """Grasps that no trial stands for."""
        size = np.bincount(self.index, minlength=len(self.population))
        return int(self.population[size == 0].sum())


@dataclass(frozen=True, kw_only=True)
class Unpredictable:
    """Failures that a run of the hand alone does not predict, and figures without them.

    Attributes:
        outcomes: these trials by how they ended, the most frequent first.
        predicted_successes: number of these trials that were predicted to succeed.
        selected, all_grasps: figures of the other trials, and of the grasps that they stand for;
            see `Judgement`.
    """

    outcomes: dict[str, int]
    predicted_successes: int
    selected: Agreement
    all_grasps: Agreement | None


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """What a comparison says of one judge.

    Attributes:
        selected: figures of the trials themselves.
        all_grasps: figures of all grasps that they were chosen from, each trial standing for so
            many; None if nothing says what they were chosen from.
        not_represented: grasps that could have been chosen and that no trial stands for.
        unpredictable: failures that a run of the hand alone does not predict; all other figures
            count them as failures. None if there are none, and in other modes.
        bias: predicted against actual success of the trials themselves; `all_grasps.excess` says
            whether it promises too much or too little where trials stand for others.
        standing_out: objects and causes whose verdicts are wrong more often than those of others,
            without what is unpredictable. Of real trials alone.
        tested_groups: number of groups tested for that.
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
    unpredictable: Unpredictable | None
    bias: Paired
    standing_out: tuple[OutlierGroup, ...]
    tested_groups: int
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
    unpredictable: Collection[RealOutcome] = (),
    real: bool = False,
    seed: int = 0,
) -> Judgement:
    """Works out all figures.

    Args:
        pairs: verdicts and what happened.
        scenes: names of the scenes by their content.
        strata: what the trials were chosen from; None if that is not known.
        placement, disagreements: what was found of them.
        unpredictable: outcomes that no verdict can predict.
        real: whether what happened are trials on the robot.
        seed: of the intervals' resampling.
    """
    weight = None if strata is None else strata.weight
    selected, represented = _agreements(pairs, strata, seed)
    names = {outcome.value for outcome in unpredictable}
    apart = pairs.ended.where([name in names for name in pairs.ended.names])
    found, tested_groups = standing_out(pairs.take(~apart)) if real else ((), 0)
    return Judgement(
        selected=selected,
        all_grasps=represented,
        not_represented=0 if strata is None else strata.missing,
        unpredictable=_without(pairs, strata, apart, seed) if apart.any() else None,
        standing_out=found,
        tested_groups=tested_groups,
        bias=replace(paired(pairs.predicted, pairs.actual, seed=seed), difference=selected.excess),
        objects=by_factor(pairs, pairs.object, seed=seed),
        scenes=by_factor(pairs, pairs.scene, scenes, seed=seed),
        stages=by_factor(pairs, pairs.stage, seed=seed),
        stopped=stopped(pairs),
        outcomes=outcome_table(pairs),
        calibration=calibrations(pairs.margins, pairs.actual, weight),
        placement=placement,
        disagreements=disagreements,
    )


def _agreements(
    pairs: VerdictPairs, strata: Strata | None, seed: int
) -> tuple[Agreement, Agreement | None]:
    """Figures of the trials, and of all grasps that they stand for."""
    if strata is None:
        return agreement(matrix_of(pairs.predicted, pairs.actual)[None], seed=seed), None
    counts = grouped(pairs.predicted, pairs.actual, strata.index, len(strata.population))
    represented = strata.agreement(pairs.predicted, pairs.actual, seed=seed)
    return agreement(counts, seed=seed), represented


def _without(pairs: VerdictPairs, strata: Strata | None, apart: Flags, seed: int) -> Unpredictable:
    """What some trials are, and the figures without them."""
    kept = None if strata is None else strata.keep(~apart)
    selected, represented = _agreements(pairs.take(~apart), kept, seed)
    ended = Counter(pairs.ended.names[k] for k in pairs.ended.index[apart].tolist())
    return Unpredictable(
        outcomes=dict(ended.most_common()),
        predicted_successes=int(pairs.predicted[apart].sum()),
        selected=selected,
        all_grasps=represented,
    )
