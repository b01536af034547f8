"""Two runs as two opinions, neither of which is the truth: on which grasps they agree, at which
stage they part, and how far apart their margins are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import CONTESTED, Stage
from burg_drake.experiment.comparison.groups import FactorGroup, by_factor, crossed
from burg_drake.experiment.comparison.parted_grasps import PartedGrasp, parted_grasps
from burg_drake.experiment.pairing import MEASURED, Factor, VerdictPairs, successes
from burg_drake.experiment.statistics import (
    Estimate,
    Flags,
    MarginCalibration,
    Values,
    agreement,
    calibrations,
    matrix_of,
)

COVERED = 0.9
"""Share of the differences of a margin that are within `MarginDifference.within`."""
SURE_CONFIDENCE = 0.95
"""Confidence above which a verdict counts as sure."""
CONFIDENCE_GROUPS = (
    f"below {CONTESTED:g}",
    f"{CONTESTED:g} to {SURE_CONFIDENCE:g}",
    f"above {SURE_CONFIDENCE:g}",
)
"""Groups of verdicts by their confidence, rising."""


@dataclass(frozen=True, eq=False)
class SecondVerdicts:
    """What the second run found of N grasps.

    Attributes:
        stage: (N,) that decided.
        judged_again: (N,) engine that gave the verdict; empty where it is the run's own.
        confidence: (N,) of the verdict; NaN where there is none.
        margins: (N,) numbers by name; NaN where there is none.
    """

    stage: Factor
    judged_again: Factor
    confidence: Array
    margins: Mapping[str, Array]

    def take(self, rows: Values) -> SecondVerdicts:
        """Some grasps, as indices or truth values."""
        margins = {name: values[rows] for name, values in self.margins.items()}
        texts = self.stage.take(rows), self.judged_again.take(rows)
        return SecondVerdicts(*texts, self.confidence[rows], margins)


@dataclass(frozen=True, kw_only=True)
class MarginDifference:
    """How far apart two runs measure a margin of grasps that both executed.

    All is in the unit of its column.

    Attributes:
        name: of the margin.
        grasps: that both executed and measured.
        median: of the second run's less the first's: whether one sees more of it.
        median_size: of the absolute differences.
        within: what nine of ten absolute differences are within.
    """

    name: str
    grasps: int
    median: float
    median_size: float
    within: float


@dataclass(frozen=True, kw_only=True)
class RunAgreement:
    """Agreement of two runs on what is held.

    `lifted`, `lifted_disturbed` and `lifted_turned` are, whatever counts as success elsewhere.

    Attributes:
        alike: share of the grasps that both hold, or both do not, with Wilson's interval.
        kappa: Cohen's, of the same.
        same_rows: grasps with the same outcome, stage, engine, confidence and margins in both, to
            the last digit, as those of a copy have them.
        objects: the same by object; their accuracy is the share that is alike.
        stages: grasps by the stage that decided in the first run, and in the second.
        apart: the same of the grasps that are not alike.
        parted: the grasps that are not alike, by name.
        confidence: as `objects`, by the confidence of the first run's verdicts, of those that have
            one; see `CONFIDENCE_GROUPS`.
        margins: share of alike grasps in quantile bins of the first run's margins, of grasps of
            which both runs measured it; `successes` are the alike ones.
        differences: of the margins, where both executed.
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


def run_agreement(
    pairs: VerdictPairs,
    second: SecondVerdicts,
    scenes: Mapping[str, str],
    folders: Sequence[Mapping[str, str]],
    *,
    seed: int = 0,
) -> RunAgreement:
    """Compares two runs with each other.

    Args:
        pairs: N grasps with the verdicts of the first run, and how they ended in the second.
        second: what the second run found of them besides.
        scenes: names of the scenes by their content.
        folders: of the two runs, by content of the scene.
        seed: of the intervals' resampling.
    """
    held = replace(
        pairs,
        predicted=successes(pairs.simulated, "held"),
        actual=successes(pairs.ended, "held"),
    )
    alike = held.predicted == held.actual
    found = agreement(matrix_of(held.predicted, held.actual), seed=seed)
    measured = {
        name: np.where(np.isfinite(second.margins[name]), pairs.margins[name], np.nan)
        for name in MEASURED
    }
    return RunAgreement(
        alike=found.accuracy,
        kappa=found.kappa,
        same_rows=int(_same_rows(pairs, second).sum()),
        objects=by_factor(held, held.object, seed=seed),
        stages=_by_stage(pairs.stage, second.stage),
        apart=_by_stage(pairs.stage.take(~alike), second.stage.take(~alike)),
        parted=parted_grasps(pairs, ~alike, scenes, folders),
        confidence=_by_confidence(held, seed),
        margins=calibrations(measured, alike),
        differences=margin_differences(pairs, second),
    )


def both_executed(first: Factor, second: Factor) -> Flags:
    """(N,) whether the trials of both runs came to the grip, by the stages that decided."""
    one, other = (
        stage.where([name == Stage.EXECUTED.value for name in stage.names])
        for stage in (first, second)
    )
    return one & other


def _same_rows(pairs: VerdictPairs, second: SecondVerdicts) -> Flags:
    """(N,) whether both runs have the same verdicts with the same numbers."""
    same = _same_texts(pairs.simulated, pairs.ended) & _same_texts(pairs.stage, second.stage)
    same &= _same_texts(pairs.judged_again, second.judged_again)
    numbers = [(pairs.margins[name], second.margins[name]) for name in MEASURED]
    for one, other in [*numbers, (pairs.confidence, second.confidence)]:
        same &= (one == other) | (np.isnan(one) & np.isnan(other))
    return same


def _same_texts(first: Factor, second: Factor) -> Flags:
    place = {name: k for k, name in enumerate(second.names)}
    codes = np.array([place.get(name, -1) for name in first.names], dtype=np.intp)
    same: Flags = codes[first.index] == second.index
    return same


def margin_differences(pairs: VerdictPairs, second: SecondVerdicts) -> tuple[MarginDifference, ...]:
    """How far apart two runs measure what both executed; margins that they never have in common are
    left out."""
    executed = both_executed(pairs.stage, second.stage)
    found = []
    for name in MEASURED:
        apart = second.margins[name][executed] - pairs.margins[name][executed]
        apart = apart[np.isfinite(apart)]
        if len(apart):
            size = np.abs(apart)
            found.append(
                MarginDifference(
                    name=name,
                    grasps=len(apart),
                    median=float(np.median(apart)),
                    median_size=float(np.median(size)),
                    within=float(np.quantile(size, COVERED)),
                )
            )
    return tuple(found)


def _by_confidence(held: VerdictPairs, seed: int) -> tuple[FactorGroup, ...]:
    """Agreement by the confidence of the first run's verdicts, of those that have one."""
    known = np.isfinite(held.confidence)
    if not known.any():
        return ()
    values = held.confidence[known]
    group = (values >= CONTESTED).astype(np.intp) + (values > SURE_CONFIDENCE)
    names = {name: name for name in CONFIDENCE_GROUPS}
    return by_factor(held.take(known), Factor(CONFIDENCE_GROUPS, group), names, seed=seed)


def _by_stage(first: Factor, second: Factor) -> dict[str, dict[str, int]]:
    """Grasps by stage and stage in the order of the stages; only what occurs."""
    counts, order = crossed(first, second), [stage.value for stage in Stage]
    return {
        row: {column: counts[row][column] for column in order if column in counts[row]}
        for row in order
        if row in counts
    }
