"""Progress: rates, and lines where there is no terminal."""

from __future__ import annotations

from collections import Counter

import pytest

from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.progress import Progress, Reporter


def test_rate_and_time_left_count_from_when_the_clock_started() -> None:
    event = Progress("judging", done=60, total=100, before=40, elapsed=10.0)
    assert event.rate == 2.0
    assert event.remaining == 20.0
    assert Progress("judging", done=1, total=100, before=1, elapsed=0.0).remaining is None


def test_without_a_terminal_there_is_a_line_now_and_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = [100.0]
    monkeypatch.setattr("burg_drake.evaluation.progress.time.monotonic", lambda: clock[0])
    outcomes = Counter({Outcome.LIFTED: 3, Outcome.SIMULATION_FAILED: 1})
    with Reporter(True) as reporter:
        reporter.show(Progress("sampling"))
        for done in range(1, 101):
            clock[0] += 0.125
            elapsed = clock[0] - 100
            reporter.show(Progress("judging", done, 100, elapsed=elapsed, outcomes=outcomes))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "sampling"
    assert lines[2] == "judging  41/100 grasps  8.0/s  0:00:07 left  3 lifted, 1 failed"
    assert lines[-1].startswith("judging  100/100 grasps")
    assert len(lines) == 5


def test_quiet_is_quiet_and_functions_get_everything(capsys: pytest.CaptureFixture[str]) -> None:
    events: list[Progress] = []
    for progress in (False, events.append):
        with Reporter(progress) as reporter:
            reporter.show(Progress("judging", 1, 2))
            reporter.show(Progress("judging", 2, 2))
    assert [e.done for e in events] == [1, 2]
    assert capsys.readouterr() == ("", "")
