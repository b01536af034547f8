"""A worker of the pool as those see it who give it grasps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from burg_drake.core.grasps import Stage
from burg_drake.core.workers import WorkerFuture
from burg_drake.evaluation.workers.open_job import OpenJob
from burg_drake.evaluation.workers.worker import Grasp


@dataclass(eq=False)
class GivenWork:
    """What a worker was given in one piece.

    Attributes:
        slot: the worker.
        job: what it belongs to.
        grasps: one to be judged, some to be screened, or none to build the judge.
        screening: whether they are screened.
        future: what becomes of it.
        stage: the last one that began.
    """

    slot: WorkerSlot
    job: OpenJob
    grasps: tuple[Grasp, ...]
    screening: bool = False
    future: WorkerFuture[Any] | None = None
    stage: Stage = Stage.CLEAR

    def begins(self, stage: Stage) -> None:
        """A stage begins."""
        self.stage = stage


@dataclass(eq=False)
class WorkerSlot:
    """A worker.

    Attributes:
        number: in the pool.
        job: what it works on, or did last.
        given: what it was given and has not done yet.
        started: whether it was given anything yet.
    """

    number: int
    job: OpenJob | None = None
    given: list[GivenWork] = field(default_factory=list)
    started: bool = False

    @property
    def busy(self) -> bool:
        """Whether it has something to do."""
        return bool(self.given)
