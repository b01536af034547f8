"""Who judges: jobs of grasps go in, verdicts come out in any order.

A job is what can be judged with one judge, such as the grasps of one scene. An executor has workers
that build a job's judge when they first need it, so that many jobs go through the same workers.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from burg_drake.core.grasps import Verdict
from burg_drake.core.workers import worker_count
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.workers.job import Job, OnFailure
from burg_drake.evaluation.workers.limits import WorkerLimits
from burg_drake.evaluation.workers.pool import JudgePool


class Executor(Protocol):
    """Judges jobs."""

    @property
    def workers(self) -> int:
        """Number of processes that judge."""
        ...

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """Judges all grasps of all jobs.

        Args:
            jobs: asked for one after the other, when workers run out of work. None says that no
                job is ready yet, and that there are others to work on meanwhile.
            on_failure: told of a job that cannot be done, such as one whose judge cannot be built;
                no more verdicts come for it, and the other jobs go on. If None, its error is
                raised.

        Yields:
            Each grasp with its verdict, in the order of completion. Closing the iterator ends the
            work.

        Raises:
            BurgError: a job cannot be done, and there is no `on_failure`; see `judge_all`.
        """
        ...


@dataclass(frozen=True)
class LocalExecutor:
    """Worker processes of this machine.

    Attributes:
        workers: their number.
        limits: what they may take.
    """

    workers: int
    limits: WorkerLimits = field(default_factory=WorkerLimits)

    def __post_init__(self) -> None:
        worker_count(self.workers)  # refuses what is below 1

    @classmethod
    def of_this_machine(
        cls, workers: int | None = None, limits: WorkerLimits | None = None
    ) -> LocalExecutor:
        """So many processes, one a processor if None; the usual limits if None.

        Raises:
            InvalidInputError: workers is below 1.
        """
        return cls(worker_count(workers), limits or WorkerLimits())

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """See `Executor.judge`."""
        pool = JudgePool(self.workers, self.limits)
        yield from pool.run(jobs, on_failure)
        pool.release()
