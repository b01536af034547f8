"""How far a run is: events for programs, a bar for terminals, a line now and then for log files."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from burg_drake.core.outcome import Outcome

PLAIN_INTERVAL = 5.0
"""Time between two lines where there is no terminal [s]."""


@dataclass(frozen=True)
class Progress:
    """State of a run.

    Attributes:
        phase: what is being done, such as `sampling` or `judging`.
        done, total: judged grasps, of how many.
        before: how many of `done` were judged before the clock was started.
        elapsed: time since then [s].
        outcomes: number of grasps by outcome.
        good: the outcome that is worth telling.
    """

    phase: str
    done: int = 0
    total: int = 0
    before: int = 0
    elapsed: float = 0.0
    outcomes: Counter[Outcome] | None = None
    good: Outcome = Outcome.LIFTED

    @property
    def rate(self) -> float:
        """Grasps a second; 0 as long as it is not known."""
        return (self.done - self.before) / self.elapsed if self.elapsed > 0.0 else 0.0

    @property
    def remaining(self) -> float | None:
        """Expected time left [s]; None as long as nothing is known."""
        return (self.total - self.done) / self.rate if self.rate > 0.0 else None


Listener = Callable[[Progress], None]


class Reporter(AbstractContextManager["Reporter"]):
    """Shows progress on standard error, or passes it to a function."""

    def __init__(self, progress: bool | Listener) -> None:
        """True shows it, False keeps quiet, a function gets every event."""
        self._close: Callable[[], None] = lambda: None
        if callable(progress):
            self._show: Listener = progress
        elif not progress:
            self._show = lambda event: None
        elif sys.stderr.isatty():
            bar = _Bar()
            self._show, self._close = bar.show, bar.close
        else:
            self._show = _Lines().show

    def show(self, event: Progress) -> None:
        """Takes an event."""
        self._show(event)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._close()


class _Bar:
    """A bar with counts, rate and time left."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as RichProgress

        self._bar: Any = RichProgress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[pace]}"),
            TimeElapsedColumn(),
            TextColumn("[dim]{task.fields[found]}"),
            console=Console(stderr=True),
        )
        self._task = self._bar.add_task("starting", total=None, pace="", found="")
        self._bar.start()

    def show(self, event: Progress) -> None:
        self._bar.update(
            self._task,
            description=event.phase,
            completed=event.done,
            total=event.total or None,
            pace=_pace(event),
            found=_found(event),
        )

    def close(self) -> None:
        self._bar.stop()


class _Lines:
    """A line at each change of phase, every few seconds, and at the end."""

    def __init__(self) -> None:
        self._phase = ""
        self._last = 0.0

    def show(self, event: Progress) -> None:
        now = time.monotonic()
        finished = 0 < event.total == event.done
        new = event.phase != self._phase
        if not (new or finished or now - self._last >= PLAIN_INTERVAL):
            return
        self._phase, self._last = event.phase, now
        parts = [event.phase]
        if event.total:
            parts += [f"{event.done}/{event.total} grasps", _pace(event), _found(event)]
        print("  ".join(part for part in parts if part), file=sys.stderr, flush=True)


def _pace(event: Progress) -> str:
    if event.remaining is None:
        return ""
    left = round(event.remaining)
    clock = f"{left // 3600}:{left // 60 % 60:02d}:{left % 60:02d}"
    return f"{event.rate:.1f}/s  {clock} left"


def _found(event: Progress) -> str:
    """What was found so far, in short: a terminal has no room for all outcomes."""
    if not event.outcomes:
        return ""
    failed = event.outcomes[Outcome.SIMULATION_FAILED]
    found = f"{event.outcomes[event.good]} {event.good}"
    return found + (f", {failed} failed" if failed else "")
