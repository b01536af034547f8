"""Assessment of one judge: its error rates, wrong verdicts, and the effect of object placement."""

from __future__ import annotations

import math
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, RealOutcome
from burg_drake.experiment.comparison.confusion_matrix import (
    Agreement,
    Flags,
    Paired,
    compare_paired,
    count_cells,
    count_cells_by_group,
    estimate_agreement,
    estimate_agreements,
)
from burg_drake.experiment.comparison.group_agreement import (
    FactorGroup,
    OutlierGroup,
    Stopped,
    agreement_by_factor,
    cross_tabulate,
    find_outlier_groups,
    outcomes_by_verdict,
)
from burg_drake.experiment.comparison.margin_calibration import (
    MarginCalibration,
    calibrate_margin,
    calibrate_margins,
)
from burg_drake.experiment.comparison.verdict_pairs import VerdictPairs
from burg_drake.experiment.trials.trial_sheet import RealTrial


@dataclass(frozen=True, kw_only=True)
class Disagreement:
    """A grasp with a wrong verdict.

    Attributes:
        kind: `fp` if success was predicted, `fn` if failure was.
        scene, object, grasp: names of scene and object, and id of the grasp.
        simulated, stage, blocker: the verdict.
        ended: actual outcome.
        replays: commands that show the trials in simulation.
        trial: number of the real trial; None if there is none.
        note, photo: note and photo of the real trial; the photo as the trials file names it.
        offset_mm: largest offset of any object [mm]; None where unknown.
    """

    kind: Literal["fp", "fn"]
    scene: str
    object: str
    grasp: str
    simulated: str
    stage: str
    blocker: str
    ended: str
    replays: tuple[str, ...]
    trial: int | None = None
    note: str = ""
    photo: str = ""
    offset_mm: float | None = None


def list_wrong_verdicts(
    pairs: VerdictPairs,
    scenes: Mapping[str, str],
    folders: Sequence[Mapping[str, str]],
    trials: Sequence[RealTrial] = (),
    offset_mm: Array | None = None,
) -> tuple[Disagreement, ...]:
    """Lists grasps with wrong verdicts, false successes first.

    Args:
        pairs: N grasps.
        scenes: names of the scenes by their content.
        folders: folders of the runs by content hash of the scene; one mapping for each side to
            be replayed.
        trials: (N,) the real trials, if the outcomes are real.
        offset_mm: (N,) largest offset of any object before each trial [mm]; NaN where unknown.
    """
    max_cases = 200  # Maximum number of each kind; the confusion matrix counts all.
    found = []
    for kind, wrong in (
        ("fp", pairs.predicted & ~pairs.actual),
        ("fn", ~pairs.predicted & pairs.actual),
    ):
        for row in np.flatnonzero(wrong)[:max_cases].tolist():
            scene, grasp = pairs.scene[row], pairs.id[row]
            trial = trials[row] if trials else None
            offset = np.nan if offset_mm is None else float(offset_mm[row])
            found.append(
                Disagreement(
                    kind="fp" if kind == "fp" else "fn",
                    scene=scenes.get(scene, scene),
                    object=pairs.object[row],
                    grasp=grasp,
                    simulated=pairs.simulated[row],
                    stage=pairs.stage[row],
                    blocker=pairs.blocker[row],
                    ended=pairs.ended[row],
                    replays=replay_commands(folders, scene, grasp),
                    trial=None if trial is None else trial.number,
                    note="" if trial is None else trial.note,
                    photo="" if trial is None else trial.photo,
                    offset_mm=None if np.isnan(offset) else offset,
                )
            )
    return tuple(found)


def replay_commands(
    folders: Sequence[Mapping[str, str]], scene: str, grasp: str
) -> tuple[str, ...]:
    """Commands that show a grasp in each run that has its scene.

    Args:
        folders: folders of the runs by content hash of the scene; one mapping for each side.
        scene: content hash of the scene.
        grasp: id of the grasp.
    """
    return tuple(
        shlex.join(["burg-drake", "replay", known[scene], "--grasp", grasp])
        for known in folders
        if scene in known
    )


PLACEMENT_LIMIT_MM = 2.0  # Placement error up to which an object stands where it should, in mm.


@dataclass(frozen=True, kw_only=True)
class PlacementAgreement:
    """Agreement by placement error of the objects before a trial.

    Attributes:
        limit_mm: placement error up to which an object stands where it should [mm].
        within: trials with all errors within the limit.
        beyond: trials with an error beyond the limit.
        unmeasured: other trials in which an object was not measured.
        largest: share of right verdicts by the largest offset of any object [mm].
        target: share of right verdicts by the offset of the target [mm].
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
    limit_mm: float = PLACEMENT_LIMIT_MM,
    seed: int = 0,
) -> PlacementAgreement:
    """Compares trials by placement error.

    Args:
        pairs: N trials.
        largest: (N,) largest offset of any object [mm]; NaN if an object was not measured and no
            other is beyond the limit.
        target: (N,) offset of the target [mm]; NaN if it was not measured.
        limit_mm: see `PlacementAgreement`.
        seed: seed of the intervals' resampling.
    """
    group = np.where(np.isnan(largest), 2, (largest > limit_mm).astype(int))
    counts = count_cells_by_group(pairs.predicted, pairs.actual, group, 3)
    within, beyond, unmeasured = estimate_agreements(counts, seed=seed)
    right = pairs.predicted == pairs.actual

    def calibrate(name: str, offsets: Array) -> MarginCalibration:
        return calibrate_margin(name, offsets, right, smaller_is_better=True)

    return PlacementAgreement(
        limit_mm=limit_mm,
        within=within,
        beyond=beyond,
        unmeasured=unmeasured,
        largest=calibrate("largest_offset_mm", largest),
        target=calibrate("target_offset_mm", target),
    )


def placement_errors_mm(
    trials: Sequence[RealTrial],
    instances: Sequence[Collection[str]],
    limit_mm: float = PLACEMENT_LIMIT_MM,
) -> tuple[Array, Array]:
    """Offsets of the objects before trials [mm].

    Args:
        trials: N trials.
        instances: free instances of the scene of each trial.
        limit_mm: see `placement_agreement`.

    Returns:
        (N,) the largest offset of any object, and (N,) the offset of the target; NaN where unknown.
    """
    pairs = zip(trials, instances, strict=True)
    largest = np.array(
        [_largest_error(trial, names, limit_mm) for trial, names in pairs], dtype=float
    )
    target = np.array([_measured_errors(trial).get(trial.instance, math.nan) for trial in trials])
    return largest, target.astype(float)


def _largest_error(trial: RealTrial, instances: Collection[str], limit_mm: float) -> float:
    """Largest offset [mm]; NaN if an object was not measured, unless another one is beyond the
    limit.
    """
    measured = _measured_errors(trial)
    largest = max(measured.values(), default=math.nan)
    return largest if set(instances) <= set(measured) or largest > limit_mm else math.nan


def _measured_errors(trial: RealTrial) -> dict[str, float]:
    """Offsets of the objects that were measured."""
    return {
        name: math.hypot(*place.offset_mm)
        for name, place in trial.placement.items()
        if place.status == "measured" and place.offset_mm is not None
    }


@dataclass(frozen=True, eq=False)
class Strata:
    """Strata from which trials were chosen.

    Attributes:
        index: (N,) stratum of each trial.
        population: (S,) number of grasps in each stratum.
    """

    index: NDArray[np.intp]
    population: Array

    @property
    def trials(self) -> NDArray[np.intp]:
        """(S,) number of trials in each stratum."""
        return np.bincount(self.index, minlength=len(self.population))

    @property
    def weight(self) -> Array:
        """(N,) number of grasps that each trial represents."""
        return (self.population / np.maximum(self.trials, 1))[self.index]

    def select_trials(self, rows: Flags) -> Strata:
        """The strata of selected trials, which keep their weights."""
        selected = Strata(self.index[rows], self.population)
        population = self.population * selected.trials / np.maximum(self.trials, 1)
        return Strata(selected.index, population)

    def agreement(self, first: Flags, second: Flags, *, seed: int = 0) -> Agreement:
        """Figures of all grasps from two answers (N,) about each trial."""
        counts = count_cells_by_group(first, second, self.index, len(self.population))
        return estimate_agreement(counts, population=self.population, seed=seed)

    @property
    def not_represented(self) -> int:
        """Number of grasps that no trial represents."""
        return int(self.population[self.trials == 0].sum())


@dataclass(frozen=True, kw_only=True)
class Unpredictable:
    """Failures that a run of the hand alone does not predict, and figures without them.

    Attributes:
        outcomes: counts of the trials with such a failure by outcome, most frequent first.
        predicted_successes: number of such trials that were predicted to succeed.
        selected, all_grasps: figures of the other trials, and of the grasps that the other trials
            stand for; see `Judgement`.
    """

    outcomes: dict[str, int]
    predicted_successes: int
    selected: Agreement
    all_grasps: Agreement | None


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Assessment of one judge.

    Attributes:
        selected: figures of the trials themselves.
        all_grasps: figures of all grasps that the trials were chosen from, by weighted trials; None
            if the strata are unknown.
        not_represented: number of grasps in strata without trials.
        unpredictable: failures that a run of the hand alone does not predict; all other figures
            count them as failures. None if there are none, and in other modes.
        bias: predicted against actual success of the trials themselves; `all_grasps.excess` is the
            bias on all grasps.
        standing_out: objects and causes whose verdicts are wrong more often than those of others,
            without unpredictable failures. Empty without real trials.
        tested_groups: number of groups tested for `standing_out`.
        objects, scenes, stages: figures by object, by scene, and by deciding stage.
        stopped: outcomes of the grasps by verdict and blocker.
        outcomes: counts of trials by verdict and outcome.
        calibration: relation of the margins to success.
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


def assess_judge(
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
    """Calculates all figures of a judgement.

    Args:
        pairs: verdicts and outcomes.
        scenes: names of the scenes by their content.
        strata: strata of the trials; None if unknown.
        placement, disagreements: results for the judgement.
        unpredictable: outcomes that no verdict can predict.
        real: whether the outcomes are real trials.
        seed: seed of the intervals' resampling.
    """
    weight = None if strata is None else strata.weight
    selected, represented = _estimate_agreements(pairs, strata, seed)
    names = {outcome.value for outcome in unpredictable}
    excluded = pairs.ended.where([name in names for name in pairs.ended.names])
    outliers, tested_groups = find_outlier_groups(pairs.take(~excluded)) if real else ((), 0)
    return Judgement(
        selected=selected,
        all_grasps=represented,
        not_represented=0 if strata is None else strata.not_represented,
        unpredictable=(
            _estimate_without(pairs, strata, excluded, seed) if excluded.any() else None
        ),
        standing_out=outliers,
        tested_groups=tested_groups,
        bias=replace(
            compare_paired(pairs.predicted, pairs.actual, seed=seed), difference=selected.excess
        ),
        objects=agreement_by_factor(pairs, pairs.object, seed=seed),
        scenes=agreement_by_factor(pairs, pairs.scene, scenes, seed=seed),
        stages=agreement_by_factor(pairs, pairs.stage, seed=seed),
        stopped=outcomes_by_verdict(pairs),
        outcomes=cross_tabulate(pairs.simulated, pairs.ended),
        calibration=calibrate_margins(pairs.margins, pairs.actual, weight),
        placement=placement,
        disagreements=disagreements,
    )


def _estimate_agreements(
    pairs: VerdictPairs, strata: Strata | None, seed: int
) -> tuple[Agreement, Agreement | None]:
    """Figures of the trials, and of all grasps that they represent."""
    if strata is None:
        return estimate_agreement(count_cells(pairs.predicted, pairs.actual)[None], seed=seed), None
    counts = count_cells_by_group(
        pairs.predicted, pairs.actual, strata.index, len(strata.population)
    )
    represented = strata.agreement(pairs.predicted, pairs.actual, seed=seed)
    return estimate_agreement(counts, seed=seed), represented


def _estimate_without(
    pairs: VerdictPairs, strata: Strata | None, excluded: Flags, seed: int
) -> Unpredictable:
    """Counts of the excluded, unpredictable trials, and the figures without them."""
    kept = None if strata is None else strata.select_trials(~excluded)
    selected, represented = _estimate_agreements(pairs.take(~excluded), kept, seed)
    return Unpredictable(
        outcomes=pairs.ended.count(excluded),
        predicted_successes=int(pairs.predicted[excluded].sum()),
        selected=selected,
        all_grasps=represented,
    )
