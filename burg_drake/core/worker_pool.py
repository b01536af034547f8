"""A pool of worker processes for evaluating grasps, building libraries and rendering images.

`WorkerPool` is an executor like those of `concurrent.futures`: `submit` returns a future, `map`
returns results in order, and the `with` block ends the processes::

    from burg_drake.core import WorkerPool
    from my_images import render  # def render(number: int) -> Image

    with WorkerPool() as pool:
        for number, image in enumerate(pool.map(render, range(100))):
            image.save(f"{number:03d}.png")

Workers are fresh interpreters connected by a pipe. They are never forked, as Drake would crash, and
do not import the program's main module, so that scripts and notebooks need no guard. Functions must
therefore be defined in a module that can be imported.

**Sessions.** An object that is expensive to build (a scene with its renderer, a judge) is built
once in each worker and passed to every task of the session as first argument. A worker keeps the
last two sessions::

    scene = Session("kitchen", partial(SceneRenderer, "kitchen.yaml"))
    futures = [pool.submit_task(Task(render_view, (X_WC,), session=scene)) for X_WC in poses]

**Progress.** A task may call `report_progress(message)`; `Task.on_progress` is called with each
message, in a thread of the pool. Outside a worker it does nothing.

**Crashes, hangs, memory.** A worker that dies (a crash inside Drake, a `TimeLimit`, lack of memory)
does not affect other tasks. Its task is retried alone in a fresh process; if that dies too, the
future raises `WorkerDied`, which gives the cause and whether it came from outside. A task that
exceeded its time limit is not retried. A session whose building ends its worker fails after
`Session.attempts`.

**Ending.** Leaving the `with` block waits for running tasks. Leaving it by an exception such as
Ctrl-C ends the workers at once (`kill_workers`). Workers ignore keyboard interrupts and end when
their parent does, even if that is killed. `WorkerFuture.interrupt` ends one task at its next
progress report, `WorkerFuture.terminate` at once.

`map_unordered` runs work in this process if there is one worker, `Prefetcher` computes results
ahead, and `start_worker` starts a process for other uses, such as a node of a cluster.
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from typing import Any, Generic, TypeVar

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.worker import Task, WorkerFuture
from burg_drake.core.worker_dispatch import Dispatcher, PendingTask, Worker
from burg_drake.core.worker_processes import worker_count

T = TypeVar("T")


class WorkerPool(Executor):
    """Worker processes that run tasks, in any order; each is started when there is work for it."""

    def __init__(
        self,
        workers: int | None = None,
        *,
        retries: int = 1,
        own_group: bool = False,
    ) -> None:
        """Creates a pool without starting processes.

        Args:
            workers: largest number of processes; the number of processors if None.
            retries: number of retries of a task whose worker dies.
            own_group: whether each worker leads a process group, so that its child processes end
                with it; signals from a terminal then do not reach it.

        Raises:
            InvalidInputError: workers is below 1.
        """
        self.workers = worker_count(workers)
        self._retries = retries
        self._workers = [Worker(k, own_group) for k in range(self.workers)]
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._dispatcher: Dispatcher | None = None
        self._closed = False

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> WorkerFuture[T]:
        """Calls a function in a worker; see `concurrent.futures.Executor.submit`.

        Raises:
            RuntimeError: the pool was shut down.
        """
        return self.submit_task(Task(fn, args, kwargs))

    def submit_task(self, task: Task[T]) -> WorkerFuture[T]:
        """Runs a task in a worker.

        Raises:
            RuntimeError: the pool was shut down.
        """
        return self.submit_tasks([task])[0]

    def submit_tasks(
        self, tasks: Sequence[Task[T]], worker: int | None = None
    ) -> list[WorkerFuture[T]]:
        """Sends tasks together to one worker, which runs them one after the other.

        Args:
            tasks: tasks of the same session.
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
                self._dispatcher = Dispatcher(self._workers)
            dispatcher = self._dispatcher
            pending = deque(self._make_pending(task, dispatcher) for task in tasks)
            if pending:
                dispatcher.add_batch(pending, worker)
        return [task.future for task in pending]

    def sessions(self, worker: int) -> tuple[str, ...]:
        """Keys of the sessions that a worker has built; most recently used last."""
        return tuple(self._workers[worker].sessions.copy())

    @property
    def processes(self) -> list[int]:
        """Identifiers of the running processes."""
        found = [worker.process for worker in self._workers]
        return [process.pid for process in found if process is not None]

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accepts no more tasks, and ends the workers when all tasks are done.

        Args:
            wait: wait until the workers have ended.
            cancel_futures: cancel tasks that no worker has.
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
            timeout: longest time to wait for their end [s].
        """
        with self._lock:
            self._closed = True
            dispatcher = self._dispatcher
        if dispatcher is not None:
            dispatcher.kill()
            dispatcher.join(timeout)

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if error is None:
            self.shutdown()
        else:
            self.kill_workers()

    def _make_pending(self, task: Task[T], dispatcher: Dispatcher) -> PendingTask:
        retries = self._retries if task.retries is None else task.retries
        future = WorkerFuture[T](dispatcher.end_task)
        return PendingTask(next(self._numbers), task, future, 1 + retries)


Work = TypeVar("Work")
Result = TypeVar("Result")


class Prefetcher(Generic[Work, Result]):
    """Computes results in the order of the work, a few of them in advance."""

    def __init__(
        self,
        pool: WorkerPool,
        work: Iterable[Work],
        task: Callable[[Work], Task[Result]],
    ) -> None:
        """Creates a prefetcher without starting work.

        Args:
            pool: pool of the workers; its creator ends it.
            work: pieces of work, consumed as needed.
            task: function that makes the task for a piece of work.
        """
        self._pool, self._work, self._task = pool, iter(work), task
        self._submitted: deque[tuple[Work, WorkerFuture[Result]]] = deque()

    def ready(self) -> bool:
        """Whether `take` returns without waiting."""
        self._fill()
        return not self._submitted or self._submitted[0][1].done()

    def take(self) -> tuple[Work, Result | BaseException] | None:
        """Waits for the next work and its result or error; None at the end."""
        self._fill()
        if not self._submitted:
            return None
        work, future = self._submitted.popleft()
        error = future.exception()
        self._fill()
        return work, future.result() if error is None else error

    def _fill(self) -> None:
        n_missing = 2 * self._pool.workers - len(self._submitted)
        for work in itertools.islice(self._work, max(0, n_missing)):
            self._submitted.append((work, self._pool.submit_task(self._task(work))))


def map_unordered(
    function: Callable[[Work], Result],
    work: Sequence[Work],
    workers: int,
    check: Callable[[Work], object] | None = None,
) -> Generator[tuple[Work, Result | BaseException], None, None]:
    """Yields results of a function in order of completion; an error does not stop the others.

    Args:
        function: the function; importable if there are several workers.
        work: its arguments, started in this order.
        workers: number of processes; with one, or one piece of work, this process does it. Work
            that ends its worker is not retried.
        check: called with all arguments before the first call of the function. Its error is the
            result for that argument.

    Yields:
        The argument, and the result or the error. Closing the iterator ends the workers, with the
        processes that they have started.
    """
    count = min(workers, len(work))
    pool = WorkerPool(count, retries=0, own_group=True) if count > 1 else None
    try:
        if check is not None:
            failed = set()
            for index, item, outcome in _completed_work(check, work, pool):
                if isinstance(outcome, BaseException):
                    failed.add(index)
                    yield item, outcome
            work = [item for index, item in enumerate(work) if index not in failed]
        for _, item, outcome in _completed_work(function, work, pool):
            yield item, outcome
    finally:
        if pool is not None:
            pool.kill_workers()


def _completed_work(
    function: Callable[[Work], Result], work: Sequence[Work], pool: WorkerPool | None
) -> Iterator[tuple[int, Work, Result | BaseException]]:
    """Yields index, argument and result of each piece of work in order of completion."""
    if pool is None:
        for index, item in enumerate(work):
            yield index, item, _run_item(function, item)
        return
    indices: dict[Future[Result], int] = {
        pool.submit(function, item): index for index, item in enumerate(work)
    }
    for future in as_completed(indices):
        error, index = future.exception(), indices[future]
        yield index, work[index], future.result() if error is None else error


def _run_item(function: Callable[[Work], Result], item: Work) -> Result | BaseException:
    try:
        return function(item)
    except Exception as error:
        return error
