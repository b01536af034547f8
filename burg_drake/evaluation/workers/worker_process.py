"""A worker process as its parent sees it: what it was given, and what has become of that."""

from __future__ import annotations

import contextlib
import signal
import subprocess
from collections import deque
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

from burg_drake.core.grasps import Stage
from burg_drake.core.workers import cause_of_death, start_worker, was_ended_from_outside
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.workers.limits import TOO_LONG, WorkerLimits
from burg_drake.evaluation.workers.open_job import Grasp, OpenJob
from burg_drake.evaluation.workers.worker import Build, JudgingTask, Screening

KEPT_JUDGES = 2
"""Judges that a worker keeps; more would take memory."""


@dataclass(eq=False)
class WorkerProcess:
    """A process, the pipe to it, and what it is at.

    Attributes:
        process, connection: the process and our end of the pipe.
        limits: what it may take.
        first: task that is kept for it until its judge is built, if any.
        job: what it works on, or did last.
        building: whether it builds the judge of `job`.
        judges: those that it has, by key, with the batches of their screens; used last comes last.
        screening: grasps that it screens, with the answers before.
        task: grasps that it was given and has not judged yet, likewise.
        last_try: whether its task is a grasp that has ended another worker before.
        stage: the last one that it announced.
        last_words: why it is about to end.
    """

    process: subprocess.Popen[bytes]
    connection: Connection
    limits: WorkerLimits
    first: JudgingTask | None = None
    job: OpenJob | None = None
    building: bool = False
    judges: dict[str, tuple[int, ...]] = field(default_factory=dict)
    screening: tuple[Grasp, ...] = ()
    task: deque[Grasp] = field(default_factory=deque)
    last_try: bool = False
    stage: Stage = Stage.CLEAR
    last_words: str = ""

    @property
    def busy(self) -> bool:
        """Whether it has something to do."""
        return self.building or bool(self.task or self.screening)

    def take_up(self, job: OpenJob) -> None:
        """Hands it work of a job, or has it build the judge first."""
        self.job = job
        if job.key in self.judges:
            self.judges[job.key] = self.judges.pop(job.key)
            job.know(self.judges[job.key])
            self.give(job.next_work())
            return
        drop = tuple(self.judges)[: max(0, len(self.judges) + 1 - KEPT_JUDGES)]
        for key in drop:
            del self.judges[key]
        self.building = True
        self.send(Build(job.key, job.recipe, drop, self.limits))

    def built(self, batches: tuple[int, ...]) -> None:
        """Its judge is built."""
        assert self.job is not None
        self.building = False
        self.judges[self.job.key] = batches

    def give(self, work: JudgingTask | Screening) -> None:
        """Hands it work."""
        if isinstance(work, Screening):
            self.screening = work.grasps
        else:
            self.task = deque(work.grasps)
            self.last_try = work.last_try
        self.send(work)

    def judged(self) -> Candidate:
        """Takes the grasp off the task that a verdict has come for."""
        return self.task.popleft()[0]

    def screened(self) -> list[Candidate]:
        """Takes the grasps off that are screened."""
        candidates = [candidate for candidate, _ in self.screening]
        self.screening = ()
        return candidates

    def send(self, message: object) -> None:
        """Tells it something."""
        with contextlib.suppress(OSError):  # it has died; its pipe's end tells the main loop
            self.connection.send(message)

    def cause_of_death(self) -> str:
        """Why it has ended, for people."""
        cause = cause_of_death(self.process, self.last_words)
        if not self.overdue:
            return cause
        if self.process.wait() == -signal.SIGALRM:
            return f"took longer than {self.limits.wall:g} s"
        limit = self.limits.build if self.building else self.limits.cpu
        return f"took longer than {limit:g} s of CPU time"

    @property
    def overdue(self) -> bool:
        """Whether it has ended because it took too long."""
        return -self.process.wait() in TOO_LONG

    @property
    def was_interrupted(self) -> bool:
        """Whether it has been ended by others than us, and through no fault of its grasp."""
        return was_ended_from_outside(self.process)


def start(limits: WorkerLimits) -> WorkerProcess:
    """Starts a process.

    Args:
        limits: what it may take.
    """
    process, connection = start_worker("burg_drake.evaluation.workers.worker")
    return WorkerProcess(process, connection, limits)
