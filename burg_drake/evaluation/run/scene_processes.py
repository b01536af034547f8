"""The processes beside the workers: they prepare the next scenes, and finish those before."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from burg_drake.core import BurgError
from burg_drake.core.workers import OrderedWorker, Prefetcher
from burg_drake.evaluation.run.scene_tasks import (
    CloseParts,
    Finish,
    Finisher,
    Prepare,
    Preparer,
    SceneOutputs,
)
from burg_drake.scene.document import Scene

MODULE = "burg_drake.evaluation.run.scene_tasks"
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
        self._preparer, self._keeping = preparer, keeping
        self._count = preparers(workers)
        self._ahead: Prefetcher[Prepare] | None = None
        self._work: Iterator[Prepare] = iter(())
        self._side = OrderedWorker(MODULE, keeping) if self._count else None
        self._here = Finisher(keeping)
        self._used = False
        self._failed: list[Finish | CloseParts] = []

    def prepare(self, work: Iterable[Prepare]) -> None:
        """Says which scenes are to be prepared, in order."""
        self._work = iter(work)
        if self._count:
            self._ahead = Prefetcher(self._work, MODULE, self._preparer.request, self._count)

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
        if self._side is not None and self._used:
            self._side.give(CloseParts())
            while self._side.waiting:
                self._hear(self._side)
        for work in self._failed or (() if self._used else (CloseParts(),)):
            self._here(work)  # where it fails again it is an error
        if self._failed:
            self._here(CloseParts())

    def __enter__(self) -> SceneProcesses:
        return self

    def __exit__(self, *error: object) -> None:
        if self._ahead is not None:
            self._ahead.end()
        if self._side is not None:
            self._side.end()

    def _prepared_here(self, item: Prepare) -> Scene | BaseException | None:
        try:
            return self._preparer(item)
        except BurgError as error:
            return error

    def _give(self, work: Finish) -> None:
        if self._side is None:
            self._here(work)
            return
        self._used = True
        self._side.give(work)
        while self._side.ready():
            self._hear(self._side)

    def _hear(self, side: OrderedWorker) -> None:
        work, error = side.take()
        if error is not None:
            self._failed.append(work)
