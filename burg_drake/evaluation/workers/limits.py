"""How long a worker process may take, and how often it may die."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

TOO_LONG = (signal.SIGPROF, signal.SIGALRM)
"""Signals by which a process ends itself that takes longer than it may: CPU time, wall time."""


@dataclass(frozen=True)
class WorkerLimits:
    """Limits of an executor.

    Attributes:
        cpu: CPU time for one grasp, or one screening [s]. A trial takes about a second, the slowest
            ones some tens. On a busy machine it takes longer, but not more CPU time.
        build: CPU time to build a judge [s].
        wall: wall time for each of these [s]; ends what waits for ever.
        hopeless: so many grasps of a job in a row that end their workers, with none judged in
            between, end the job.
        false_starts: so many workers in a row that die while they build the judge of a job end it.
    """

    cpu: float = 300.0
    build: float = 1800.0
    wall: float = 3600.0
    hopeless: int = 50
    false_starts: int = 2


@contextmanager
def time_limit(cpu: float, wall: float) -> Iterator[None]:
    """Ends this process by one of `TOO_LONG` if it does not leave the block in time.

    The system does so, also where native code does not let the interpreter run, and where nobody
    else is left to do it.

    Args:
        cpu, wall: CPU and wall time [s].
    """
    signal.setitimer(signal.ITIMER_PROF, cpu)
    signal.setitimer(signal.ITIMER_REAL, wall)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def let_time_limits_end_this_process() -> None:
    """Undoes what a parent may have set: its children inherit which signals are ignored."""
    for number in TOO_LONG:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TOO_LONG)
