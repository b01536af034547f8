"""A job under way: which of its grasps wait for what."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from burg_drake.core.grasps import Verdict
from burg_drake.core.workers import Session
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages import ScreenAnswers
from burg_drake.evaluation.workers.job import Job
from burg_drake.evaluation.workers.limits import WorkerLimits
from burg_drake.evaluation.workers.worker import Grasp, build_judge

TASK_SIZE = 4
"""Grasps handed out at a time: few enough that workers finish together."""


@dataclass(frozen=True)
class Screening:
    """Grasps for the next screen; all have been through the same ones."""

    grasps: tuple[Grasp, ...]


@dataclass(frozen=True)
class Judging:
    """Grasps to be judged one by one."""

    grasps: tuple[Grasp, ...]


class OpenJob:
    """The work that a job has left.

    Attributes:
        job: the job.
        session: of the workers that have its judge.
        open: grasps to be judged one by one.
        unscreened: grasps that wait for each screen.
        batches: how many grasps to screen at a time, by screen.
        crashes_in_a_row: grasps that ended their workers since one was judged.
        failed: whether it is given up; what still comes of it does not count.
    """

    def __init__(self, job: Job, limits: WorkerLimits) -> None:
        self.job = job
        self.session = Session(
            job.key, partial(build_judge, job.make_judge), limits.of_build, limits.false_starts
        )
        self.open: deque[Grasp] = deque(
            (candidate, ScreenAnswers()) for candidate in job.candidates
        )
        self.batches: tuple[int, ...] = ()
        self.unscreened: list[deque[Grasp]] = []
        self.crashes_in_a_row = 0
        self.failed = False

    @property
    def key(self) -> str:
        """Name of its judge."""
        return self.job.key

    @property
    def waiting(self) -> int:
        """Number of grasps that no worker has."""
        return len(self.open) + sum(map(len, self.unscreened))

    def set_screens(self, batches: tuple[int, ...]) -> None:
        """Learns of the screens, from the first worker that is ready; all grasps are open then."""
        if not self.unscreened and batches:
            self.batches = batches
            self.unscreened = [self.open, *(deque() for _ in batches[1:])]
            self.open = deque()

    def next_work(self) -> Judging | Screening:
        """Grasps to judge; when there are few of them left, grasps to screen, of which the last
        screen comes first, unless too few have come to it. So they take turns, and the pace of
        judging tells how long the rest takes."""
        if len(self.open) < TASK_SIZE:
            for k in reversed(range(len(self.batches))):
                waiting = self.unscreened[k]
                if len(waiting) >= self.batches[k] or (waiting and not any(self.unscreened[:k])):
                    return Screening(_take(waiting, self.batches[k]))
        return Judging(_take(self.open, TASK_SIZE))

    def sort(
        self, candidates: Sequence[Candidate], screened: Sequence[ScreenAnswers]
    ) -> list[tuple[Candidate, Verdict]]:
        """Takes the answers of a screen; returns the verdicts that are among them."""
        verdicts = []
        for candidate, answer in zip(candidates, screened, strict=True):
            if answer.outcome is not None:
                verdicts.append((candidate, answer.verdict()))
                continue
            asked = len(answer.decisions)
            last = asked == len(self.batches)
            (self.open if last else self.unscreened[asked]).append((candidate, answer))
        return verdicts

    def give_up(self) -> None:
        """Forgets what is left."""
        self.failed = True
        self.open.clear()
        self.unscreened = []


def _take(queue: deque[Grasp], n: int) -> tuple[Grasp, ...]:
    """Takes the first n items off, or as many as there are."""
    return tuple(queue.popleft() for _ in range(min(n, len(queue))))
