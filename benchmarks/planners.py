"""How the built-in grasp planners rank on suites, what that costs, and how often chance differs.

Ranking: the four planners on each suite, with the time of each part and the overhead beside
rendering, planner and trials. Chance: the scores of one planner are shuffled twice, which makes two
methods that differ by chance only; how often does the test tell them apart at 5 %?

    python benchmarks/planners.py tabletop wide_close packed -o results
    python benchmarks/planners.py tabletop -o results --shuffles 200
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from burg_drake.benchmark import (
    BenchmarkResult,
    BenchmarkSettings,
    JudgedAnswer,
    all_tables,
    compare_by_suite,
    compare_methods,
    measure_all,
    run_benchmark,
)

PLANNERS = ("oracle", "antipodal", "top_down", "random")
"""The planners in the order in which they should rank."""


def shuffled(result: BenchmarkResult, rng: np.random.Generator, name: str) -> BenchmarkResult:
    """The same grasps and verdicts in random order, as if their scores were shuffled."""
    answers = []
    for one in result.answers:
        order = rng.permutation(len(one.verdicts))
        answer = replace(one.answer, grasps=one.answer.grasps.select(order))
        answers.append(JudgedAnswer(answer, tuple(one.verdicts[k] for k in order)))
    found = BenchmarkResult(result.path, replace(result.document, name=name), result.suite)
    found.__dict__["answers"] = answers
    return found


def false_alarms(result: BenchmarkResult, repeats: int) -> dict[str, int]:
    """In how many of the repeats two shuffled methods are told apart, by measure."""
    counts: dict[str, int] = {}
    for k in range(repeats):
        rng = np.random.default_rng([7, k])
        pair = [shuffled(result, rng, name) for name in ("first", "second")]
        for measure, differences in compare_methods(pair).differences.items():
            counts[measure] = counts.get(measure, 0) + differences[0].is_significant
    return counts


def print_costs(result: BenchmarkResult) -> None:
    """Prints the time of the parts of a benchmark, and what is left as overhead."""
    times = result.document.times
    parts = times.rendering + times.planning + times.judging
    print(
        f"{result.document.name:12} {times.total:7.1f} s = rendering {times.rendering:.1f}"
        f" + planner {times.planning:.1f} + trials {times.judging:.1f} s; overhead"
        f" {100.0 * (times.total - parts) / times.total:.1f} %"
    )


def print_order(results: dict[str, BenchmarkResult]) -> None:
    """Prints whether the intervals of planners that follow one another overlap."""
    measures = {name: measure_all(one) for name, one in results.items()}
    for measure in ("top_success", "average_precision"):
        for better, worse in itertools.pairwise(PLANNERS):
            one, other = measures[better][measure], measures[worse][measure]
            apart = "apart" if one.low > other.high else "overlap"
            print(
                f"{measure:18} {better} {one.low:.2f}-{one.high:.2f}, {worse} {other.low:.2f}-"
                f"{other.high:.2f}: {apart}"
            )


def main() -> None:
    """Runs the planners and prints tables, costs, the order and false alarms."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("suites", nargs="+")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--shuffles", type=int, default=0)
    given = parser.parse_args()
    for suite in given.suites:
        results = {}
        for name in PLANNERS:
            folder = Path(given.output) / f"{suite}.{name}"
            settings = BenchmarkSettings(depth_only=True)
            results[name] = run_benchmark(suite, name, folder, settings=settings, progress=False)
        for table in all_tables(compare_by_suite(list(results.values()))):
            table.text_table().show()
        for result in results.values():
            print_costs(result)
        print_order(results)
        if given.shuffles:
            for name, result in results.items():
                for measure, count in false_alarms(result, given.shuffles).items():
                    print(f"{name}: {measure} differs in {count} of {given.shuffles} shuffles")


if __name__ == "__main__":
    main()
