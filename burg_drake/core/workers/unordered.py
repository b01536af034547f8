"""Work that this process does itself, or several at a time in worker processes."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, as_completed
from typing import TypeVar

from burg_drake.core.workers.pool import WorkerPool

Work = TypeVar("Work")
Result = TypeVar("Result")


def map_unordered(
    function: Callable[[Work], Result],
    work: Sequence[Work],
    workers: int,
    check: Callable[[Work], object] | None = None,
) -> Generator[tuple[Work, Result | BaseException], None, None]:
    """Results of a function as they come; one that fails does not end the others.

    Args:
        function: importable where there are several workers.
        work: its arguments, begun in this order.
        workers: number of processes; with one, or one piece of work, this process does it. What
            ends its worker is not tried again.
        check: is called with each argument before the function is with any. What it raises is the
            outcome of that argument.

    Yields:
        The argument, and the result or the error. Closing the iterator ends the workers, with the
        processes that they have started.
    """
    count = min(workers, len(work))
    pool = WorkerPool(count, retries=0, own_group=True) if count > 1 else None
    try:
        if check is not None:
            failed = set()
            for place, item, outcome in _outcomes(check, work, pool):
                if isinstance(outcome, BaseException):
                    failed.add(place)
                    yield item, outcome
            work = [item for place, item in enumerate(work) if place not in failed]
        for _, item, outcome in _outcomes(function, work, pool):
            yield item, outcome
    finally:
        if pool is not None:
            pool.kill_workers()


def _outcomes(
    function: Callable[[Work], Result], work: Sequence[Work], pool: WorkerPool | None
) -> Iterator[tuple[int, Work, Result | BaseException]]:
    """Place, argument and outcome of each piece of work as they come."""
    if pool is None:
        for place, item in enumerate(work):
            yield place, item, _outcome(function, item)
        return
    places: dict[Future[Result], int] = {
        pool.submit(function, item): place for place, item in enumerate(work)
    }
    for future in as_completed(places):
        error, place = future.exception(), places[future]
        yield place, work[place], future.result() if error is None else error


def _outcome(function: Callable[[Work], Result], item: Work) -> Result | BaseException:
    try:
        return function(item)
    except Exception as error:
        return error
