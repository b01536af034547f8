"""Scenes of a run over many, prepared and finished in this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from burg_drake.core import BurgError
from burg_drake.evaluation import (
    FinishTask,
    Preparer,
    PrepareTask,
    RunRequest,
    SceneOutputs,
    SceneResultsWriter,
)
from burg_drake.scene import Scene


class ScenesHere:
    """Takes the place of `SceneProcesses`."""

    def __init__(self, request: RunRequest, outputs: SceneOutputs, workers: int) -> None:
        self._preparer, self._finisher = Preparer(request), SceneResultsWriter(outputs)
        self._work: Iterator[PrepareTask] = iter(())

    def prepare(self, work: Iterable[PrepareTask]) -> None:
        self._work = iter(work)

    def ready(self) -> bool:
        return True

    def next_prepared(self) -> tuple[PrepareTask, Scene | BaseException | None] | None:
        for item in self._work:
            try:
                return item, self._preparer(item)
            except BurgError as error:
                return item, error
        return None

    def finish(self, name: str) -> None:
        self._finisher(FinishTask(name))

    def write_rows(self, name: str) -> None:
        self._finisher(FinishTask(name, judged=False))

    def close(self) -> None:
        self._finisher(None)

    def __enter__(self) -> ScenesHere:
        return self

    def __exit__(self, *error: object) -> None: ...
