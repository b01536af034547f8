"""How much sensor noise, a wrong camera pose or other friction cost a method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from burg_drake.benchmark.benchmark_folder import BenchmarkResult
from burg_drake.benchmark.measures import BenchmarkMeasure, trial_ap
from burg_drake.benchmark.method_comparison import (
    MethodComparison,
    MethodDifference,
    compare_pairs,
    scene_means,
)
from burg_drake.core import Array


@dataclass(frozen=True, eq=False)
class ConditionEffect:
    """A method under conditions that differ from those of the suite.

    Attributes:
        result: the benchmark under these conditions.
        measures: its measures.
        usual: measures under the suite's conditions.
        difference: average precision under these conditions minus that under the suite's, on the
            same scenes; corrected for all effects that were asked for together.
    """

    result: BenchmarkResult
    measures: Mapping[str, BenchmarkMeasure]
    usual: Mapping[str, BenchmarkMeasure]
    difference: MethodDifference


def condition_effects(comparisons: Sequence[MethodComparison]) -> list[ConditionEffect]:
    """Effects of conditions on methods, by suite, method and condition.

    Only methods that were also run under the conditions of the suite have effects, and only with
    the protocol `single`: its scenes are the same.

    Args:
        comparisons: as `compare_by_suite` returns them.
    """
    measures = {
        one.path: comparison.measures[one.document.name]
        for comparison in comparisons
        for one in comparison.results
    }
    usual = _usual_results(comparisons)
    changed = sorted(
        (one for c in comparisons for one in c.results if _has_usual(one, usual)),
        key=lambda one: (*_key(one), *one.document.conditions.changes.items()),
    )
    pairs = [(one, usual[_key(one)]) for one in changed]
    means = [values for pair in pairs for values in _scene_precisions(pair)]
    names = [f"{r.document.name}, {r.document.conditions}" for pair in pairs for r in pair]
    differences = compare_pairs(
        names, means, "average_precision", [(k, k + 1) for k in range(0, len(names), 2)]
    )
    return [
        ConditionEffect(one, measures[one.path], measures[other.path], difference)
        for (one, other), difference in zip(pairs, differences, strict=True)
    ]


def without_effects(comparisons: Sequence[MethodComparison]) -> list[MethodComparison]:
    """The comparisons, without those of one method whose effect `condition_effects` has."""
    usual = _usual_results(comparisons)
    return [c for c in comparisons if len(c.results) > 1 or not _has_usual(c.results[0], usual)]


def _usual_results(
    comparisons: Sequence[MethodComparison],
) -> dict[tuple[str, ...], BenchmarkResult]:
    """Results under the conditions of their suites."""
    return {
        _key(one): one
        for comparison in comparisons
        for one in comparison.results
        if not one.document.conditions.changes
    }


def _has_usual(result: BenchmarkResult, usual: Mapping[tuple[str, ...], object]) -> bool:
    known = result.document
    return known.protocol == "single" and bool(known.conditions.changes) and _key(result) in usual


def _key(result: BenchmarkResult) -> tuple[str, ...]:
    """What has to be equal for results that differ in their conditions alone."""
    known = result.document
    settings = (known.protocol, known.split, str(known.depth_only), known.settled, known.images)
    return (known.suite, known.suite_hash, *settings, known.name)


def _scene_precisions(pair: tuple[BenchmarkResult, BenchmarkResult]) -> list[Array]:
    """(S,) average precision in each scene, for both results."""
    budget = pair[0].suite.budget.grasps
    return scene_means(pair, lambda answer: trial_ap(answer, budget))
