"""How long a task may take: the process that takes longer is ended by the system."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

TOO_LONG = (signal.SIGPROF, signal.SIGALRM)
"""Signals by which a process ends itself that takes longer than it may: CPU time, wall time."""


@dataclass(frozen=True)
class TimeLimit:
    """What a task, or the building of a session, may take; imports before it do not count.

    Attributes:
        cpu: CPU time [s]; on a busy machine work takes longer, but not more CPU time.
        wall: wall time [s]; ends what waits for ever.
    """

    cpu: float
    wall: float


@contextmanager
def time_limit(limit: TimeLimit | None) -> Iterator[None]:
    """Ends this process by one of `TOO_LONG` if it does not leave the block in time.

    The system does so, also where native code does not let the interpreter run, and where nobody
    else is left to do it. Without a limit nothing is done.
    """
    if limit is None:
        yield
        return
    signal.setitimer(signal.ITIMER_PROF, limit.cpu)
    signal.setitimer(signal.ITIMER_REAL, limit.wall)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def restore_time_limit_signals() -> None:
    """Undoes what a parent may have set: its children inherit which signals are ignored."""
    for number in TOO_LONG:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TOO_LONG)
