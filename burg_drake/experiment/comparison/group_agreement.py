"""Agreement by object, scene or verdict, and groups whose error rate is significantly higher.

Trials of a group are compared with other trials of the same prediction: predicted successes that
failed with other predicted successes, predicted failures that succeeded with other predicted
failures. So the numbers of chosen trials of each kind have no influence. `benchmarks/compare.py`
measures false alarms and power.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Literal

import numpy as np

from burg_drake.core import Stage
from burg_drake.experiment.comparison.confusion_matrix import (
    Agreement,
    Estimate,
    Flags,
    count_cells_by_group,
    estimate_agreements,
    estimate_share,
)
from burg_drake.experiment.comparison.result_table import TextFactor
from burg_drake.experiment.comparison.verdict_pairs import VerdictPairs


@dataclass(frozen=True, kw_only=True)
class FactorGroup:
    """Trials of a group, such as those on the same object.

    Attributes:
        name: name of the group.
        agreement: figures of the group.
    """

    name: str
    agreement: Agreement


@dataclass(frozen=True, kw_only=True)
class Stopped:
    """Outcomes of grasps with the same verdict.

    Attributes:
        stage, outcome, blocker: the verdict; the blocker is the body in the way, if any.
        trials: number of trials.
        successes: share of successes.
    """

    stage: str
    outcome: str
    blocker: str
    trials: int
    successes: Estimate


def agreement_by_factor(
    pairs: VerdictPairs,
    factor: TextFactor,
    names: Mapping[str, str] | None = None,
    *,
    seed: int = 0,
) -> tuple[FactorGroup, ...]:
    """Agreement for each value of a text column.

    Args:
        pairs: the trials.
        factor: (N,) the column.
        names: displayed names of the column's values, in the order of the groups; the values
            themselves if None.
        seed: seed of the intervals' resampling.
    """
    counts = count_cells_by_group(pairs.predicted, pairs.actual, factor.index, len(factor.names))
    seen = np.flatnonzero(counts.sum(axis=1)).tolist()
    if names:
        rank = {text: k for k, text in enumerate(names)}
        seen.sort(key=lambda k: rank.get(factor.names[k], len(rank)))
    found = estimate_agreements(counts[seen], seed=seed)
    labels = [factor.names[k] for k in seen]
    return tuple(
        FactorGroup(name=(names or {}).get(label, label), agreement=a)
        for label, a in zip(labels, found, strict=True)
    )


def outcomes_by_verdict(pairs: VerdictPairs) -> tuple[Stopped, ...]:
    """Outcomes of the grasps by verdict, in the order of the stages; within a stage the most
    frequent verdict first."""
    stage_order = [stage.value for stage in Stage]
    stages, outcomes, blockers = pairs.stage, pairs.simulated, pairs.blocker
    width = (len(outcomes.names), len(blockers.names))
    code = (stages.index * width[0] + outcomes.index) * width[1] + blockers.index
    found, index = np.unique(code, return_inverse=True)
    trials = np.bincount(index, minlength=len(found))
    good = np.bincount(index, weights=pairs.actual, minlength=len(found))
    rows = [
        Stopped(
            stage=stages.names[c // width[1] // width[0]],
            outcome=outcomes.names[c // width[1] % width[0]],
            blocker=blockers.names[c % width[1]],
            trials=int(trials[k]),
            successes=estimate_share(int(good[k]), int(trials[k])),
        )
        for k, c in enumerate(found.tolist())
    ]
    return tuple(sorted(rows, key=lambda row: (stage_order.index(row.stage), -row.trials)))


def cross_tabulate(rows: TextFactor, columns: TextFactor) -> dict[str, dict[str, int]]:
    """Counts of trials by the texts of two columns, without combinations that do not occur."""
    width = len(columns.names)
    flat = np.bincount(rows.index * width + columns.index, minlength=len(rows.names) * width)
    counts = flat.reshape(len(rows.names), width)
    return {
        rows.names[r]: {columns.names[c]: int(counts[r, c]) for c in np.flatnonzero(counts[r])}
        for r in np.flatnonzero(counts.sum(axis=1))
    }


OUTLIER_SIGNIFICANCE_LEVEL = 0.05
"""Approximate probability of a false outlier; mid-p values give no strict bound."""
GroupKind = Literal["object", "verdict", "body in the way"]


@dataclass(frozen=True, kw_only=True)
class OutlierGroup:
    """Trials whose verdicts are wrong more often than those of others with the same prediction.

    Attributes:
        kind: what the trials have in common.
        name: the object, simulated outcome, or body in the way.
        predicted: whether their success was predicted.
        wrong, trials: number of wrong verdicts and of trials in the group.
        other_wrong, other_trials: these numbers for all other trials with this prediction.
        ended: counts of the wrong verdicts by actual outcome, most frequent first.
        p_value: one-sided mid-p of Fisher's exact test.
        corrected: p-value corrected by Holm's method for all tested groups.
    """

    kind: GroupKind
    name: str
    predicted: bool
    wrong: int
    trials: int
    other_wrong: int
    other_trials: int
    ended: dict[str, int]
    p_value: float
    corrected: float


def find_outlier_groups(pairs: VerdictPairs) -> tuple[tuple[OutlierGroup, ...], int]:
    """Looks for groups whose verdicts are wrong more often than those of others.

    Args:
        pairs: verdicts and outcomes, without unpredictable outcomes.

    Returns:
        Groups with a corrected p-value below `OUTLIER_SIGNIFICANCE_LEVEL`, the smallest first, and
        the number of tested groups. Groups with too few trials to reach that level are not tested.
    """
    factors: list[tuple[GroupKind, TextFactor]] = [
        ("object", pairs.object),
        ("verdict", pairs.simulated),
        ("body in the way", pairs.blocker),
    ]
    wrong = pairs.predicted != pairs.actual
    groups: list[OutlierGroup] = []
    for predicted in (True, False):
        same = pairs.predicted == predicted
        for kind, factor in factors:
            for k in np.unique(factor.index[same]).tolist():
                rows = same & (factor.index == k)
                errors = _count_errors(wrong, rows, same & ~rows)
                if factor.names[k] and _can_be_outlier(*errors):
                    p_value = excess_p_value(*errors)
                    groups.append(
                        OutlierGroup(
                            kind=kind,
                            name=factor.names[k],
                            predicted=predicted,
                            wrong=errors[0],
                            trials=errors[1],
                            other_wrong=errors[2],
                            other_trials=errors[3],
                            ended=pairs.ended.count(rows & wrong),
                            p_value=p_value,
                            corrected=p_value,
                        )
                    )
    corrected = holm_correction([group.p_value for group in groups])
    found = [
        replace(group, corrected=p_value)
        for group, p_value in zip(groups, corrected, strict=True)
        if p_value < OUTLIER_SIGNIFICANCE_LEVEL
    ]
    return tuple(sorted(found, key=lambda one: one.p_value)), len(groups)


def _count_errors(wrong: Flags, rows: Flags, others: Flags) -> tuple[int, int, int, int]:
    """Number of wrong verdicts and of trials in a group, and among the others."""
    own, other = (rows & wrong).sum(), (others & wrong).sum()
    return int(own), int(rows.sum()), int(other), int(others.sum())


def _can_be_outlier(wrong: int, trials: int, other_wrong: int, other_trials: int) -> bool:
    """Whether a group would be significant, uncorrected, with as many of all wrong verdicts as
    possible. This depends on totals alone, so other groups need not be tested.
    """
    total = wrong + other_wrong
    most = min(total, trials)
    return excess_p_value(most, trials, total - most, other_trials) < OUTLIER_SIGNIFICANCE_LEVEL


def excess_p_value(errors: int, trials: int, other_errors: int, other_trials: int) -> float:
    """One-sided p-value of Fisher's exact test that a group errs no more often than the others.

    It is the mid-p (H. O. Lancaster, JASA 56, 1961), which counts half the probability of the
    observed table, as the exact test is conservative for small counts.

    Args:
        errors, trials: counts of the group.
        other_errors, other_trials: counts of all others.
    """
    total = errors + other_errors
    ways = [
        comb(trials, k) * comb(other_trials, total - k)
        for k in range(errors, min(trials, total) + 1)
    ]
    return (ways[0] + 2 * sum(ways[1:])) / (2 * comb(trials + other_trials, total))


def holm_correction(p_values: Sequence[float]) -> list[float]:
    """P-values corrected for multiple tests (S. Holm, Scandinavian Journal of Statistics 6, 1979).
    The probability of any false positive below a level is at most the level, if this holds for each
    single p-value.
    """
    order = np.argsort(p_values, kind="stable")
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    scaled = np.minimum(1.0, np.asarray(p_values)[order] * factors)
    corrected[order] = np.maximum.accumulate(scaled)
    return [float(p) for p in corrected]
