"""A process beside the session for what takes long: it does what was asked last."""

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Generic, Protocol, TypeVar

from burg_drake.core import BurgError, SimulationError
from burg_drake.core.workers import cause_of_death, start_worker

Result = TypeVar("Result", covariant=True)
T = TypeVar("T")


class ProgressCallback(Protocol):
    """How a task tells how far it is; it raises `Cancelled` if nobody waits for the result."""

    def __call__(self, share: float, word: str, partial: Any = None) -> None:
        """Tells it.

        Args:
            share: of the work that is done, in [0, 1].
            word: for people.
            partial: what came of it since the last report.
        """


class BackgroundTask(Protocol[Result]):
    """What a worker does: a dataclass that can be pickled, as can what it gives."""

    def __call__(self, report: ProgressCallback) -> Result:
        """Does it.

        Args:
            report: tells how far it is.

        Raises:
            BurgError: it cannot be done.
        """


class BackgroundJob(Generic[T]):
    """Something that was asked of a worker.

    Attributes:
        progress: share that is done, in [0, 1], and a word.
        partial: what came of it since the report before, if it tells.
        cancelled: nobody waits for it any more.
        done: it has a result or an error, or was cancelled.
        error: why it has no result; None if it has, or is not done.
    """

    def __init__(
        self,
        worker: BackgroundWorker,
        task: BackgroundTask[T],
        on_change: Callable[[BackgroundJob[T]], None],
    ) -> None:
        self.progress: tuple[float, str] = (0.0, "waiting")
        self.partial: Any = None
        self.cancelled = False
        self.error: BurgError | None = None
        self.done = False
        self.task = task
        self._worker, self._on_change = worker, on_change
        self._result: list[T] = []
        self._notify = threading.Event()

    @property
    def result(self) -> T:
        """What came of it, once it is done.

        Raises:
            BurgError: it cannot be done, or was cancelled.
        """
        if self.error is not None:
            raise self.error
        return self._result[0]

    def wait(self, timeout: float | None = None) -> T:
        """The result, when it is there and who listens has been told.

        Args:
            timeout: [s].

        Raises:
            TimeoutError: it is not there by then.
            BurgError: it cannot be done, or was cancelled.
        """
        if not self._notify.wait(timeout):
            raise TimeoutError(f"nothing after {timeout:g} s")
        return self.result

    def cancel(self) -> None:
        """Ends it; nothing if it is done."""
        self._worker.cancel(self)

    def report(self, share: float, word: str, partial: Any) -> None:
        """The worker is so far."""
        self.progress, self.partial = (share, word), partial
        self._on_change(self)

    def finish(self, result: T | BurgError) -> None:
        """It is done."""
        if isinstance(result, BurgError):
            self.error = result
        else:
            self._result.append(result)
        self.done = True
        self._on_change(self)
        self._notify.set()


class Cancelled(BurgError):
    """Nobody waits for a result any more."""


@dataclass(frozen=True)
class _Report:
    share: float
    word: str
    partial: Any


@dataclass(frozen=True)
class _Stop:
    """What the worker process does, nobody waits for any more."""


class BackgroundWorker:
    """One process, started with the first task, that does what it was asked last."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._waiting: BackgroundJob[Any] | None = None
        self._running: BackgroundJob[Any] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._thread: threading.Thread | None = None
        self._closed = False

    def submit(
        self,
        task: BackgroundTask[T],
        on_change: Callable[[BackgroundJob[T]], None] = lambda job: None,
    ) -> BackgroundJob[T]:
        """Asks for something; what it was asked before is cancelled, if that is not done.

        Args:
            task: what to do.
            on_change: called with the job when it is further or done, in a thread of the worker.
        """
        job = BackgroundJob(self, task, on_change)
        with self._changed:
            older, self._waiting = self._waiting, job
            if self._running is not None and not self._running.cancelled:
                self._running.cancelled = True
                self._send(_Stop())
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, daemon=True)
                self._thread.start()
            self._changed.notify()
        if older is not None:
            _cancel_job(older)
        return job

    def cancel(self, job: BackgroundJob[Any]) -> None:
        """See `BackgroundJob.cancel`."""
        with self._changed:
            if job.done or job.cancelled:
                return
            job.cancelled = True
            if job is self._waiting:
                self._waiting = None
            elif job is self._running and self._process is not None:
                self._process.kill()
                return  # its thread sees that, and finishes the job
        _cancel_job(job)

    def close(self) -> None:
        """Ends the process."""
        with self._changed:
            self._closed = True
            if self._waiting is not None:
                self._waiting.cancelled = True
            if self._running is not None:
                self._running.cancelled = True
            if self._process is not None:
                self._process.kill()
            self._changed.notify()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=5.0)

    def _serve(self) -> None:
        while True:
            with self._changed:
                while self._waiting is None and not self._closed:
                    self._changed.wait()
                job, self._waiting = self._waiting, None
                closed = self._closed
                self._running = job
            if closed or job is None:
                self._end()
                if job is not None:
                    _cancel_job(job)
                return
            result = self._run_job(job)
            with self._changed:
                self._running = None
            job.finish(result)

    def _run_job(self, job: BackgroundJob[Any]) -> Any:
        """The result of a job, or why there is none."""
        try:
            if self._connection is None:
                process, connection = start_worker("burg_drake.compose.background.process")
                with self._changed:
                    self._process, self._connection = process, connection
            connection = self._connection
            assert connection is not None
            with self._changed:
                if job.cancelled:
                    return _cancelled()
                connection.send(job.task)
            while True:
                message = connection.recv()
                if not isinstance(message, _Report):
                    return _cancelled() if job.cancelled else message
                if not job.cancelled:
                    job.report(message.share, message.word, message.partial)
        except (EOFError, OSError):
            cause = "no worker process can be started"
            if self._process is not None:
                cause = cause_of_death(self._process)
            self._end()
            if job.cancelled:
                return _cancelled()
            return SimulationError(f"{cause}; the scene is as it was, try again")

    def _send(self, message: object) -> None:
        with contextlib.suppress(OSError):  # it has died; its thread finds out
            if self._connection is not None:
                self._connection.send(message)

    def _end(self) -> None:
        with self._changed:
            process, connection = self._process, self._connection
            self._process = self._connection = None
        if connection is not None:
            connection.close()
        if process is not None:
            process.kill()
            process.wait()


def _cancel_job(job: BackgroundJob[Any]) -> None:
    job.cancelled = True
    job.finish(_cancelled())


def _cancelled() -> Cancelled:
    return Cancelled("this was cancelled")


def main(handle: int) -> None:
    """Runs a worker until its parent closes the pipe.

    Args:
        handle: file descriptor of this end of the pipe.
    """
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    connection = Connection(handle)
    try:
        while True:
            task = connection.recv()
            if not isinstance(task, _Stop):  # one that came too late
                connection.send(_result(task, connection))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the parent is gone
    os._exit(0)


def _result(task: BackgroundTask[Any], connection: Connection) -> Any:
    def report(share: float, word: str, partial: Any = None) -> None:
        if connection.poll():
            raise _cancelled()
        connection.send(_Report(share, word, partial))

    try:
        return task(report)
    except BurgError as error:
        return error
    except (Exception, SystemExit) as error:  # Drake ends some failed checks by SystemExit
        return SimulationError(
            f"this failed: {' '.join(str(error).split()) or type(error).__name__}"
        )
