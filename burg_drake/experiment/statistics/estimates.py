"""Figures with intervals, and the measures of agreement that follow from a confusion matrix.

Undefined is None with a reason, never 0 and never an exception: precision without a predicted
success says nothing, and 0 would say something.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from burg_drake.core import Array, wilson_interval

CELLS: Final = ("tp", "fp", "fn", "tn")
"""Cells of a confusion matrix in the order of all arrays here: success was predicted and came
true, was predicted and failed, was not predicted and succeeded, was not predicted and failed."""


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval.

    Attributes:
        value: None if it is undefined.
        low, high: bounds; None if there is no interval.
        reason: why it is undefined; empty otherwise.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    reason: str = ""

    @classmethod
    def undefined(cls, reason: str) -> Estimate:
        """No number, and why."""
        return cls(None, reason=reason)

    @classmethod
    def between(cls, value: float, low: float, high: float) -> Estimate:
        """A number within its interval, which is stretched to it where it has to be."""
        return cls(value, min(value, low), max(value, high))


def share(successes: float, trials: float, reason: str = "no trials") -> Estimate:
    """A proportion with Wilson's interval; counts may be effective ones, and then no integers.

    Args:
        successes, trials: counts.
        reason: why it is undefined if there are no trials.
    """
    if trials <= 0:
        return Estimate.undefined(reason)
    successes, trials = float(successes), float(trials)
    value = min(1.0, successes / trials)
    low, high = wilson_interval(successes, trials)
    return Estimate.between(value, low, high)


@dataclass(frozen=True)
class Measure:
    """A measure of agreement.

    Attributes:
        name: in words.
        part, whole: cells whose sums it is the ratio of; empty if it is no share.
        of: its values from cells, arrays of one shape; NaN or infinite where undefined.
        low, high: its range.
        reason: why it may be undefined.
    """

    name: str
    of: Callable[[Array, Array, Array, Array], Array]
    reason: str
    part: tuple[int, ...] = ()
    whole: tuple[int, ...] = ()
    low: float = 0.0
    high: float = 1.0

    @property
    def is_share(self) -> bool:
        """Whether it is a proportion of trials."""
        return bool(self.whole)


def _share(name: str, part: tuple[int, ...], whole: tuple[int, ...], reason: str) -> Measure:
    def of(*cells: Array) -> Array:
        added: list[Array] = [np.sum([cells[k] for k in of], axis=0) for of in (part, whole)]
        return added[0] / added[1]

    return Measure(name, of, reason, part, whole)


def _f1(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return 2 * tp / (2 * tp + fp + fn)


def _balanced(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return (tp / (tp + fn) + tn / (tn + fp)) / 2


def _matthews(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    scale = np.sqrt(tp + fp) * np.sqrt(tp + fn) * np.sqrt(tn + fp) * np.sqrt(tn + fn)
    coefficient: Array = np.clip((tp * tn - fp * fn) / scale, -1.0, 1.0)
    return coefficient


def _kappa(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    # 1 less the share of disagreement by that of two independent judges with the same habits
    chance = (tp + fp) * (fp + tn) + (fn + tn) * (tp + fn)
    return 1.0 - (tp + fp + fn + tn) * (fp + fn) / chance


def _excess(tp: Array, fp: Array, fn: Array, tn: Array) -> Array:
    return (fp - fn) / (tp + fp + fn + tn)


MEASURES: Final[Mapping[str, Measure]] = {
    "precision": _share("precision", (0,), (0, 1), "no success was predicted"),
    "recall": _share("recall", (0,), (0, 2), "nothing succeeded"),
    "specificity": _share("specificity", (3,), (1, 3), "nothing failed"),
    "f1": Measure("F1", _f1, "success was neither predicted nor seen"),
    "accuracy": _share("accuracy", (0, 3), (0, 1, 2, 3), "no trials"),
    "balanced_accuracy": Measure("balanced accuracy", _balanced, "all ended alike"),
    "matthews": Measure(
        "Matthews correlation", _matthews, "all verdicts or all outcomes are alike", low=-1.0
    ),
    "kappa": Measure("Cohen's kappa", _kappa, "all verdicts and outcomes are alike", low=-1.0),
    "predicted": _share("predicted success", (0, 1), (0, 1, 2, 3), "no trials"),
    "actual": _share("actual success", (0, 2), (0, 1, 2, 3), "no trials"),
    "excess": Measure("predicted minus actual success", _excess, "no trials", low=-1.0),
}
"""All measures by the name of their field in `confusion.Agreement`.

`specificity` is the share of failures that were predicted, `predicted` and `actual` are shares of
all trials."""
