"""Objects, verdicts and bodies in the way whose verdicts are wrong more often than those of others.

Trials are compared with others of the same prediction: a predicted success that failed with other
predicted successes, a predicted failure that succeeded with other predicted failures. So it does
not matter how many of either were chosen. `benchmarks/compare.py` measures false alarms and power.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Literal

import numpy as np

from burg_drake.experiment.pairing import Factor, VerdictPairs
from burg_drake.experiment.statistics import Flags

SIGNIFICANCE_LEVEL = 0.05
"""Probability of naming any group if none stands out, about: mid-p values give no strict bound.
`benchmarks/compare.py` measures it."""
GroupKind = Literal["object", "verdict", "body in the way"]


@dataclass(frozen=True, kw_only=True)
class OutlierGroup:
    """Trials whose verdicts are wrong more often than those of others with the same prediction.

    Attributes:
        kind: what the trials have in common.
        name: the object, simulated outcome, or body in the way.
        predicted: whether their success was predicted.
        wrong, trials: how many of these trials ended otherwise, and how many there are.
        other_wrong, other_trials: the same of all other trials with this prediction.
        ended: the wrong ones by how they ended, the most frequent first.
        p_value: one-sided mid-p of Fisher's exact test.
        corrected: the same by Holm's method, for all tested groups.
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


def standing_out(pairs: VerdictPairs) -> tuple[tuple[OutlierGroup, ...], int]:
    """Looks for groups whose verdicts are wrong more often than those of others.

    Args:
        pairs: N trials that the verdicts can predict.

    Returns:
        Groups with a corrected p-value below `SIGNIFICANCE_LEVEL`, the smallest first, and the
        number of tested groups. Groups with too few trials to reach that level are not tested.
    """
    factors: list[tuple[GroupKind, Factor]] = [
        ("object", pairs.object),
        ("verdict", pairs.simulated),
        ("body in the way", pairs.blocker),
    ]
    wrong = pairs.predicted != pairs.actual
    groups: list[tuple[GroupKind, str, bool, Flags, tuple[int, int, int, int]]] = []
    for predicted in (True, False):
        same = pairs.predicted == predicted
        for kind, factor in factors:
            for k in np.unique(factor.index[same]).tolist():
                rows = same & (factor.index == k)
                counts = _counts(wrong, rows, same & ~rows)
                if factor.names[k] and _could_stand_out(*counts):
                    groups.append((kind, factor.names[k], predicted, rows & wrong, counts))
    p_values = [excess_p_value(*counts) for *_, counts in groups]
    found = [
        OutlierGroup(
            kind=kind,
            name=name,
            predicted=predicted,
            wrong=count[0],
            trials=count[1],
            other_wrong=count[2],
            other_trials=count[3],
            ended=_ended(pairs.ended, rows),
            p_value=p_value,
            corrected=corrected,
        )
        for (kind, name, predicted, rows, count), p_value, corrected in zip(
            groups, p_values, holm(p_values), strict=True
        )
        if corrected < SIGNIFICANCE_LEVEL
    ]
    return tuple(sorted(found, key=lambda one: one.p_value)), len(groups)


def _counts(wrong: Flags, rows: Flags, others: Flags) -> tuple[int, int, int, int]:
    """Wrong verdicts and trials of a group, and of the others."""
    parts = (rows & wrong, rows, others & wrong, others)
    return int(parts[0].sum()), int(parts[1].sum()), int(parts[2].sum()), int(parts[3].sum())


def _could_stand_out(wrong: int, trials: int, other_wrong: int, other_trials: int) -> bool:
    """Whether a group would stand out, uncorrected, if all wrong verdicts were its own as far as it
    has room; that depends on the totals alone, so that others need not be corrected for."""
    total = wrong + other_wrong
    most = min(total, trials)
    return excess_p_value(most, trials, total - most, other_trials) < SIGNIFICANCE_LEVEL


def _ended(ended: Factor, rows: Flags) -> dict[str, int]:
    return dict(Counter(ended.names[k] for k in ended.index[rows].tolist()).most_common())


def excess_p_value(errors: int, trials: int, other_errors: int, other_trials: int) -> float:
    """One-sided p-value of Fisher's exact test that a group errs no more often than the others.

    It is the mid-p (H. O. Lancaster, JASA 56, 1961): half the probability of what was seen counts,
    as the exact one finds less than it may where counts are small.

    Args:
        errors, trials: of the group.
        other_errors, other_trials: of all others.
    """
    total = errors + other_errors
    ways = [
        comb(trials, k) * comb(other_trials, total - k)
        for k in range(errors, min(trials, total) + 1)
    ]
    return (ways[0] + 2 * sum(ways[1:])) / (2 * comb(trials + other_trials, total))


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values corrected for their number (S. Holm, Scandinavian Journal of Statistics 6, 1979):
    with those below a level taken for real, the probability of any false one is at most that level,
    as far as it is for each p-value alone."""
    order = np.argsort(p_values, kind="stable")
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    scaled = np.minimum(1.0, np.asarray(p_values)[order] * factors)
    corrected[order] = np.maximum.accumulate(scaled)
    return [float(p) for p in corrected]
