"""Work that this process does itself, or several at a time in worker processes."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, as_completed
from typing import TypeVar

from burg_drake.core.workers.pool import WorkerPool

Work = TypeVar("Work")
Result = TypeVar("Result")


def map_unordered(
    function: Callable[[Work], Result], work: Sequence[Work], workers: int
) -> Generator[tuple[Work, Result | BaseException], None, None]:
    """Results of a function as they come; one that fails does not end the others.

    Args:
        function: importable where there are several workers.
        work: its arguments, begun in this order.
        workers: number of processes; with one, or one piece of work, this process does it. What
            ends its worker is not tried again.

    Yields:
        The argument, and the result or the error. Closing the iterator ends the workers, with the
        processes that they have started.
    """
    count = min(workers, len(work))
    if count <= 1:
        for item in work:
            yield item, _outcome(function, item)
        return
    pool = WorkerPool(count, retries=0, own_group=True)
    try:
        futures: dict[Future[Result], Work] = {pool.submit(function, item): item for item in work}
        for future in as_completed(futures):
            error = future.exception()
            yield futures[future], future.result() if error is None else error
    finally:
        pool.kill_workers()


def _outcome(function: Callable[[Work], Result], item: Work) -> Result | BaseException:
    try:
        return function(item)
    except Exception as error:
        return error
