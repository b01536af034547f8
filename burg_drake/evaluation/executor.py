"""Who judges: jobs of grasps go in, verdicts come out in any order.

A job is what can be judged with one judge, such as the grasps of one scene. An executor has workers
that build a job's judge when they first need it, so that many jobs go through the same workers.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Protocol

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.processes import default_workers
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.executors import judge_all
from burg_drake.evaluation.judge import Judge, Verdict


@dataclass(frozen=True, eq=False)
class Job:
    """Grasps that one judge judges.

    Attributes:
        key: names it among the jobs of a call.
        make_judge: builds the judge; pickled by reference, see `judge_all`.
        candidates: the grasps.
    """

    key: str
    make_judge: Callable[[], Judge]
    candidates: Sequence[Candidate]


class Executor(Protocol):
    """Judges jobs."""

    @property
    def workers(self) -> int:
        """Number of processes that judge."""
        ...

    def judge(self, jobs: Iterable[Job]) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """Judges all grasps of all jobs.

        Args:
            jobs: asked for one after the other, when workers run out of work.

        Yields:
            Each grasp with its verdict, in the order of completion. Closing the iterator ends the
            work.

        Raises:
            BurgError: see `judge_all`.
        """
        ...


@dataclass(frozen=True)
class LocalExecutor:
    """Worker processes of this machine.

    Attributes:
        workers: their number.
    """

    workers: int

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise InvalidInputError(f"workers is {self.workers}; give 1 or more")

    @classmethod
    def of_this_machine(cls) -> LocalExecutor:
        """One process a processor."""
        return cls(default_workers())

    def judge(self, jobs: Iterable[Job]) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """See `Executor.judge`."""
        for job in jobs:
            found = judge_all(job.candidates, job.make_judge, workers=self.workers)
            with closing(found) as judged:
                for candidate, verdict in judged:
                    yield job, candidate, verdict
