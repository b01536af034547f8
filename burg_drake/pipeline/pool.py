"""Builds objects in this process, or several at a time in worker processes.

A worker that dies (native code that meets a mesh it cannot bear) takes its one object with it, and
is replaced.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from burg_drake.core.errors import BurgError, SimulationError
from burg_drake.core.processes import cause_of_death, start_worker
from burg_drake.pipeline.keys import StageKeys
from burg_drake.pipeline.source import ObjectSource
from burg_drake.pipeline.stages import Built, build_object


@dataclass(frozen=True)
class Work:
    """An object to build.

    Attributes:
        source: what to build.
        keys: its stage keys.
        root: the library's folder.
        folder: where to build; made when the work begins.
        confirm: simulate the stable poses.
    """

    source: ObjectSource
    keys: StageKeys
    root: Path
    folder: Path
    confirm: bool


Outcome = Built | BaseException


def build_all(work: Sequence[Work], workers: int) -> Iterator[tuple[Work, Outcome]]:
    """Builds objects.

    Args:
        work: what to build; begun in this order.
        workers: number of processes; with one, or one object, this process does it.

    Yields:
        The work and what came of it or the reason why nothing did, in the order of completion.
        Closing the iterator ends the workers.
    """
    if min(workers, len(work)) <= 1:
        for item in work:
            yield item, attempt(item)
        return
    crew = [_Worker() for _ in range(min(workers, len(work)))]
    idle = list(crew)

    def by_worker(item: Work) -> Outcome:
        worker = idle.pop()
        try:
            return worker.attempt(item)
        finally:
            idle.append(worker)

    with ThreadPoolExecutor(len(crew)) as threads:
        futures = {threads.submit(by_worker, item): item for item in work}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            for worker in crew:
                worker.kill()


def attempt(item: Work) -> Outcome:
    """Builds one object; one broken mesh is one failure, whatever it broke."""
    try:
        item.folder.mkdir()
        return build_object(item.source, item.keys, item.root, item.folder, item.confirm)
    except Exception as error:
        return error
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        return SimulationError(f"Drake gave up: {error}")


class _Worker:
    """A process that builds objects one after the other; started when it is first needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._ended = False
        self._lock = threading.Lock()

    def attempt(self, item: Work) -> Outcome:
        process, connection = self._started()
        try:
            connection.send(item)
            outcome: Outcome = connection.recv()
            return outcome
        except (EOFError, OSError):
            with self._lock:
                self._process = self._connection = None
            connection.close()
            return SimulationError(cause_of_death(process))
        except Exception as error:  # such as a mesh that cannot be pickled
            return error

    def _started(self) -> tuple[subprocess.Popen[bytes], Connection]:
        with self._lock:
            if self._ended:
                raise EOFError
            if self._process is None or self._connection is None:
                self._process, self._connection = start_worker(__name__)
            return self._process, self._connection

    def kill(self) -> None:
        """Ends the process and what it started; the thread that waits for it cleans up."""
        with self._lock:
            self._ended = True
            if self._process is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self._process.pid, signal.SIGKILL)


def main(handle: int) -> None:
    """Runs a worker until the parent closes the pipe.

    Args:
        handle: file descriptor of this end of the pipe.
    """
    # A filter, because importing pydrake sets the logger's level back.
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    os.setpgid(0, 0)  # a group of its own, so that CoACD ends with it
    connection = Connection(handle)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            outcome = attempt(connection.recv())
            if isinstance(outcome, BaseException) and not isinstance(outcome, BurgError):
                # its class may not survive the pipe
                outcome = SimulationError(f"{type(outcome).__name__}: {outcome}")
            connection.send(outcome)
    os._exit(0)
