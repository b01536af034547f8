"""Agreement of two runs, neither of which is the truth: verdicts, deciding stages, margins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import CONTESTED_CONFIDENCE, Stage
from burg_drake.experiment.comparison.confusion_matrix import (
    Estimate,
    Flags,
    count_cells,
    estimate_agreement,
)
from burg_drake.experiment.comparison.group_agreement import (
    FactorGroup,
    agreement_by_factor,
    cross_tabulate,
)
from burg_drake.experiment.comparison.judge_assessment import replay_commands
from burg_drake.experiment.comparison.margin_calibration import MarginCalibration, calibrate_margins
from burg_drake.experiment.comparison.result_table import ResultTable, TextFactor
from burg_drake.experiment.comparison.verdict_pairs import (
    MEASURED_MARGINS,
    VerdictPairs,
    is_success_verdict,
)


@dataclass(frozen=True, kw_only=True)
class PartedGrasp:
    """A grasp that only one of two runs holds.

    Attributes:
        scene, object, grasp: names of scene and object, and id of the grasp.
        first, second: outcome in each run.
        confidence: confidence of the first run's verdict; None if it has none.
        replays: commands that show the grasp in the first run, and in the second.
    """

    scene: str
    object: str
    grasp: str
    first: str
    second: str
    confidence: float | None
    replays: tuple[str, ...]


def parted_grasps(
    pairs: VerdictPairs,
    parted: Flags,
    scenes: Mapping[str, str],
    folders: Sequence[Mapping[str, str]],
) -> tuple[PartedGrasp, ...]:
    """Lists grasps that only one of two runs holds, in the order of the first run.

    Args:
        pairs: N grasps with the verdicts of the first run and the outcomes of the second.
        parted: (N,) which grasps to list.
        scenes: names of the scenes by their content.
        folders: folders of the two runs, by content hash of the scene.
    """
    found = []
    for row in np.flatnonzero(parted).tolist():
        scene, grasp, confidence = pairs.scene[row], pairs.id[row], float(pairs.confidence[row])
        found.append(
            PartedGrasp(
                scene=scenes.get(scene, scene),
                object=pairs.object[row],
                grasp=grasp,
                first=pairs.simulated[row],
                second=pairs.ended[row],
                confidence=None if np.isnan(confidence) else confidence,
                replays=replay_commands(folders, scene, grasp),
            )
        )
    return tuple(found)


HIGH_CONFIDENCE = 0.95
"""Confidence above which a verdict counts as sure."""
CONFIDENCE_GROUPS = (
    f"below {CONTESTED_CONFIDENCE:g}",
    f"{CONTESTED_CONFIDENCE:g} to {HIGH_CONFIDENCE:g}",
    f"above {HIGH_CONFIDENCE:g}",
)
"""Groups of verdicts by their confidence, rising."""


@dataclass(frozen=True, kw_only=True)
class MarginDifference:
    """Differences of a margin between two runs, for grasps that both executed.

    All values are in the unit of the margin's column.

    Attributes:
        name: name of the margin.
        grasps: number of grasps that both executed and measured.
        median: median of the margin in the second run minus that in the first.
        median_size: median of the absolute differences.
        within: 90 % quantile of the absolute differences.
    """

    name: str
    grasps: int
    median: float
    median_size: float
    within: float


@dataclass(frozen=True, kw_only=True)
class RunAgreement:
    """Agreement of two runs on which grasps hold their object.

    `lifted`, `lifted_disturbed` and `lifted_turned` count as held, whatever counts as success
    elsewhere.

    Attributes:
        alike: share of grasps that both runs hold or both do not, with Wilson's interval.
        kappa: Cohen's kappa of holding in both runs.
        same_rows: number of grasps with exactly the same outcome, stage, engine, confidence and
            margins in both runs, as in a copy.
        objects: agreement by object; its accuracy is the share of alike grasps.
        stages: number of grasps by the stage that decided in the first run, and in the second.
        apart: as `stages`, for the grasps that only one run holds.
        parted: grasps that only one run holds.
        confidence: as `objects`, by confidence of the first run's verdicts, if they have one; see
            `CONFIDENCE_GROUPS`.
        margins: share of alike grasps in quantile bins of the first run's margins, for grasps
            measured by both runs. Alike grasps count as successes.
        differences: differences of the margins of grasps that both runs executed.
    """

    alike: Estimate
    kappa: Estimate
    same_rows: int
    objects: tuple[FactorGroup, ...]
    stages: dict[str, dict[str, int]]
    apart: dict[str, dict[str, int]]
    parted: tuple[PartedGrasp, ...]
    confidence: tuple[FactorGroup, ...]
    margins: tuple[MarginCalibration, ...]
    differences: tuple[MarginDifference, ...]


def assess_run_agreement(
    pairs: VerdictPairs,
    second: ResultTable,
    scenes: Mapping[str, str],
    folders: Sequence[Mapping[str, str]],
    *,
    seed: int = 0,
) -> RunAgreement:
    """Compares two runs with each other.

    Args:
        pairs: N grasps with the verdicts of the first run and the outcomes of the second.
        second: the N rows of the second run, with the columns `REFERENCE_COLUMNS`.
        scenes: names of the scenes by their content.
        folders: folders of the two runs, by content hash of the scene.
        seed: seed of the intervals' resampling.
    """
    held = replace(
        pairs,
        predicted=is_success_verdict(pairs.simulated, "held"),
        actual=is_success_verdict(pairs.ended, "held"),
    )
    alike = held.predicted == held.actual
    found = estimate_agreement(count_cells(held.predicted, held.actual), seed=seed)
    measured = {
        name: np.where(np.isfinite(second.numbers[name]), pairs.margins[name], np.nan)
        for name in MEASURED_MARGINS
    }
    return RunAgreement(
        alike=found.accuracy,
        kappa=found.kappa,
        same_rows=int(_identical_rows(pairs, second).sum()),
        objects=agreement_by_factor(held, held.object, seed=seed),
        stages=_count_stage_pairs(pairs.stage, second.texts["stage"]),
        apart=_count_stage_pairs(pairs.stage.take(~alike), second.texts["stage"].take(~alike)),
        parted=parted_grasps(pairs, ~alike, scenes, folders),
        confidence=_agreement_by_confidence(held, seed),
        margins=calibrate_margins(measured, alike),
        differences=margin_differences(pairs, second),
    )


def both_executed(first: TextFactor, second: TextFactor) -> Flags:
    """(N,) whether both runs executed the grasp, by the deciding stages."""
    one, other = (
        stage.where([name == Stage.EXECUTED.value for name in stage.names])
        for stage in (first, second)
    )
    return one & other


def _identical_rows(pairs: VerdictPairs, second: ResultTable) -> Flags:
    """(N,) whether both runs have the same verdicts with the same numbers."""
    same = _equal_texts(pairs.simulated, pairs.ended) & _equal_texts(
        pairs.stage, second.texts["stage"]
    )
    same &= _equal_texts(pairs.judged_again, second.texts["judged_again"])
    numbers = [(pairs.margins[name], second.numbers[name]) for name in MEASURED_MARGINS]
    for one, other in [*numbers, (pairs.confidence, second.numbers["confidence"])]:
        same &= (one == other) | (np.isnan(one) & np.isnan(other))
    return same


def _equal_texts(first: TextFactor, second: TextFactor) -> Flags:
    code_in_second = {name: k for k, name in enumerate(second.names)}
    codes = np.array([code_in_second.get(name, -1) for name in first.names], dtype=np.intp)
    same: Flags = codes[first.index] == second.index
    return same


def margin_differences(pairs: VerdictPairs, second: ResultTable) -> tuple[MarginDifference, ...]:
    """Differences of the margins of grasps that both runs executed. A margin that no grasp has in
    both runs is left out.
    """
    covered_share = 0.9  # Share of the differences covered by `MarginDifference.within`.
    executed = both_executed(pairs.stage, second.texts["stage"])
    found = []
    for name in MEASURED_MARGINS:
        difference = second.numbers[name][executed] - pairs.margins[name][executed]
        difference = difference[np.isfinite(difference)]
        if len(difference):
            size = np.abs(difference)
            found.append(
                MarginDifference(
                    name=name,
                    grasps=len(difference),
                    median=float(np.median(difference)),
                    median_size=float(np.median(size)),
                    within=float(np.quantile(size, covered_share)),
                )
            )
    return tuple(found)


def _agreement_by_confidence(held: VerdictPairs, seed: int) -> tuple[FactorGroup, ...]:
    """Agreement by confidence of the first run's verdicts, if they have one."""
    known = np.isfinite(held.confidence)
    if not known.any():
        return ()
    values = held.confidence[known]
    group = (values >= CONTESTED_CONFIDENCE).astype(np.intp) + (values > HIGH_CONFIDENCE)
    names = {name: name for name in CONFIDENCE_GROUPS}
    return agreement_by_factor(
        held.take(known), TextFactor(CONFIDENCE_GROUPS, group), names, seed=seed
    )


def _count_stage_pairs(first: TextFactor, second: TextFactor) -> dict[str, dict[str, int]]:
    """Counts of grasps by the stages of both runs, in the order of the stages, without zeros."""
    counts, order = cross_tabulate(first, second), [stage.value for stage in Stage]
    return {
        row: {column: counts[row][column] for column in order if column in counts[row]}
        for row in order
        if row in counts
    }
