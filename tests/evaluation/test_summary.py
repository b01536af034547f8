"""Counts, intervals and the tables that a terminal gets."""

from __future__ import annotations

import dataclasses
import io
import math
from pathlib import Path

import numpy as np
import pytest
from known_judge import CrashingJudge, Make, expected
from rich.console import Console

from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.cascade import evaluate
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.summary import (
    duration,
    rounded,
    summarize,
    summary_view,
    wilson_interval,
)


@pytest.fixture
def run(scene, station, tmp_path: Path, known_judge: None) -> Run:
    return evaluate(scene, station, tmp_path / "run", grasps_per_object=30, progress=False)


def test_wilson_interval_has_the_published_values() -> None:
    # R. G. Newcombe, Statistics in Medicine 17 (1998), Table I, method 3
    for successes, trials, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)


def test_wilson_interval_solves_its_equation() -> None:
    # the bounds are where the observed share is z standard errors away
    for successes, trials in ((1, 3), (7, 10), (999, 1000)):
        for p in wilson_interval(successes, trials):
            error = math.sqrt(p * (1 - p) / trials)
            assert abs(successes / trials - p) / error == pytest.approx(1.959964, abs=1e-5)
    assert wilson_interval(0, 0) == (0.0, 1.0)
    assert wilson_interval(5, 5)[1] == 1.0
    low, high = wilson_interval(3, 10)
    assert wilson_interval(7, 10) == pytest.approx((1 - high, 1 - low))


def test_counts_are_those_of_the_known_judge(run: Run) -> None:
    summary = summarize(run)
    assert [g.name for g in summary.objects] == ["cube", "bar"]
    ids = run.candidates.id
    for outcome in Outcome:
        count = sum(expected(id) is outcome for id in ids)
        assert summary.total.outcomes[outcome] == count
        assert sum(g.outcomes[outcome] for g in summary.objects) == count
    assert summary.objects[0].judged == 60  # two instances
    assert [c.name for c in summary.costs] == ["sampling", "clear", "reachable", "executed"]
    assert [c.grasps for c in summary.costs[1:]] == [
        90,
        summary.total.clear,
        summary.total.reachable,
    ]


def test_counts_never_rise_along_the_stages(run: Run) -> None:
    summary = summarize(run)
    for group in (*summary.objects, summary.total):
        counts = list(group.funnel.values())
        assert counts == sorted(counts, reverse=True)
        assert counts[0] == group.judged == sum(group.outcomes.values())


def test_a_failed_simulation_is_neither_executed_nor_lost_from_the_counts(
    scene, station, tmp_path: Path, known_judge: None, monkeypatch, run: Run
) -> None:
    judge = Make(CrashingJudge(how=((run.candidates.id[0], "error"),)))
    monkeypatch.setattr("burg_drake.evaluation.cascade.StationJudgeFactory", lambda *_: judge)
    failed = evaluate(scene, station, tmp_path / "f", grasps_per_object=30, progress=False)
    funnel = summarize(failed).total.funnel
    assert funnel["reachable"] - funnel["executed"] == 1


@pytest.mark.parametrize("width", [80, 120])
def test_the_terminal_shows_everything_in_whole_words(run: Run, width: int) -> None:
    stream = io.StringIO()
    Console(file=stream, width=width).print(summary_view(summarize(run)))
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    for word in ("cube", "bar", "all", "lifted", "collision_table", "reachable", "sampling"):
        assert word in text, word
    row = next(line.split() for line in text.splitlines() if line.split()[:1] == ["cube"])
    assert row[1:6] == [str(n) for n in summarize(run).objects[0].funnel.values()]


def test_many_objects_become_a_list(run: Run) -> None:
    summary = summarize(run)
    names = [f"{k:03d}_a_scanned_thing" for k in range(12)]
    many = tuple(dataclasses.replace(summary.objects[0], name=name) for name in names)
    stream = io.StringIO()
    Console(file=stream, width=80).print(summary_view(dataclasses.replace(summary, objects=many)))
    text = " ".join(stream.getvalue().split())
    assert text.count(f"{many[0].lifted} lifted") == 12
    assert all(name in text for name in names)


def test_numbers_are_written_for_people() -> None:
    texts = [duration(s) for s in (0.25, 0.0021, 3.5e-5, 12.34, 5000.0, np.nan)]
    assert texts == ["250 ms", "2.1 ms", "35 µs", "12.3 s", "5000 s", "-"]
    assert [rounded(v) for v in (0.01234, 4.4, 123456.0)] == ["0.0123", "4.4", "123000"]
