"""What tests of benchmarks share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from typing import Any

import pytest

from burg_drake.core import Task, WorkerPool


class PoolHere(Executor):
    """Takes the place of a `WorkerPool` with one worker: works in this process."""

    workers = 1

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future

    def submit_task(self, task: Task[Any]) -> Future[Any]:
        return self.submit(task.function, *task.args)


@pytest.fixture(scope="module")
def benchmarked_here(judged_here: None) -> Iterator[None]:
    """Benchmarks with one worker render, store and judge in this process; planners have theirs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "burg_drake.benchmark.benchmark_run.WorkerPool",
            lambda workers: PoolHere() if workers == 1 else WorkerPool(workers),
        )
        yield
