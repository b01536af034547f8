"""The processes beside the workers: they prepare the next scenes, and finish those before."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from functools import partial

from burg_drake.core import BurgError
from burg_drake.core.workers import Prefetcher, Session, Task, WorkerFuture, WorkerPool
from burg_drake.evaluation.run.scene_tasks import (
    CloseParts,
    Finish,
    Finisher,
    Prepare,
    Preparer,
    SceneOutputs,
    finish_scene,
    prepare_scene,
)
from burg_drake.scene.document import Scene

WORKERS_EACH = 16
"""So many workers are kept busy by one process that prepares scenes: sampling takes about a
thirtieth of the time of the trials."""


def preparers(workers: int) -> int:
    """How many processes prepare scenes; 0 would do it in this process. A cluster may have no
    workers yet."""
    return max(1, -(-workers // WORKERS_EACH))


class SceneProcesses:
    """What is done about scenes but judging; a context that ends its processes."""

    def __init__(self, preparer: Preparer, keeping: SceneOutputs, workers: int) -> None:
        """Starts nothing yet.

        Args:
            preparer: prepares scenes.
            keeping: what is kept of them.
            workers: that judge.
        """
        self._preparer = preparer
        self._count = preparers(workers)
        self._pools: list[WorkerPool] = []
        self._work: Iterator[Prepare] = iter(())
        self._ahead: Prefetcher[Prepare, Scene | None] | None = None
        self._finisher: WorkerPool | None = None
        self._finishing: deque[tuple[Finish | CloseParts, WorkerFuture[None]]] = deque()
        self._session = Session("finish", partial(Finisher, keeping))
        self._here = Finisher(keeping)
        self._used = False
        self._failed: list[Finish | CloseParts] = []
        if self._count:
            self._finisher = self._pool(1)

    def prepare(self, work: Iterable[Prepare]) -> None:
        """Says which scenes are to be prepared, in order."""
        self._work = iter(work)
        if self._count:
            session = Session("prepare", partial(Preparer, self._preparer.request))
            self._ahead = Prefetcher(
                self._pool(self._count),
                self._work,
                lambda item: Task(prepare_scene, (item,), session=session),
            )

    def ready(self) -> bool:
        """Whether `prepared` returns at once."""
        return self._ahead is None or self._ahead.ready()

    def prepared(self) -> tuple[Prepare, Scene | BaseException | None] | None:
        """The next scene whose run has been begun, or why it cannot be; without grasps its result
        is None. None when there are no more scenes."""
        if self._ahead is not None:
            return self._ahead.take()
        for item in self._work:
            return item, self._prepared_here(item)
        return None

    def finish(self, name: str) -> None:
        """Has table, report and rows of a judged scene written."""
        self._give(Finish(name))

    def take(self, name: str) -> None:
        """Has rows of a scene written that is being judged."""
        self._give(Finish(name, judged=False))

    def close(self) -> None:
        """Waits until all is written.

        Raises:
            BurgError: something cannot be written.
        """
        if self._finisher is not None and self._used:
            self._submit(self._finisher, CloseParts())
            self._collect_finished(wait=True)
        for work in self._failed or (() if self._used else (CloseParts(),)):
            self._here(work)  # where it fails again it is an error
        if self._failed:
            self._here(CloseParts())

    def __enter__(self) -> SceneProcesses:
        return self

    def __exit__(self, *error: object) -> None:
        for pool in self._pools:
            pool.kill_workers()

    def _pool(self, workers: int) -> WorkerPool:
        self._pools.append(WorkerPool(workers, retries=0, own_group=True))
        return self._pools[-1]

    def _prepared_here(self, item: Prepare) -> Scene | BaseException | None:
        try:
            return self._preparer(item)
        except BurgError as error:
            return error

    def _give(self, work: Finish) -> None:
        if self._finisher is None:
            self._here(work)
            return
        self._used = True
        self._submit(self._finisher, work)
        self._collect_finished(wait=False)

    def _submit(self, finisher: WorkerPool, work: Finish | CloseParts) -> None:
        task = Task(finish_scene, (work,), session=self._session)
        self._finishing.append((work, finisher.submit_task(task)))

    def _collect_finished(self, wait: bool) -> None:
        """Notes what could not be written, of what is finished, or of all when that is."""
        while self._finishing and (wait or self._finishing[0][1].done()):
            work, future = self._finishing.popleft()
            if future.exception() is not None:
                self._failed.append(work)
