"""Worker processes that judge the grasps of many jobs, in any order, and outlive each other.

A grasp that ends its worker (a crash inside Drake) is tried once more, alone, in a fresh process;
when that dies too, the grasp's outcome is `simulation_failed` and the others go on. So do they when
a grasp takes longer than it may, see `limits`. A verdict tells whether the last worker was ended
from outside; then a later call may ask again.

Screens are asked about many grasps at once, which costs a fraction of asking about each, and only
what they pass on is handed out grasp by grasp. When a worker ends while it screens, its grasps go
through what is left one by one, so that the one to blame is found.

A worker stays with a job while that has work, as its judge is built. Then it begins with the next
job; when there is none, it helps with one that others are at.
"""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Generator, Iterable, Iterator
from multiprocessing.connection import wait

from burg_drake.core import BurgError, SimulationError
from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.workers.job import Job, JobFailed, OnFailure
from burg_drake.evaluation.workers.limits import WorkerLimits
from burg_drake.evaluation.workers.open_job import TASK_SIZE, OpenJob
from burg_drake.evaluation.workers.worker import (
    Begins,
    Judged,
    JudgeUnavailable,
    JudgingTask,
    Message,
    Ready,
    Screens,
    WorkerEnding,
)
from burg_drake.evaluation.workers.worker_process import WorkerProcess, start

FAREWELL = 5.0
"""Time that an idle worker is given to end by itself [s]."""
Answer = tuple[Job, Candidate, Verdict]
"""A job, a grasp of it and what became of that."""


class Pool:
    """Open work and living workers.

    Attributes:
        count: number of workers, at most.
        limits: what they may take.
        workers: by their connection.
        jobs: those under way.
        stopped: whether it was told to stop.
        deadly: ids of grasps whose outcome is that they end their workers, in the order in which
            they came up.
    """

    def __init__(self, count: int, limits: WorkerLimits) -> None:
        self.count = count
        self.limits = limits
        self.workers: dict[object, WorkerProcess] = {}
        self.jobs: list[OpenJob] = []
        self.deadly: list[str] = []
        self.stopped = False
        self._coming: Iterator[Job | None] = iter(())
        self._on_failure: OnFailure | None = None

    def run(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[Answer, None, None]:
        """Judges all grasps of all jobs; see `executor.Executor.judge`. Workers that are idle at
        the end stay, for another call; whatever else ends it, ends them."""
        self._coming, self._on_failure = iter(jobs), on_failure
        try:
            while not self.stopped:
                self.employ()
                if not any(worker.busy for worker in self.workers.values()):
                    break
                for connection in wait([w.connection for w in self.workers.values()]):
                    worker = self.workers[connection]
                    try:
                        message: Message = worker.connection.recv()
                    except (EOFError, OSError):
                        yield from self.bury(worker)
                    else:
                        yield from self.hear(worker, message)
                if self.stopped:
                    raise SimulationError("the workers were ended")
        except BaseException:
            self.kill()
            raise

    def employ(self) -> None:
        """Gives idle workers something to do, and hires as many as there is work for."""
        for worker in self.workers.values():
            if not worker.busy and (job := self.choose(worker)) is not None:
                worker.take_up(job)
        self.jobs = [job for job in self.jobs if self.is_under_way(job)]
        while len(self.workers) < self.count and (job := self.choose(None)) is not None:
            self.hire(job)

    def is_under_way(self, job: OpenJob) -> bool:
        """Whether it has any grasp left."""
        return not job.failed and (job.waiting > 0 or self.engaged(job) > 0)

    def engaged(self, job: OpenJob) -> int:
        """Number of workers that are at a job."""
        return sum(worker.busy and worker.job is job for worker in self.workers.values())

    def choose(self, worker: WorkerProcess | None) -> OpenJob | None:
        """What an idle worker, or one to be hired, is to work on."""
        built = worker.judges if worker else {}
        if worker is not None and worker.job is not None and worker.job.waiting:
            return worker.job
        for job in self._coming:
            if job is None:  # none is ready yet; asked again when something has happened
                break
            if job.candidates:
                self.jobs.append(OpenJob(job))
                return self.jobs[-1]
        share = {
            job: (job.key in built, job.waiting / (1 + self.engaged(job)))
            for job in self.jobs
            if job.waiting > (0 if job.key in built else TASK_SIZE * self.engaged(job))
        }
        return max(share, key=share.__getitem__) if share else None

    def hire(self, job: OpenJob, first: JudgingTask | None = None) -> None:
        """Starts a worker for a job, with work that is kept for it if any."""
        if self.stopped:
            raise SimulationError("the workers were ended")
        worker = start(self.limits)
        self.workers[worker.connection] = worker
        worker.first = first
        worker.take_up(job)

    def hear(self, worker: WorkerProcess, message: Message) -> Iterator[Answer]:
        job = worker.job
        assert job is not None
        match message:
            case JudgeUnavailable(error):
                worker.building = False
                self.fail(job, error)
            case WorkerEnding(reason):
                worker.last_words = reason
            case Begins(stage):
                worker.stage = stage
            case Ready(batches):
                worker.built(batches)
                job.know(batches)
                job.false_starts = 0
                if worker.first is not None and not job.failed:
                    worker.give(worker.first)
                worker.first = None
            case Screens(screened):
                candidates = worker.screened()
                if not job.failed:
                    for candidate, verdict in job.sort(candidates, screened):
                        yield job.job, candidate, verdict
            case Judged(verdict):
                job.crashes_in_a_row = 0
                candidate = worker.judged()
                if not job.failed:
                    yield job.job, candidate, verdict

    def bury(self, worker: WorkerProcess) -> Iterator[Answer]:
        """Deals with the death of a worker: the grasp it was at is suspect, the rest is kept."""
        del self.workers[worker.connection]
        worker.connection.close()
        reason, job = worker.cause_of_death(), worker.job
        if job is None or job.failed:
            return
        if worker.building:
            job.false_starts += 1
            if job.false_starts >= self.limits.false_starts:
                self.fail(job, SimulationError(f"cannot build the simulation: {reason}"))
            elif worker.first is not None:
                self.hire(job, worker.first)
            return
        job.open.extend(worker.screening)
        if not worker.task:
            return
        suspect = worker.task.popleft()
        job.open.extendleft(reversed(worker.task))
        if not (worker.last_try or worker.overdue):
            self.hire(job, JudgingTask(job.key, (suspect,), last_try=True))
            return
        interrupted = worker.was_interrupted
        failed = Outcome.SIMULATION_FAILED
        self.deadly.append(suspect[0].id)
        yield (
            job.job,
            suspect[0],
            Verdict(failed, worker.stage, reason=reason, interrupted=interrupted),
        )
        job.crashes_in_a_row += 1
        if job.crashes_in_a_row >= self.limits.hopeless:
            self.fail(
                job,
                SimulationError(
                    f"{self.limits.hopeless} grasps in a row could not be simulated;"
                    f" the last one: {reason}"
                ),
            )

    def fail(self, job: OpenJob, error: BurgError) -> None:
        """Gives a job up, and tells of it once."""
        if job.failed:
            return
        job.give_up()
        if self._on_failure is None:
            raise error
        self._on_failure(JobFailed(job.job, error))

    def dismiss(self) -> None:
        """Lets idle workers end by themselves, and ends those that are at work."""
        for worker in self.workers.values():
            if worker.busy:
                worker.process.kill()
            else:
                worker.send(None)
        for worker in self.workers.values():
            with contextlib.suppress(subprocess.TimeoutExpired):
                worker.process.wait(FAREWELL)
        self.kill()

    def stop(self) -> None:
        """Ends all workers, and with them `run` in another thread."""
        self.stopped = True
        for worker in list(self.workers.values()):
            worker.process.kill()

    def kill(self) -> None:
        """Ends all workers at once."""
        for worker in self.workers.values():
            worker.process.kill()
        for worker in self.workers.values():
            worker.process.wait()
            worker.connection.close()
        self.workers.clear()
        self.jobs.clear()
