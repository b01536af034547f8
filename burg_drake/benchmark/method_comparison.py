"""Compares methods on one suite: paired tests on the same scenes, corrected for their number."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from burg_drake.benchmark.benchmark_folder import BENCHMARK_FILE, BenchmarkResult, JudgedAnswer
from burg_drake.benchmark.measures import BenchmarkMeasure, measure_all, precision_at, trial_ap
from burg_drake.core import Array, InvalidInputError
from burg_drake.experiment import holm_correction

SIGNIFICANCE_LEVEL = 0.05
"""Two methods differ if the corrected p value is below this."""


@dataclass(frozen=True)
class MethodDifference:
    """Two methods on the same scenes.

    Attributes:
        first, second: names of the methods.
        measure: name of the measure.
        difference: mean of the first minus mean of the second.
        low, high: 95 % interval of the difference over scenes (Student's t of paired differences);
            NaN if it is the same in all of them.
        p_value: p value of the paired permutation test.
        corrected: the same, corrected by Holm for the pairs of its measure.
    """

    first: str
    second: str
    measure: str
    difference: float
    low: float
    high: float
    p_value: float
    corrected: float

    @property
    def is_significant(self) -> bool:
        """Whether the methods differ."""
        return self.corrected < SIGNIFICANCE_LEVEL


@dataclass(frozen=True, eq=False)
class MethodComparison:
    """Methods on one suite, the best first.

    Attributes:
        results: the benchmarks, by falling average precision.
        measures: measures of each method, by its name.
        differences: all pairs of methods, by measure.
    """

    results: tuple[BenchmarkResult, ...]
    measures: Mapping[str, Mapping[str, BenchmarkMeasure]]
    differences: Mapping[str, tuple[MethodDifference, ...]]

    @property
    def names(self) -> list[str]:
        """Names of the methods, the best first."""
        return [result.document.name for result in self.results]


def compare_methods(results: Sequence[BenchmarkResult]) -> MethodComparison:
    """Compares complete benchmarks of one suite.

    Example::

        both = [burg.benchmark.load_result(f"results/{name}") for name in ("mine", "antipodal")]
        for pair in burg.benchmark.compare_methods(both).differences["top_success"]:
            print(pair.first, pair.second, pair.difference, pair.corrected)

    Raises:
        InvalidInputError: the benchmarks are of different suites, releases or splits, two have the
            same name, or one is not complete.
    """
    _require_comparable(results)
    measures = {one.document.name: measure_all(one) for one in results}
    order = sorted(
        results,
        key=lambda one: (
            -measures[one.document.name]["average_precision"].value,
            one.document.name,
        ),
    )
    budget = order[0].suite.budget.grasps
    values = {
        "top_success": scene_means(order, lambda a: precision_at(a, 1)),
        "average_precision": scene_means(order, lambda a: trial_ap(a, budget)),
    }
    names = [one.document.name for one in order]
    differences = {
        measure: tuple(compare_pairs(names, means, measure)) for measure, means in values.items()
    }
    return MethodComparison(tuple(order), measures, differences)


def version_notes(results: Sequence[BenchmarkResult]) -> list[str]:
    """Notes on packages that decide verdicts and images, of which results have several versions."""
    notes = []
    for package in ("burg_drake", "drake", "mujoco"):
        versions = sorted({r.document.versions.get(package, "") for r in results} - {""})
        if len(versions) > 1:
            notes.append(
                f"the results were made with several versions of {package}"
                f" ({', '.join(versions)}); what differs may be due to that"
            )
    return notes


def compare_by_suite(results: Sequence[BenchmarkResult]) -> list[MethodComparison]:
    """Compares benchmarks of the same suite, protocol and settings, in their order.

    Raises:
        InvalidInputError: results are of several versions of a suite; and as `compare_methods`.
    """
    by_suite: dict[tuple[object, ...], list[BenchmarkResult]] = {}
    for result in results:
        known = result.document
        key = (
            *(known.suite, known.protocol, known.split, known.depth_only, known.settled),
            *(known.conditions, known.images),
        )
        by_suite.setdefault(key, []).append(result)
    if not by_suite:
        raise InvalidInputError("no results are given; give folders that `benchmark run` wrote")
    return [compare_methods(found) for found in by_suite.values()]


def compare_pairs(
    names: Sequence[str],
    means: Sequence[Array],
    measure: str,
    pairs: Sequence[tuple[int, int]] | None = None,
) -> list[MethodDifference]:
    """Differences of pairs of methods, corrected for their number.

    Args:
        names: names of M methods.
        means: (S,) mean of the measure in each scene, for each method, scenes in the same order.
        measure: name of the measure.
        pairs: indices of the methods of each pair; all pairs if None.
    """
    from scipy.special import stdtrit

    pairs = list(itertools.combinations(range(len(names)), 2)) if pairs is None else pairs
    paired = [means[i] - means[j] for i, j in pairs]
    p_values = [permutation_p_value(d) for d in paired]
    found = []
    for (i, j), d, p, corrected in zip(
        pairs, paired, p_values, holm_correction(p_values), strict=True
    ):
        n = len(d)
        mean = float(d.mean()) if n else np.nan
        spread = float(d.std(ddof=1)) if n > 1 else 0.0
        half = float(stdtrit(n - 1, 0.975)) * spread / np.sqrt(n) if spread else np.nan
        found.append(
            MethodDifference(
                names[i],
                names[j],
                measure,
                mean,
                float(np.maximum(-1.0, mean - half)),
                float(np.minimum(1.0, mean + half)),
                p,
                corrected,
            )
        )
    return found


def permutation_p_value(differences: Array) -> float:
    """Two-sided p value of paired differences (S,), if the sign of each were random.

    All signs are tried if there are few differences, else 99,999 random ones. It assumes nothing of
    their distribution (R. A. Fisher, The Design of Experiments, 1935, section 21).
    """
    from scipy.stats import permutation_test

    nonzero = differences[differences != 0.0]
    if len(nonzero) < 2:  # either sign of one difference is as likely
        return 1.0
    found = permutation_test(
        (nonzero,),
        np.sum,
        permutation_type="samples",
        n_resamples=99_999,
        rng=np.random.default_rng(0),
    )
    return float(found.pvalue)


def scene_means(
    results: Sequence[BenchmarkResult], value: Callable[[JudgedAnswer], float]
) -> list[Array]:
    """(S,) mean over the cameras of each scene that was judged in all results, for each result."""
    by_scene: list[dict[str, list[float]]] = []
    for result in results:
        found: dict[str, list[float]] = {}
        for answer in result.answers:
            if answer.is_judged:
                found.setdefault(answer.answer.scene, []).append(value(answer))
        by_scene.append(found)
    common = [name for name in by_scene[0] if all(name in found for found in by_scene)]
    return [np.array([float(np.mean(found[name])) for name in common]) for found in by_scene]


def _require_comparable(results: Sequence[BenchmarkResult]) -> None:
    first = results[0]
    for other in results[1:]:
        for name, noun in (
            ("suite", "suite"),
            ("suite_hash", "version"),
            ("protocol", "protocol"),
            ("split", "split"),
            ("depth_only", "depth only"),
            ("settled", "second engine"),
            ("conditions", "conditions"),
            ("images", "images"),
        ):
            here, there = getattr(first.document, name), getattr(other.document, name)
            if here != there:
                raise InvalidInputError(
                    f"{noun} is {here} in {first.path} (suite {first.document.suite}), but {there}"
                    f" in {other.path} (suite {other.document.suite}); only results of the same"
                    " version of a suite and of the same settings can be compared"
                )
    paths: dict[str, Path] = {}
    for one in results:
        path = paths.setdefault(one.document.name, one.path)
        if path is not one.path:
            raise InvalidInputError(
                f"{path} and {one.path} are both called {one.document.name}; change the name in"
                f" one {BENCHMARK_FILE}"
            )
