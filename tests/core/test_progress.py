"""Progress: rates, time left, and lines where there is no terminal."""

from __future__ import annotations

from collections import Counter

import pytest

from burg_drake.core import Outcome, Progress, ProgressMeter, Reporter

Capture = pytest.CaptureFixture[str]


class Clock:
    """Time that passes when it is told to."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_rate_and_time_left_count_from_when_the_clock_started() -> None:
    event = Progress("judging", done=60, total=100, before=40, elapsed=10.0)
    assert event.rate == 2.0
    assert event.remaining == 20.0
    assert Progress("judging", done=1, total=100, before=1, elapsed=0.0).remaining is None


def test_setting_up_does_not_count() -> None:
    """Ten results are known from before, the first new one takes long to come."""
    clock, events = Clock(), list[Progress]()
    pace = ProgressMeter(events.append, Progress("starting", 10, 31), "judging", clock=clock)
    clock.now += 100.0
    pace.step()
    assert events[-1].remaining is None
    for _ in range(10):
        clock.now += 2.0
        pace.step()
    assert [e.phase for e in events] == ["starting"] + 11 * ["judging"]
    assert (events[-1].done, events[-1].rate, events[-1].remaining) == (21, 0.5, 20.0)


def test_work_that_differs_is_weighed() -> None:
    """Two hard questions of 10 s, the rest of 1 s: by their number there would be 18 s left."""
    clock, events = Clock(), list[Progress]()
    expected = Progress("starting", total=21, left=60.0)
    pace = ProgressMeter(events.append, expected, "testing", work=9 * 10.0 + 12.0, clock=clock)
    assert events[-1].remaining == 60.0
    for cost in (1.0, 1.0, 1.0, 10.0):
        clock.now += cost
        pace.step(work=cost)
    assert events[-1].remaining == pytest.approx(9 * 10.0 + 12.0 - 13.0)


def test_what_costs_nothing_does_not_make_the_rest_look_cheap() -> None:
    clock, events = Clock(), list[Progress]()
    pace = ProgressMeter(events.append, Progress("building", total=50), clock=clock)
    pace.skip(40, note="cached")
    clock.now += 30.0
    pace.step(note="mug built")
    assert (events[-1].done, events[-1].remaining) == (41, 9 * 30.0)


def test_without_a_terminal_there_is_a_line_every_half_minute(capsys: Capture) -> None:
    clock = Clock()
    outcomes = Counter({Outcome.SIMULATION_FAILED: 1})
    with Reporter(True, clock=clock) as reporter:
        reporter.show(Progress("sampling"))
        clock.now += 6.0
        event = Progress("starting", total=1000, outcomes=outcomes)
        pace = ProgressMeter(reporter.show, event, "judging", clock=clock)
        for _ in range(1000):
            clock.now += 0.125
            pace.step(outcome=Outcome.LIFTED)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "starting  0/1,000 grasps  0 lifted, 1 failed",
        "judging  1/1,000 grasps  1 lifted, 1 failed",
        "judging  41/1,000 grasps  8/s  0:02:00 left  41 lifted, 1 failed",  # within seconds
        "judging  281/1,000 grasps  8/s  0:01:30 left  281 lifted, 1 failed",
        "judging  521/1,000 grasps  8/s  0:01:00 left  521 lifted, 1 failed",
        "judging  761/1,000 grasps  8/s  0:00:30 left  761 lifted, 1 failed",
        "judging  1,000/1,000 grasps  8/s  0:00:00 left  1,000 lifted, 1 failed",
    ]


def test_what_ends_within_seconds_says_that_it_is_starting(capsys: Capture) -> None:
    clock = Clock()
    with Reporter(True, clock=clock) as reporter:
        pace = ProgressMeter(reporter.show, Progress("starting", total=4), "judging", clock=clock)
        for _ in range(4):
            clock.now += 1.0
            pace.step()
    assert capsys.readouterr().err == "starting  0/4 grasps\n"


def test_what_is_done_already_says_nothing(capsys: Capture) -> None:
    with Reporter(True, clock=Clock()) as reporter:
        ProgressMeter(reporter.show, Progress("starting", 4, 4), "judging")
        reporter.show(Progress("building", 1, 2))
    assert capsys.readouterr().err == ""


def test_slow_work_is_told_by_the_minute(capsys: Capture) -> None:
    clock = Clock()
    with Reporter(True, clock=clock) as reporter:
        event = Progress("building", total=3, unit="objects", left=75.0)
        pace = ProgressMeter(reporter.show, event, clock=clock)
        clock.now += 40.0
        pace.step(note="mug built")
    assert capsys.readouterr().err.splitlines() == [
        "building  0/3 objects  0:01:15 left",
        "building  1/3 objects  1.5/min  0:01:20 left  mug built",
    ]


def test_quiet_is_quiet_and_functions_get_everything(capsys: Capture) -> None:
    events: list[Progress] = []
    for progress in (False, events.append):
        with Reporter(progress) as reporter:
            reporter.show(Progress("judging", 1, 2))
            reporter.show(Progress("judging", 2, 2))
    assert [e.done for e in events] == [1, 2]
    assert capsys.readouterr() == ("", "")
