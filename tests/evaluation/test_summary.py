"""Counts, intervals and the tables that a terminal gets."""

from __future__ import annotations

import dataclasses
import io
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from known_judge import JUDGE_FACTORY, CrashingJudge, Make, expected
from rich.console import Console

from burg_drake.core import Outcome, Stage, format_duration, wilson_interval
from burg_drake.evaluation import (
    EvaluationSettings,
    OutcomeCounts,
    Run,
    evaluate,
    summarize,
    summary_view,
)


@pytest.fixture
def run(known_run: Run, known_judge: None) -> Run:
    return known_run


def test_counts_are_those_of_the_known_judge(run: Run) -> None:
    summary = summarize(run)
    assert [g.name for g in summary.objects] == ["cube", "bar"]
    ids = run.candidates.id
    assert summary.total.outcomes[Outcome.LIFTED_DISTURBED] > 0
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


def test_held_is_more_than_success(run: Run) -> None:
    total = summarize(run).total
    held = sum(expected(id).held for id in run.candidates.id)
    lifted = sum(expected(id) is Outcome.LIFTED for id in run.candidates.id)
    assert 0 < lifted < held
    assert (total.held, total.lifted) == (held, lifted)
    assert (total.funnel["held"], total.funnel["lifted"]) == (held, lifted)
    assert total.interval == wilson_interval(lifted, total.executed)


def test_counts_never_rise_along_the_stages(run: Run) -> None:
    summary = summarize(run)
    for group in (*summary.objects, summary.total):
        counts = list(group.funnel.values())
        assert counts == sorted(counts, reverse=True)
        assert counts[0] == group.judged == sum(group.outcomes.values())


def test_a_failed_simulation_is_neither_executed_nor_lost_from_the_counts(
    scene, station, tmp_path: Path, judged_here: None, monkeypatch, run: Run
) -> None:
    judge = Make(CrashingJudge(how=((run.candidates.id[0], "error"),)))
    monkeypatch.setattr(JUDGE_FACTORY, lambda *_: judge)
    failed = evaluate(
        scene,
        station,
        tmp_path / "f",
        settings=EvaluationSettings(grasps_per_object=3, blind=True),
        workers=1,
        progress=False,
    )
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
    assert row[1:8] == [str(n) for n in summarize(run).objects[0].funnel.values()]


def test_names_of_objects_are_whole_at_80_columns(run: Run) -> None:
    """With counts as wide as their heads, and the widest share and interval."""
    summary = summarize(run)
    lifted = Counter({Outcome.LIFTED: 99_000, Outcome.DROPPED: 999})
    name = "screwdriver_14"
    group = OutcomeCounts(name, 99_999, lifted, Counter({Stage.EXECUTED: 99_999}), Counter())
    objects = (*summary.objects, group)
    stream = io.StringIO()
    view = summary_view(dataclasses.replace(summary, objects=objects))
    Console(file=stream, width=80).print(view)
    lines = stream.getvalue().splitlines()
    assert any(line.split()[:2] == [name, "99,999"] for line in lines)
    assert max(map(len, lines)) <= 80
    assert all(line == line.rstrip() for line in lines)


def test_a_single_object_goes_by_its_name(run: Run) -> None:
    summary = summarize(run)
    stream = io.StringIO()
    view = summary_view(dataclasses.replace(summary, objects=summary.objects[:1]))
    Console(file=stream, width=80).print(view)
    heads = [line.split()[0] for line in stream.getvalue().splitlines() if line]
    assert "cube" in heads and "all" not in heads


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
    texts = [format_duration(s) for s in (0.25, 0.0021, 3.5e-5, 12.34, 5000.0, np.nan)]
    assert texts == ["250 ms", "2.1 ms", "35 µs", "12.3 s", "5,000 s", "-"]
