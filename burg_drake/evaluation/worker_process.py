"""A worker process as its parent sees it: what it was given, and what has become of that."""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

from burg_drake.core.outcome import Stage
from burg_drake.core.processes import cause_of_death, start_worker, was_ended_from_outside
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import Judge, Screened
from burg_drake.evaluation.worker import Screening, Task

Grasp = tuple[Candidate, Screened]
"""A grasp with the answers of the screens that have been asked."""


@dataclass(eq=False)
class WorkerProcess:
    """A process, the pipe to it, and what it is at.

    Attributes:
        process, connection: the process and our end of the pipe.
        first: task that is kept for it until it is ready, if any.
        ready: whether its judge is built.
        screening: grasps that it screens, with the answers before.
        task: grasps that it was given and has not judged yet, likewise.
        last_try: whether its task is a grasp that has ended another worker before.
        stage: the last one that it announced.
        since: when it began with the first grasp of `task`, or the screening, by
            `time.monotonic` [s].
        overdue: whether it was ended because that took too long.
        last_words: why it is about to end.
    """

    process: subprocess.Popen[bytes]
    connection: Connection
    first: Task | None = None
    ready: bool = False
    screening: tuple[Grasp, ...] = ()
    task: deque[Grasp] = field(default_factory=deque)
    last_try: bool = False
    stage: Stage = Stage.CLEAR
    since: float = 0.0
    overdue: bool = False
    last_words: str = ""

    @property
    def busy(self) -> bool:
        """Whether it has something to do."""
        return bool(self.task or self.screening)

    def give(self, work: Task | Screening) -> None:
        """Hands it work."""
        if isinstance(work, Screening):
            self.screening = work.grasps
        else:
            self.task = deque(work.grasps)
            self.last_try = work.last_try
        self.since = time.monotonic()
        self.send(work)

    def judged(self) -> Candidate:
        """Takes the grasp off the task that a verdict has come for."""
        self.since, self.overdue = time.monotonic(), False
        return self.task.popleft()[0]

    def screened(self) -> list[Candidate]:
        """Takes the grasps off that are screened."""
        candidates = [candidate for candidate, _ in self.screening]
        self.screening, self.overdue = (), False
        return candidates

    def end_if_overdue(self, limit: float) -> None:
        """Ends it if it has been at one grasp, or one screening, for longer than that [s]."""
        if time.monotonic() > self.since + limit and not self.connection.poll():
            self.overdue = True
            self.process.kill()

    def send(self, message: object) -> None:
        """Tells it something."""
        with contextlib.suppress(OSError):  # it has died; its pipe's end tells the main loop
            self.connection.send(message)

    def cause_of_death(self, limit: float) -> str:
        """Why it has ended, for people; `limit` as above."""
        cause = cause_of_death(self.process, self.last_words)
        return f"took longer than {limit:g} s" if self.overdue else cause

    @property
    def was_interrupted(self) -> bool:
        """Whether it has been ended by others than us, and through no fault of its grasp."""
        return not self.overdue and was_ended_from_outside(self.process)


def start(make_judge: Callable[[], Judge], first: Task | None) -> WorkerProcess:
    """Starts a process that builds a judge.

    Args:
        make_judge: builds it there.
        first: work that is kept for it until then, if any.
    """
    process, connection = start_worker("burg_drake.evaluation.worker")
    worker = WorkerProcess(process, connection, first)
    worker.send(make_judge)
    return worker
