"""Measures of a benchmark: success, precision, how far grasps get, times; with 95 % intervals.

Scenes, not grasps, are the independent samples: grasps of one scene share its objects and image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from burg_drake.benchmark.benchmark_folder import FRICTION_COLUMN, BenchmarkResult, JudgedAnswer
from burg_drake.benchmark.clearing import episodes
from burg_drake.core import (
    Array,
    Booleans,
    Outcome,
    Stage,
    Verdict,
    clustered_interval,
    mean_interval,
)
from burg_drake.grasping import GraspNetSettings
from burg_drake.simulation import DEFAULT_TRIAL


class BenchmarkMeasure(NamedTuple):
    """A measure of a benchmark.

    Attributes:
        value: the measure.
        low, high: 95 % interval, if the scenes were drawn again.
        least, most: the measure if all contested verdicts were failures, or successes.
    """

    value: float
    low: float
    high: float
    least: float
    most: float


MEASURE_MEANINGS = {
    "top_success": "share of observations whose best grasp lifted its object",
    "precision_3": "mean share of lifted grasps among the best 3",
    "precision_5": "mean share of lifted grasps among the best 5",
    "average_precision": "mean of the precisions at 1, 2, ... to the budget, by trials",
    "graspnet_ap": "the same by force closure at six frictions without collision, as GraspNet's AP",
    "answered": "share of observations with an answer that has grasps",
    "clear": "share of judged grasps at which the open hand is clear",
    "reachable": "share of judged grasps that the arm reaches, too",
    "planned": "share of judged grasps that the arm can approach and lift, too",
    "held": "share of judged grasps that held their object to the end",
    "lifted": "share of judged grasps that lifted it, and moved nothing else",
    "disturbed": "share of executed grasps that moved another object by more than 10 mm",
    "cleared": "share of objects that were taken away (declutter rate)",
    "mean_picks": "mean number of objects that were taken from a scene",
    "pick_success": "share of attempts that took an object away",
    "emptied": "share of scenes that were emptied",
}
"""Meaning of each measure by name; the last four are of the protocol `clear`."""
COUNT_MEASURES = frozenset({"mean_picks"})
"""Measures that are no shares."""

ContestedAs = bool | None
"""What contested verdicts count as: what they say if None."""


class _Ratio(NamedTuple):
    """A measure as a ratio of totals over observations.

    Attributes:
        numerator: its part of an observation, given what contested verdicts count as.
        denominator: likewise; None for a mean over observations.
    """

    numerator: Callable[[JudgedAnswer, ContestedAs], float]
    denominator: Callable[[JudgedAnswer], float] | None = None


def measure_all(result: BenchmarkResult) -> dict[str, BenchmarkMeasure]:
    """All measures of a complete benchmark by name; see `MEASURE_MEANINGS`.

    Scenes that could not be judged are left out: they are not the planner's fault.

    Raises:
        InvalidInputError: the benchmark is not complete.
    """
    result.require_complete()
    ratios = _ratios(result.suite.budget.grasps)
    if result.suite.mode == "hand":  # reach is not judged
        del ratios["reachable"], ratios["planned"]
    judged = [one for one in result.answers if one.is_judged]
    found = {name: measure_ratio(judged, ratio) for name, ratio in ratios.items()}
    if result.document.protocol == "clear":
        found |= _clearing_measures(result)
    return {name: found[name] for name in MEASURE_MEANINGS if name in found}


def _clearing_measures(result: BenchmarkResult) -> dict[str, BenchmarkMeasure]:
    """Measures of the protocol `clear`. Contested verdicts decide how a scene goes on, so their
    range cannot be told."""
    counts = {one.name: len(one.instances) for one in result.suite.scenes}
    attempts = {
        name: made
        for name, made in episodes(result).items()
        if all(one.answer.is_judged for one in made)
    }
    objects = [counts[name] for name in attempts]
    taken = [sum(one.succeeded for one in made) for made in attempts.values()]
    made = [len(found) for found in attempts.values()]
    emptied = [float(n == count) for n, count in zip(taken, objects, strict=True)]

    def measure(successes: Sequence[float], trials: Sequence[float]) -> BenchmarkMeasure:
        if not sum(trials):
            return BenchmarkMeasure(*[float("nan")] * 5)
        value = sum(successes) / sum(trials)
        return BenchmarkMeasure(value, *clustered_interval(successes, trials), value, value)

    cleared = measure(taken, objects)
    mean_objects = float(np.mean(objects)) if objects else float("nan")
    return {
        "cleared": cleared,
        "mean_picks": BenchmarkMeasure(*(mean_objects * share for share in cleared)),
        "pick_success": measure(taken, made),
        "emptied": measure(emptied, [1.0] * len(emptied)),
    }


def measure_ratio(answers: Sequence[JudgedAnswer], ratio: _Ratio) -> BenchmarkMeasure:
    """A measure with its interval over scenes."""
    scenes = [one.answer.scene for one in answers]
    numbers = {scene: k for k, scene in enumerate(dict.fromkeys(scenes))}
    group = np.array([numbers[scene] for scene in scenes], dtype=int)
    count = ratio.denominator or (lambda answer: 1.0)
    trials = np.bincount(group, [count(one) for one in answers], len(numbers))
    whole = trials.sum()
    totals = [
        np.bincount(group, [ratio.numerator(one, counted) for one in answers], len(numbers))
        for counted in (None, False, True)
    ]
    if not whole:
        return BenchmarkMeasure(*[float("nan")] * 5)
    value, least, most = (float(total.sum() / whole) for total in totals)
    if ratio.denominator is None:
        low, high = mean_interval(totals[0] / trials)
    else:
        low, high = clustered_interval(totals[0].tolist(), trials.tolist())
    return BenchmarkMeasure(value, low, high, least, most)


def precision_at(answer: JudgedAnswer, k: int, contested: ContestedAs = None) -> float:
    """Share of lifted grasps among the best k; missing grasps count as failures."""
    return float(answer.lifted(contested_as=contested)[:k].sum()) / k


def trial_ap(answer: JudgedAnswer, budget: int, contested: ContestedAs = None) -> float:
    """Mean of the precisions at 1 to `budget`, by trials."""
    return _mean_precision(answer.lifted(contested_as=contested), budget)


def graspnet_ap_of(answer: JudgedAnswer, budget: int) -> float:
    """Mean of the precisions at 1 to `budget` and of GraspNet's friction coefficients.

    A grasp is good if the open hand is clear and the friction suffices by the geometry of its
    contacts (Fang et al., GraspNet-1Billion, CVPR 2020). Grasps near a better one are left out
    before, as there.
    """
    needed = answer.answer.grasps.columns[FRICTION_COLUMN]
    clear = np.array([_is_clear(v) for v in answer.verdicts], dtype=bool)
    return float(
        np.mean(
            [_mean_precision(clear & (needed <= mu), budget) for mu in GraspNetSettings.frictions]
        )
    )


def _mean_precision(good: Array | Booleans, budget: int) -> float:
    hits = np.zeros(budget)
    hits[: len(good)] = good[:budget]
    return float(np.mean(np.cumsum(hits) / np.arange(1, budget + 1)))


def _ratios(budget: int) -> dict[str, _Ratio]:
    """The measures for a budget of grasps."""

    def per_grasp(holds: Callable[[Verdict], bool]) -> _Ratio:
        return _Ratio(
            lambda answer, _: sum(v is not None and holds(v) for v in answer.verdicts),
            lambda answer: len(answer.verdicts),
        )

    found = {
        "top_success": _Ratio(lambda a, c: precision_at(a, 1, c)),
        "average_precision": _Ratio(lambda a, c: trial_ap(a, budget, c)),
        "graspnet_ap": _Ratio(lambda a, _: graspnet_ap_of(a, budget)),
        "answered": _Ratio(lambda a, _: float(len(a.verdicts) > 0)),
        "clear": per_grasp(_is_clear),
        "reachable": per_grasp(lambda v: _has_passed(v, Stage.REACHABLE)),
        "planned": per_grasp(lambda v: _has_passed(v, Stage.PLANNED)),
        "held": _Ratio(lambda a, c: float(a.held(contested_as=c).sum()), lambda a: len(a.verdicts)),
        "lifted": _Ratio(
            lambda a, c: float(a.lifted(contested_as=c).sum()), lambda a: len(a.verdicts)
        ),
        "disturbed": _Ratio(
            lambda a, _: sum(v is not None and _is_disturbing(v) for v in a.verdicts),
            lambda a: sum(v is not None and _has_passed(v, Stage.PLANNED) for v in a.verdicts),
        ),
    }
    found |= {
        f"precision_{k}": _Ratio(lambda a, c, k=k: precision_at(a, k, c))  # type: ignore[misc]
        for k in (3, 5)
        if k <= budget
    }
    return found


def _is_clear(verdict: Verdict | None) -> bool:
    return verdict is not None and _has_passed(verdict, Stage.CLEAR)


def _has_passed(verdict: Verdict, stage: Stage) -> bool:
    """Whether a grasp has passed a stage: a later one decided."""
    order = list(Stage)
    return order.index(verdict.stage) > order.index(stage)


def _is_disturbing(verdict: Verdict) -> bool:
    moved = verdict.margins.get("others_moved", 0.0)
    return verdict.outcome is Outcome.LIFTED_DISTURBED or moved > DEFAULT_TRIAL.disturbance
