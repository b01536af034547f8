"""Coverage of the intervals of `burg-drake compare`, and how long a million rows take.

    python benchmarks/compare.py coverage [--repeats 400]
    python benchmarks/compare.py speed [RUN RUN] [--rows 1000000]
    python benchmarks/compare.py area [--rows 1000000]
    python benchmarks/compare.py standing-out [--repeats 400]

`coverage` draws trials from populations whose figures are known, as `trials plan` chooses them (so
many of each object from those that were predicted to be lifted, and from the others), and counts
how often the 95 % interval of each figure holds the one of the whole population: for all grasps by
the Bayesian bootstrap within strata that the package uses, next to drawing the trials of each
stratum anew (percentiles), and to Wilson's interval with the effective number of trials. Outcomes
of the trials are random, as reality is: the true figures are those of an endless series.

`speed` times everything that follows on reading, on columns of so many rows, and the comparison of
two runs on the disk; wall time, and CPU time in brackets.

`area` measures by how much the area under the ROC curve changes where trials with neighbouring
numbers share a row, as they do beyond `ordered.FINEST` different ones.

`standing-out` counts in how many made-up experiments `compare` names an object or a cause: where
all verdicts are wrong equally often (false alarms), and where predicted successes of one object
fail more often than those of the others.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from burg_drake.core import Array, wilson_interval
from burg_drake.experiment import (
    AGREEMENT_MEASURES,
    PREDICTION_COLUMNS,
    PREDICTOR_COLUMNS,
    REFERENCE_COLUMNS,
    IdColumn,
    OrderedTrials,
    ResultTable,
    TextFactor,
    VerdictPairs,
    _compute_measures,
    assess_judge,
    assess_run_agreement,
    compare,
    estimate_agreement,
    estimate_auroc,
    find_outlier_groups,
    interval_bounds,
    match_rows,
    pair_runs,
)
from burg_drake.experiment.comparison import margin_calibration

FIGURES = (
    "precision",
    "recall",
    "specificity",
    "f1",
    "accuracy",
    "matthews",
    "kappa",
    "actual",
    "excess",
)


def main() -> None:
    """Runs a benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(required=True)
    covered = verbs.add_parser("coverage")
    covered.add_argument("--repeats", type=int, default=400)
    covered.set_defaults(run=coverage)
    speedy = verbs.add_parser("speed")
    speedy.add_argument("runs", nargs="*", metavar="RUN")
    speedy.add_argument("--rows", type=int, default=1_000_000)
    speedy.set_defaults(run=speed)
    joined = verbs.add_parser("area")
    joined.add_argument("--rows", type=int, default=1_000_000)
    joined.set_defaults(run=area)
    outstanding = verbs.add_parser("standing-out")
    outstanding.add_argument("--repeats", type=int, default=400)
    outstanding.set_defaults(run=name_what_stands_out)
    arguments = parser.parse_args()
    arguments.run(arguments)


def coverage(arguments: argparse.Namespace) -> None:
    """Prints how often intervals hold the truth, and how wide they are."""
    rng = np.random.default_rng(0)
    for objects, each, right in (
        (1, 30, 0.7),
        (6, 5, 0.7),
        (6, 5, 0.95),
        (12, 3, 0.9),
        (6, 10, 0.85),
    ):
        _cover(objects, each, right, arguments.repeats, rng)
    _cover_ranking(arguments.repeats, rng)


def _cover(objects: int, each: int, right: float, repeats: int, rng: np.random.Generator) -> None:
    """One kind of population: its strata are of (object, predicted)."""
    held = {method: np.zeros(len(FIGURES)) for method in ("package", "resampled", "wilson")}
    wide = {method: np.zeros(len(FIGURES)) for method in held}
    for _ in range(repeats):
        population = rng.integers(30, 600, (objects, 2)).astype(float).ravel()
        chance = np.clip(rng.beta(right * 12, (1 - right) * 12, 2 * objects), 0.01, 0.99)
        truth = _figures(_cells(chance) * population[:, None])
        seen = rng.binomial(each, chance) / each
        counts = np.rint(_cells(seen) * each).astype(int)
        a = estimate_agreement(counts, population=population)
        mine = np.array(
            [[getattr(a.figure(n), e) for n in FIGURES] for e in ("low", "high")], float
        )
        others = _resampled(counts, population, rng), _wilson(counts, population)
        for method, (low, high) in zip(held, (mine, *others), strict=True):
            inside = (low - 1e-9 <= truth) & (truth <= high + 1e-9)
            held[method] += inside | np.isnan(truth)
            wide[method] += np.nan_to_num(high - low)
    print(f"{objects} objects, {each} a stratum, {right:g} right: coverage (mean width)")
    print(f"{'':12}" + "".join(f"{name:>16}" for name in FIGURES))
    for method in held:
        cells = zip(held[method] / repeats, wide[method] / repeats, strict=True)
        print(f"{method:12}" + "".join(f"{c:9.3f} ({w:.2f})" for c, w in cells))


def _cells(right: Array) -> Array:
    """(S, 4) shares of cells of strata that predict success and failure by turns."""
    cells = np.zeros((len(right), 4))
    cells[0::2, 0], cells[0::2, 1] = right[0::2], 1 - right[0::2]
    cells[1::2, 3], cells[1::2, 2] = right[1::2], 1 - right[1::2]
    return cells


def _figures(cells: Array) -> Array:
    every = dict(zip(AGREEMENT_MEASURES, _compute_measures(cells.sum(axis=0)), strict=True))
    return np.array([every[name] for name in FIGURES])


def _resampled(counts: Array, population: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Trials of each stratum drawn anew."""
    size = counts.sum(axis=1)
    drawn = np.stack(
        [
            rng.multinomial(n, c / n, 1000) * (w / n)
            for n, c, w in zip(size, counts, population, strict=True)
        ]
    ).sum(axis=0)
    low, high = interval_bounds(_compute_measures(drawn))
    order = [list(AGREEMENT_MEASURES).index(name) for name in FIGURES]
    return low[order], high[order]


def _wilson(counts: Array, population: Array) -> tuple[Array, Array]:
    """Wilson's interval with L. Kish's effective number of trials, for shares alone."""
    weight = population / counts.sum(axis=1)
    low, high = np.full(len(FIGURES), np.nan), np.full(len(FIGURES), np.nan)
    for k, name in enumerate(FIGURES):
        measure = AGREEMENT_MEASURES[name]
        if measure.is_share:
            part = (weight[:, None] * counts)[:, list(measure.part)].sum()
            whole = (weight[:, None] * counts)[:, list(measure.whole)].sum()
            squares = (weight[:, None] ** 2 * counts)[:, list(measure.whole)].sum()
            if whole:
                effective = whole**2 / squares
                low[k], high[k] = wilson_interval(part / whole * effective, effective)
    return low, high


def _cover_ranking(repeats: int, rng: np.random.Generator) -> None:
    """Intervals of the area under the ROC curve of normal numbers, some of them rounded."""
    from scipy.stats import norm

    print("AUROC: coverage (mean width)")
    for trials, shift, digits in ((20, 0.5, 9), (60, 1.0, 9), (60, 2.0, 9), (60, 1.0, 0)):
        held = wide = 0.0
        far = rng.normal(size=200_000)
        truth = float(norm.cdf(shift / np.sqrt(2)))
        if digits < 9:
            a, b = np.round(far[::2] + shift, digits), np.round(far[1::2], digits)
            truth = float((a > b).mean() + (a == b).mean() / 2)
        for _ in range(repeats):
            good = rng.random(trials) < 0.3
            values = np.round(rng.normal(size=trials) + shift * good, digits)
            found = estimate_auroc(OrderedTrials.of(values, good))
            if found.low is not None and found.high is not None:
                held += found.low <= truth <= found.high
                wide += found.high - found.low
        print(f"  {trials} trials, true {truth:.2f}: {held / repeats:.3f} ({wide / repeats:.2f})")


def name_what_stands_out(arguments: argparse.Namespace) -> None:
    """Prints how often objects and causes are named, rightly and wrongly."""
    rng = np.random.default_rng(0)
    print("objects  of each  wrong  of one object   false alarms   it is named")
    for objects, each in ((6, 5), (6, 10), (6, 20), (12, 5), (12, 10)):
        for wrong, planted in ((0.05, 0.5), (0.05, 0.8), (0.2, 0.6), (0.2, 0.8), (0.4, 0.8)):
            false, power = 0, 0
            for _ in range(arguments.repeats):
                found, _ = find_outlier_groups(_made_up_trials(objects, each, wrong, wrong, rng))
                false += bool(found)
                found, _ = find_outlier_groups(_made_up_trials(objects, each, wrong, planted, rng))
                power += any((one.kind, one.name) == ("object", "0") for one in found)
            rates = (f"{100 * n / arguments.repeats:.1f} %" for n in (false, power))
            print(f"{objects:7} {each:8} {wrong:6} {planted:14}", *(f"{r:>14}" for r in rates))


def _made_up_trials(
    objects: int, each: int, wrong: float, planted: float, rng: np.random.Generator
) -> VerdictPairs:
    """Trials of so many predicted successes and failures of each object, whose verdicts are wrong
    so often; of predicted successes of object 0 another share.

    Returns:
        Predicted failures have three verdicts, two of them with one of three bodies in the way.
    """
    index = np.repeat(np.arange(objects), 2 * each)
    predicted = np.tile(np.repeat([True, False], each), objects)
    chance = np.where(predicted & (index == 0), planted, wrong)
    actual = predicted ^ (rng.random(len(index)) < chance)
    verdicts = rng.choice(["slipped", "collision_table", "collision_clutter"], len(index))
    bodies = rng.choice(["a", "b", "c"], len(index))
    simulated = np.where(predicted, "lifted", verdicts)
    none = TextFactor.of(np.full(len(index), ""))
    return VerdictPairs(
        id=IdColumn(np.arange(len(index)).astype(str)),
        run=none,
        scene=none,
        object=TextFactor.of(index.astype(str)),
        simulated=TextFactor.of(simulated),
        stage=none,
        blocker=TextFactor.of(np.where(predicted | (verdicts == "slipped"), "", bodies)),
        judged_again=none,
        confidence=np.full(len(index), np.nan),
        ended=TextFactor.of(np.where(actual, "lifted", "slipped")),
        predicted=predicted,
        actual=actual,
        margins={},
    )


def speed(arguments: argparse.Namespace) -> None:
    """Prints wall times."""
    columns = _made_up(arguments.rows, 0)
    outcomes = np.random.default_rng(5).permutation(columns["outcome"])
    first = ResultTable.of_columns(columns, PREDICTION_COLUMNS)
    tables = first, ResultTable.of_columns(columns | {"outcome": outcomes}, REFERENCE_COLUMNS)
    with _timed(f"{arguments.rows} rows in memory"):
        with _timed("  matching"):
            found = match_rows(*tables)
        with _timed("  pairs"):
            pairs, second, _ = pair_runs(tables, found, "lifted")
        with _timed("  figures"):
            assess_judge(pairs, scenes={})
        with _timed("  agreement"):
            assess_run_agreement(pairs, second, {}, [])
    if len(arguments.runs) == 2:
        with _timed("runs on the disk"):
            c = compare(*arguments.runs)
        print(f"{c.coverage.compared} grasps compared")


def area(arguments: argparse.Namespace) -> None:
    """Prints the largest change of the area and of its interval, for normal and skewed numbers
    that tell nothing to nearly all, and frequent to rare successes."""
    rng = np.random.default_rng(0)
    finest = margin_calibration.MAX_ORDERED_ROWS
    for rows in (finest + 1000, 5 * finest, arguments.rows):
        worst = np.zeros(3)
        for shift in (0.0, 0.5, 2.0, 5.0):
            for share in (0.5, 0.05, 0.002):
                good = rng.random(rows) < share
                values = rng.normal(size=rows) + shift * good
                for numbers in (values, np.minimum(np.exp(3 * values), 2.0)):
                    found = []
                    for margin_calibration.MAX_ORDERED_ROWS in (finest, rows):
                        f = estimate_auroc(OrderedTrials.of(numbers, good))
                        found.append(np.array([f.value, f.low, f.high], dtype=float))
                    worst = np.maximum(worst, np.abs(found[0] - found[1]))
        print(f"{rows} rows: area {worst[0]:.1e}, interval {worst[1:].max():.1e}")


@contextmanager
def _timed(what: str) -> Iterator[None]:
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    print(f"{what}: {time.perf_counter() - wall:.2f} s ({time.process_time() - cpu:.2f})")


def _made_up(rows: int, seed: int) -> dict[str, Array]:
    """A table like that of a run over a thousand scenes."""
    rng = np.random.default_rng(seed)
    objects = np.array(["mug", "bowl", "box", "bottle", "banana", "screwdriver"])
    outcomes = np.array(["lifted", "slipped", "collision_table", "collision_target", "no_ik"])
    stages = np.array(["executed", "executed", "clear", "clear", "reachable"])
    ended = rng.integers(0, 5, rows)
    which = rng.integers(0, 6, rows)
    scenes = np.array([f"{k:012x}" for k in range(1000)])
    columns: dict[str, Array] = {
        "scene_content": np.repeat(scenes, -(-rows // 1000))[:rows],
        "id": np.array([f"{objects[k]}-{i:010x}" for i, k in enumerate(which.tolist())]),
        "object": objects[which],
        "outcome": outcomes[ended],
        "stage": stages[ended],
        "blocker": np.where(ended == 2, "table", ""),
        "run": np.repeat(scenes, -(-rows // 1000))[:rows],
        "judged_again": np.full(rows, ""),
        "confidence": np.where(ended > 1, np.nan, rng.uniform(0.5, 1.0, rows)),
    }
    for name in ("x", "y", "z", "qw", "qx", "qy", "qz", "width"):
        columns[name] = rng.normal(size=rows)
    for name in PREDICTOR_COLUMNS:
        values = rng.normal(size=rows)
        values[ended > 1] = np.nan  # what is stopped before its trial has no such margin
        columns[name] = values if name not in ("clearance", "score") else rng.normal(size=rows)
    return columns


if __name__ == "__main__":
    main()
