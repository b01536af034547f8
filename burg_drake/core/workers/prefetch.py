"""Work done ahead, in processes of its own, in order: while a result is used, the next ones come.

Each process does every n-th piece of work, and has one more waiting; what does not fit into its
pipe makes it wait, so that it is never far ahead.
"""

from __future__ import annotations

import contextlib
import subprocess
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from burg_drake.core.errors import SimulationError, WorkerEnded
from burg_drake.core.workers.processes import cause_of_death, start_worker, was_ended_from_outside

Work = TypeVar("Work")
WAITING = 2
"""Pieces of work that a process has at a time."""


@dataclass(eq=False)
class OrderedWorker:
    """A process that does pieces of work in the order in which they are given.

    Attributes:
        module: its `main(handle)` calls `crew.serve`.
        first: work that prepares it, whose result is not asked for.
    """

    module: str
    first: object
    _given: deque[object] = field(default_factory=deque)
    _process: subprocess.Popen[bytes] | None = None
    _connection: Connection | None = None

    def give(self, work: object) -> None:
        """Gives it work; it is started if need be."""
        self._given.append(work)
        if self._connection is None:
            self._start()
        else:
            self._send(work)

    @property
    def waiting(self) -> int:
        """Pieces of work whose results have not been taken."""
        return len(self._given)

    def ready(self) -> bool:
        """Whether a result can be taken at once."""
        return bool(self._given) and self._connection is not None and self._connection.poll()

    def take(self) -> tuple[Any, Any]:
        """The oldest work and its result, or an error; waits for it. A process that died is
        replaced for the rest."""
        assert self._process is not None and self._connection is not None
        try:
            result = self._connection.recv()
        except (EOFError, OSError):
            kind = WorkerEnded if was_ended_from_outside(self._process) else SimulationError
            result = kind(cause_of_death(self._process))
            work = self._given.popleft()
            self._connection.close()
            self._process = self._connection = None
            if self._given:
                self._start()
            return work, result
        return self._given.popleft(), result

    def end(self) -> None:
        """Ends the process; what it is at is lost."""
        if self._process is not None and self._connection is not None:
            self._process.kill()
            self._process.wait()
            self._connection.close()
            self._process = self._connection = None
        self._given.clear()

    def _start(self) -> None:
        self._process, self._connection = start_worker(self.module)
        self._send(self.first)
        with contextlib.suppress(EOFError, OSError):  # told when a result is taken
            self._connection.recv()
        for work in self._given:
            self._send(work)

    def _send(self, work: object) -> None:
        assert self._connection is not None
        with contextlib.suppress(OSError):  # it has died, which is told when a result is taken
            self._connection.send(work)


class Prefetcher(Generic[Work]):
    """Results of work in its order, a few of them ahead."""

    def __init__(self, work: Iterable[Work], module: str, first: object, count: int) -> None:
        """Begins nothing yet.

        Args:
            work: asked for as needed.
            module: see `OrderedWorker`.
            first: likewise.
            count: of processes, 1 or more.
        """
        self._work = iter(work)
        self._processes = [OrderedWorker(module, first) for _ in range(count)]
        self._given = self._taken = 0

    def ready(self) -> bool:
        """Whether `take` returns at once."""
        self._give()
        return self._taken == self._given or self._next.ready()

    def take(self) -> tuple[Work, Any] | None:
        """The next work and what came of it, which may be an error; None when there is no more.
        Waits for it."""
        self._give()
        if self._taken == self._given:
            return None
        found = self._next.take()
        self._taken += 1
        self._give()
        return found

    @property
    def _next(self) -> OrderedWorker:
        return self._processes[self._taken % len(self._processes)]

    def _give(self) -> None:
        count = len(self._processes)
        while self._given - self._taken < WAITING * count:
            for work in self._work:
                self._processes[self._given % count].give(work)
                self._given += 1
                break
            else:
                return

    def end(self) -> None:
        """Ends the processes."""
        for process in self._processes:
            process.end()
