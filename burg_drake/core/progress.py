"""Progress of a job: events for programs, a bar for terminals, occasional lines for log files."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

from burg_drake.core.number_text import format_number
from burg_drake.core.outcomes import Outcome

STARTING_PHASE = "starting"
"""Phase in which workers are set up; takes seconds at best."""

Clock = Callable[[], float]
"""Returns the time [s], from any origin."""


@dataclass(frozen=True)
class Progress:
    """State of a job.

    Attributes:
        phase: current phase, such as `sampling` or `judging`.
        done, total: finished and total number of results; the total is 0 if unknown.
        before: number of results before the clock was started.
        elapsed: time since the clock was started [s].
        outcomes: number of grasps by outcome.
        counted_outcome: the outcome to display.
        unit: unit of the results.
        left: expected time left [s], if known better than from `done` and `total`.
        note: additional note.
    """

    phase: str
    done: float = 0
    total: float = 0
    before: float = 0
    elapsed: float = 0.0
    outcomes: Counter[Outcome] | None = None
    counted_outcome: Outcome = Outcome.LIFTED
    unit: str = "grasps"
    left: float | None = None
    note: str = ""

    @property
    def rate(self) -> float:
        """Results per second; 0 if unknown."""
        return (self.done - self.before) / self.elapsed if self.elapsed > 0.0 else 0.0

    @property
    def remaining(self) -> float | None:
        """Expected time left [s]; None if unknown."""
        if self.left is not None:
            return self.left
        known = self.total > 0 and self.rate > 0.0
        return (self.total - self.done) / self.rate if known else None


Listener = Callable[[Progress], None]
"""Called with the progress at each change."""


class ProgressMeter:
    """Counts results and emits progress events."""

    def __init__(
        self,
        show: Listener,
        event: Progress,
        phase: str | None = None,
        *,
        work: float | None = None,
        clock: Clock = time.monotonic,
    ) -> None:
        """Shows a first event.

        Args:
            show: called with the events.
            event: first event; its `done` counts earlier results.
            phase: phase from the first result on. That result starts the clock, as setting up takes
                its own time, and does not count for the rate. If None, the clock starts now.
            work: total work of all results, in any unit, if they differ in cost.
            clock: returns the time.
        """
        self._show, self._clock = show, clock
        self._phase = event.phase if phase is None else phase
        self._event = replace(event, before=event.done)
        self._started = clock() if phase is None else None
        self._work, self._worked = work, 0.0
        show(self._event)

    def step(
        self, count: float = 1, *, work: float = 0.0, outcome: Outcome | None = None, note: str = ""
    ) -> None:
        """Counts results.

        Args:
            count: number of results.
            work: their work, in the unit of the total `work`.
            outcome: outcome of a grasp.
            note: see `Progress`.
        """
        if self._started is None:
            self._work = None if self._work is None else self._work - work
            self._restart_clock(count, outcome, note)
            return
        self._worked += work
        elapsed, left = self._clock() - self._started, self._event.left
        if self._work is None:
            left = None
        elif self._worked > 0.0:
            left = (self._work / self._worked - 1.0) * elapsed
        self._event = replace(self._event, elapsed=elapsed, left=left)
        self._add_results(count, outcome, note)

    def skip(self, count: float = 1, *, note: str = "") -> None:
        """Counts results without cost, and measures the rate of the others from now on."""
        self._restart_clock(count, None, note)

    def expect(self, total: float) -> None:
        """Updates the total number of results."""
        self._event = replace(self._event, total=total)

    def _restart_clock(self, count: float, outcome: Outcome | None, note: str) -> None:
        self._started = self._clock()
        self._event = replace(self._event, before=self._event.done + count, elapsed=0.0)
        self._add_results(count, outcome, note)

    def _add_results(self, count: float, outcome: Outcome | None, note: str) -> None:
        done, outcomes = self._event.done + count, self._event.outcomes
        if outcome is not None and outcomes is not None:
            outcomes[outcome] += 1
        self._event = replace(self._event, phase=self._phase, done=done, note=note)
        self._show(self._event)


class Reporter(AbstractContextManager["Reporter"]):
    """Shows progress on standard error, or passes it to a function."""

    def __init__(self, progress: bool | Listener, *, clock: Clock = time.monotonic) -> None:
        """`progress`: True shows it, False is silent, a function gets every event."""
        self._close: Callable[[], None] = lambda: None
        if callable(progress):
            self._show: Listener = progress
        elif not progress:
            self._show = lambda event: None
        elif sys.stderr.isatty():
            bar = _ProgressBar()
            self._show, self._close = bar.show, bar.close
        else:
            self._show = _LogLines(clock).show

    def show(self, event: Progress) -> None:
        """Shows an event."""
        self._show(event)

    def __exit__(self, *_: object) -> None:
        self._close()


class _ProgressBar:
    """A bar with counts, rate and time left."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress as RichProgress, TextColumn, TimeElapsedColumn

        self._bar: Any = RichProgress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[count]}"),
            TextColumn("{task.fields[pace]}"),
            TimeElapsedColumn(),
            TextColumn("[dim]{task.fields[found]}"),
            console=Console(stderr=True),
        )
        self._task = self._bar.add_task("starting", total=None, count="", pace="", found="")
        self._bar.start()

    def show(self, event: Progress) -> None:
        self._bar.update(
            self._task,
            description=event.phase,
            completed=event.done,
            total=event.total or None,
            count=_count_text(event),
            pace=_rate_text(event),
            found=_outcome_text(event),
        )

    def close(self) -> None:
        self._bar.stop()


class _LogLines:
    """A line at each change of phase, once the time left is known, every half minute from then on,
    and at the end; jobs of a few seconds only have the line at the start."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._start_time = self._last_time = clock()
        self._phase = ""
        self._forecast_shown = self._any_shown = False

    def show(self, event: Progress) -> None:
        min_elapsed = 5.0  # Seconds after which the remaining time is shown.
        now = self._clock()
        has_forecast = event.remaining is not None and (
            event.left is not None or event.elapsed >= min_elapsed
        )
        new_phase = event.phase != self._phase
        starting = new_phase and event.phase == STARTING_PHASE and event.done < event.total
        if (
            not (self._any_shown or has_forecast or starting)
            and now - self._start_time < min_elapsed
        ):
            return
        forecast_shown = self._forecast_shown and not new_phase
        finished = 0 < event.total == event.done
        due = new_phase or finished or now - self._last_time >= 30.0
        if due or (has_forecast and not forecast_shown):
            self._phase, self._last_time = event.phase, now
            self._any_shown = self._any_shown or not starting
            self._forecast_shown = forecast_shown or has_forecast
            parts = (event.phase, _count_text(event), _rate_text(event), _outcome_text(event))
            print("  ".join(part for part in parts if part), file=sys.stderr, flush=True)


def _count_text(event: Progress) -> str:
    if not event.total:
        return f"{_number_text(event.done)} {event.unit}" if event.done else ""
    return f"{_number_text(event.done)}/{_number_text(event.total)} {event.unit}"


def _number_text(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:.1f}"


def _rate_text(event: Progress) -> str:
    if event.remaining is None:
        return ""
    left = math.ceil(event.remaining)
    clock = f"{left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"
    if event.rate <= 0.0:
        return clock
    slow = event.rate < 1.0
    rate = f"{format_number(60.0 * event.rate)}/min" if slow else f"{format_number(event.rate)}/s"
    return f"{rate}  {clock}"


def _outcome_text(event: Progress) -> str:
    """Short summary of the outcomes so far, as a terminal has no room for all of them."""
    if not event.outcomes:
        return event.note
    failed = event.outcomes[Outcome.SIMULATION_FAILED]
    found = f"{event.outcomes[event.counted_outcome]:,} {event.counted_outcome}"
    found += f", {failed} failed" if failed else ""
    return f"{found}  {event.note}" if event.phase == STARTING_PHASE and event.note else found
