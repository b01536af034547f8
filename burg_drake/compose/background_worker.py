"""A worker process for tasks that take long. A new task replaces the one before it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Generic, TypeVar

from burg_drake.core import (
    BurgError,
    SimulationError,
    Task,
    TaskCancelled,
    WorkerDied,
    WorkerFuture,
    WorkerPool,
    report_progress,
)

T = TypeVar("T")

ProgressCallback = Callable[..., None]
"""Takes a task's progress: the share that is done in [0, 1], a word for people and, if there is
one, a partial result. Raises `TaskCancelled` if nobody waits for the result."""

BackgroundTask = Callable[[ProgressCallback], T]
"""What a worker does: a dataclass that can be pickled, as can its result. It raises a `BurgError`
if it cannot be done."""


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
        cancel: Callable[[BackgroundJob[T]], None],
        on_change: Callable[[BackgroundJob[T]], None],
    ) -> None:
        self.progress: tuple[float, str] = (0.0, "waiting")
        self.partial: Any = None
        self.cancelled = False
        self.error: BurgError | None = None
        self.done = False
        self._cancel, self._on_change = cancel, on_change
        self._result: list[T] = []
        self._finished = threading.Event()
        self._future: WorkerFuture[T] | None = None

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
        if not self._finished.wait(timeout):
            raise TimeoutError(f"nothing after {timeout:g} s")
        return self.result

    def cancel(self) -> None:
        """Ends it; nothing if it is done."""
        self._cancel(self)

    def report(self, message: tuple[float, str, Any]) -> None:
        """The worker has told its progress, a word, and what came of it."""
        if not self.cancelled:
            share, word, self.partial = message
            self.progress = (share, word)
            self._on_change(self)

    def finish(self, result: T | BurgError) -> None:
        """It is done."""
        if isinstance(result, BurgError):
            self.error = result
        else:
            self._result.append(result)
        self.done = True
        self._on_change(self)
        self._finished.set()


class BackgroundWorker:
    """One process, started with the first task, that does what it was asked last."""

    def __init__(self) -> None:
        self._pool = WorkerPool(1, retries=0)
        self._lock = threading.Lock()
        self._newest: BackgroundJob[Any] | None = None

    @property
    def process(self) -> int | None:
        """Identifier of the process, if it was started."""
        return next(iter(self._pool.processes), None)

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
        job = BackgroundJob(self.cancel, on_change)
        with self._lock:
            older, self._newest = self._newest, job
            try:
                job._future = self._pool.submit_task(
                    Task(run_task_in_worker, (task,), on_progress=job.report)
                )
            except RuntimeError:  # it was closed
                job.cancelled = True
        if older is not None and not older.done and older._future is not None:
            older.cancelled = True
            older._future.interrupt()
        if job._future is None:
            job.finish(TaskCancelled("this was cancelled"))
        else:
            job._future.add_done_callback(
                lambda future: job.finish(_job_result_or_error(job, future))
            )
        return job

    def cancel(self, job: BackgroundJob[Any]) -> None:
        """See `BackgroundJob.cancel`."""
        with self._lock:
            if job.done or job.cancelled or job._future is None:
                return
            job.cancelled = True
        job._future.terminate()

    def close(self) -> None:
        """Ends the process."""
        with self._lock:
            if self._newest is not None:
                self._newest.cancelled = True
        self._pool.kill_workers(5.0)  # seconds that the process has to end


def run_task_in_worker(task: BackgroundTask[T]) -> T:
    """Does a task in a worker.

    Raises:
        BurgError: it cannot be done.
    """

    def report(share: float, word: str, partial: Any = None) -> None:
        report_progress((share, word, partial))

    try:
        return task(report)
    except BurgError:
        raise
    except (Exception, SystemExit) as error:  # Drake ends some failed checks by SystemExit
        raise _failure_of(error) from error


def _job_result_or_error(job: BackgroundJob[Any], future: Future[Any]) -> Any:
    """The result of a job, or why there is none."""
    if job.cancelled or future.cancelled():
        job.cancelled = True
        return TaskCancelled("this was cancelled")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, WorkerDied):
        return SimulationError(f"{error}; the scene was not changed, try again")
    return error if isinstance(error, BurgError) else _failure_of(error)


def _failure_of(error: BaseException) -> SimulationError:
    return SimulationError(f"this failed: {' '.join(str(error).split()) or type(error).__name__}")
