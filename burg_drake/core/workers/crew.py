"""A crew of worker processes that take one piece of work after the other.

A worker that dies (native code that meets what it cannot bear) takes its one piece of work with it,
and is replaced.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from burg_drake.core.errors import BurgError, SimulationError, WorkerEnded
from burg_drake.core.workers.processes import cause_of_death, start_worker, was_ended_from_outside

Work = TypeVar("Work")
Result = TypeVar("Result")


def work_through(
    work: Sequence[Work],
    workers: int,
    module: str,
    attempt: Callable[[Work], Result | BaseException],
) -> Iterator[tuple[Work, Result | BaseException]]:
    """Does pieces of work.

    Args:
        work: begun in this order; can be pickled where there are several workers.
        workers: number of processes; with one, or one piece, this process does it.
        module: its `main(handle)` calls `serve(handle, attempt)`.
        attempt: does one piece, and returns errors.

    Yields:
        The work and what came of it, in the order of completion. Closing the iterator ends the
        workers.
    """
    count = min(workers, len(work))
    if count <= 1:
        for item in work:
            yield item, attempt(item)
        return
    crew: list[_Worker[Work, Result]] = [_Worker(module) for _ in range(count)]
    idle = list(crew)

    def by_worker(item: Work) -> Result | BaseException:
        worker = idle.pop()
        try:
            return worker.attempt(item)
        finally:
            idle.append(worker)

    with ThreadPoolExecutor(count) as threads:
        futures = {threads.submit(by_worker, item): item for item in work}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            for worker in crew:
                worker.kill()


class _Worker(Generic[Work, Result]):
    """A process that does one piece of work after the other; started when it is first needed."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._ended = False
        self._lock = threading.Lock()

    def attempt(self, item: Work) -> Result | BaseException:
        process, connection = self._started()
        try:
            connection.send(item)
            outcome: Result | BaseException = connection.recv()
            return outcome
        except (EOFError, OSError):
            with self._lock:
                self._process = self._connection = None
            connection.close()
            kind = WorkerEnded if was_ended_from_outside(process) else SimulationError
            return kind(cause_of_death(process))
        except Exception as error:  # such as work that cannot be pickled
            return error

    def _started(self) -> tuple[subprocess.Popen[bytes], Connection]:
        with self._lock:
            if self._ended:
                raise EOFError
            if self._process is None or self._connection is None:
                self._process, self._connection = start_worker(self._module)
            return self._process, self._connection

    def kill(self) -> None:
        """Ends the process and what it started; the thread that waits for it cleans up."""
        with self._lock:
            self._ended = True
            if self._process is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self._process.pid, signal.SIGKILL)


def serve(handle: int, attempt: Callable[[Work], object]) -> None:
    """Does work that comes through a pipe until the parent closes it; ends the process.

    Args:
        handle: file descriptor of this end of the pipe.
        attempt: does one piece, and returns errors.
    """
    # A filter, because importing pydrake sets the logger's level back.
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    os.setpgid(0, 0)  # a group of its own, so that what it starts ends with it
    connection = Connection(handle)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            outcome = attempt(connection.recv())
            if isinstance(outcome, BaseException) and not isinstance(outcome, BurgError):
                # its class may not survive the pipe
                outcome = SimulationError(f"{type(outcome).__name__}: {outcome}")
            connection.send(outcome)
    os._exit(0)
