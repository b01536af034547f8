"""A pool of worker processes, as an executor of `concurrent.futures`; see the package."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from types import TracebackType
from typing import Any, TypeVar

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.workers.dispatcher import Dispatcher
from burg_drake.core.workers.processes import worker_count
from burg_drake.core.workers.tasks import Task, WorkerFuture
from burg_drake.core.workers.worker_process import PendingTask, Worker

T = TypeVar("T")


class WorkerPool(Executor):
    """Worker processes that do tasks, in any order; each is started when there is work for it."""

    def __init__(
        self,
        workers: int | None = None,
        *,
        retries: int = 1,
        kept_sessions: int = 2,
        own_group: bool = False,
    ) -> None:
        """Starts nothing yet.

        Args:
            workers: number of processes at most; as many as there are processors if None.
            retries: how often a task is tried again whose worker dies.
            kept_sessions: how many sessions a worker keeps; more would take memory.
            own_group: whether each worker leads a group of processes, so that what it starts ends
                with it; then what a terminal sends to the program's group does not reach it.

        Raises:
            InvalidInputError: workers is below 1.
        """
        self.workers = worker_count(workers)
        self._retries = retries
        self._places = [Worker(k, max(1, kept_sessions), own_group) for k in range(self.workers)]
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._dispatcher: Dispatcher | None = None
        self._closed = False

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> WorkerFuture[T]:
        """Has a function called in a worker; see `concurrent.futures.Executor.submit`.

        Raises:
            RuntimeError: the pool was shut down.
        """
        return self.submit_task(Task(fn, args, kwargs))

    def submit_task(self, task: Task[T]) -> WorkerFuture[T]:
        """Has a task done, with all that `Task` can say about it.

        Raises:
            RuntimeError: the pool was shut down.
        """
        return self.submit_tasks([task])[0]

    def submit_tasks(
        self, tasks: Sequence[Task[T]], worker: int | None = None
    ) -> list[WorkerFuture[T]]:
        """Has tasks done by one worker, one after the other: they travel together.

        Args:
            tasks: of the same session.
            worker: number of the worker in the pool; any if None.

        Raises:
            RuntimeError: the pool was shut down.
            InvalidInputError: the tasks are of several sessions.
        """
        if len({task.session for task in tasks}) > 1:
            raise InvalidInputError("tasks that are sent together must belong to the same session")
        with self._lock:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            if self._dispatcher is None:
                self._dispatcher = Dispatcher(self._places)
            dispatcher = self._dispatcher
            pending = deque(self._pending(task, dispatcher) for task in tasks)
            if pending:
                dispatcher.put(pending, worker)
        return [task.future for task in pending]

    def map(
        self,
        fn: Callable[..., T],
        *iterables: Iterable[Any],
        timeout: float | None = None,
        chunksize: int = 1,
    ) -> Iterator[T]:
        """Results of a function in the order of its arguments; see `Executor.map`.

        Args:
            fn: the function.
            iterables: of its arguments.
            timeout: from now until each result [s].
            chunksize: so many calls travel together; 1 is best for those of more than some
                milliseconds.
        """
        tasks = [Task(fn, args) for args in zip(*iterables, strict=False)]
        starts = range(0, len(tasks), max(1, chunksize))
        chunks = [self.submit_tasks(tasks[k : k + starts.step]) for k in starts]
        end = None if timeout is None else time.monotonic() + timeout
        return _results(deque(itertools.chain.from_iterable(chunks)), end)

    def sessions(self, worker: int) -> tuple[str, ...]:
        """Keys of the sessions that a worker has built; used last comes last."""
        return tuple(self._places[worker].sessions.copy())

    @property
    def processes(self) -> list[int]:
        """Identifiers of the processes that there are."""
        found = [place.process for place in self._places]
        return [process.pid for process in found if process is not None]

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Takes no more tasks, and ends the workers when all are done.

        Args:
            wait: until then.
            cancel_futures: whether tasks that no worker has are given up.
        """
        with self._lock:
            self._closed = True
            dispatcher = self._dispatcher
        if dispatcher is None:
            return
        if cancel_futures:
            dispatcher.cancel_waiting()
        dispatcher.close()
        if wait:
            dispatcher.join()

    def kill_workers(self, timeout: float | None = None) -> None:
        """Ends the workers at once; tasks that are not done raise `TaskCancelled`.

        Args:
            timeout: how long to wait until they have ended [s].
        """
        with self._lock:
            self._closed = True
            dispatcher = self._dispatcher
        if dispatcher is not None:
            dispatcher.kill()
            dispatcher.join(timeout)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.shutdown()
        else:
            self.kill_workers()

    def _pending(self, task: Task[T], dispatcher: Dispatcher) -> PendingTask:
        retries = self._retries if task.retries is None else task.retries
        future = WorkerFuture[T](dispatcher.end_task)
        return PendingTask(next(self._numbers), task, future, 1 + retries)


def _results(futures: deque[WorkerFuture[T]], end: float | None) -> Iterator[T]:
    try:
        while futures:
            left = None if end is None else end - time.monotonic()
            yield futures.popleft().result(left)
    finally:
        for future in futures:
            future.cancel()
