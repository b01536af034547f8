"""Results that are made ahead, in order: while one of them is used, the next ones come."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from burg_drake.core.workers.pool import WorkerPool
from burg_drake.core.workers.tasks import Task, WorkerFuture

Work = TypeVar("Work")
Result = TypeVar("Result")
AHEAD = 2
"""Results that are made ahead, or under way, for each worker."""


class Prefetcher(Generic[Work, Result]):
    """Results of work in its order, a few of them ahead."""

    def __init__(
        self, pool: WorkerPool, work: Iterable[Work], task: Callable[[Work], Task[Result]]
    ) -> None:
        """Begins nothing yet.

        Args:
            pool: whose workers do it; it is ended by who has made it.
            work: asked for as needed.
            task: what is to be done about a piece of work.
        """
        self._pool, self._work, self._task = pool, iter(work), task
        self._ahead: deque[tuple[Work, WorkerFuture[Result]]] = deque()

    def ready(self) -> bool:
        """Whether `take` returns at once."""
        self._fill()
        return not self._ahead or self._ahead[0][1].done()

    def take(self) -> tuple[Work, Result | BaseException] | None:
        """The next work and its result, or the error; None when there is no more. Waits for it."""
        self._fill()
        if not self._ahead:
            return None
        work, future = self._ahead.popleft()
        error = future.exception()
        self._fill()
        return work, future.result() if error is None else error

    def _fill(self) -> None:
        while len(self._ahead) < AHEAD * self._pool.workers:
            for work in self._work:
                self._ahead.append((work, self._pool.submit_task(self._task(work))))
                break
            else:
                return
