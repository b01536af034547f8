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

from collections.abc import Generator, Iterable, Iterator
from functools import partial
from queue import SimpleQueue
from typing import Any

from burg_drake.core import BurgError, SimulationError, WorkerDied, one_line
from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.core.workers import Task, WorkerPool
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.workers.job import Job, JobFailed, OnFailure
from burg_drake.evaluation.workers.limits import WorkerLimits
from burg_drake.evaluation.workers.open_job import TASK_SIZE, OpenJob, Screening
from burg_drake.evaluation.workers.worker import judge_one, screen_batch, screen_sizes
from burg_drake.evaluation.workers.worker_slot import GivenWork, WorkerSlot

KEPT_JUDGES = 2
"""Judges that a worker keeps; more would take memory."""
Answer = tuple[Job, Candidate, Verdict]
"""A job, a grasp of it and what became of that."""


class JudgePool:
    """Open work and the workers that judge.

    Attributes:
        count: number of workers, at most.
        limits: what they may take.
        slots: the workers.
        jobs: those under way.
        stopped: whether it was told to stop.
        crashing: ids of grasps whose outcome is that they end their workers, in the order in which
            they came up.
    """

    def __init__(self, count: int, limits: WorkerLimits) -> None:
        self.count = count
        self.limits = limits
        self.slots: list[WorkerSlot] = []
        self.jobs: list[OpenJob] = []
        self.crashing: list[str] = []
        self.stopped = False
        self._workers: WorkerPool | None = None
        self._done: SimpleQueue[GivenWork] = SimpleQueue()
        self._screens: dict[str, tuple[int, ...]] = {}
        self._coming: Iterator[Job | None] = iter(())
        self._on_failure: OnFailure | None = None

    def run(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[Answer, None, None]:
        """Judges all grasps of all jobs; see `executor.Executor.judge`. Workers that are idle at
        the end stay, for another call; whatever else ends it, ends them."""
        self._coming, self._on_failure = iter(jobs), on_failure
        self.open()
        try:
            while not self.stopped:
                self.assign_work()
                if not any(slot.busy for slot in self.slots):
                    break
                given = self._done.get()
                if self.stopped:
                    raise SimulationError("the worker processes were stopped")
                given.slot.given.remove(given)
                if not given.job.failed:
                    yield from self.take_result(given)
        except BaseException:
            self.kill()
            raise

    def open(self) -> None:
        """Makes the workers' pool if there is none; a process is started when there is work."""
        if self._workers is None:
            self._workers = WorkerPool(self.count, kept_sessions=KEPT_JUDGES)
            self._done = SimpleQueue()
            self.slots = [WorkerSlot(k) for k in range(self.count)]

    def assign_work(self) -> None:
        """Gives idle workers something to do, those first that are there already."""
        for slot in sorted(self.slots, key=lambda slot: not slot.started):
            if not slot.busy and (job := self.choose(slot)) is not None:
                self.give(slot, job)
        self.jobs = [job for job in self.jobs if self.is_under_way(job)]

    def is_under_way(self, job: OpenJob) -> bool:
        """Whether it has any grasp left."""
        return not job.failed and (job.waiting > 0 or self.engaged(job) > 0)

    def engaged(self, job: OpenJob) -> int:
        """Number of workers that are at a job."""
        return sum(slot.busy and slot.job is job for slot in self.slots)

    def choose(self, slot: WorkerSlot) -> OpenJob | None:
        """What an idle worker is to work on."""
        built = self.built(slot)
        if slot.job is not None and slot.job.waiting:
            return slot.job
        for job in self._coming:
            if job is None:  # none is ready yet; asked again when something has happened
                break
            if job.candidates:
                self.jobs.append(OpenJob(job, self.limits))
                return self.jobs[-1]
        share = {
            job: (job.key in built, job.waiting / (1 + self.engaged(job)))
            for job in self.jobs
            if job.waiting > (0 if job.key in built else TASK_SIZE * self.engaged(job))
        }
        return max(share, key=share.__getitem__) if share else None

    def built(self, slot: WorkerSlot) -> tuple[str, ...]:
        """Keys of the judges that a worker has."""
        assert self._workers is not None
        return self._workers.sessions(slot.number)

    def give(self, slot: WorkerSlot, job: OpenJob) -> None:
        """Hands a worker work of a job, or has it build the judge first."""
        slot.job, slot.started = job, True
        if job.key not in self.built(slot) or job.key not in self._screens:
            build: Task[Any] = Task(screen_sizes, session=job.session)
            self.submit(slot, [(GivenWork(slot, job, ()), build)])
            return
        job.set_screens(self._screens[job.key])
        work, limit = job.next_work(), self.limits.of_task
        if isinstance(work, Screening):
            given = GivenWork(slot, job, work.grasps, screening=True)
            task: Task[Any] = Task(screen_batch, (work.grasps,), {}, job.session, limit, retries=0)
            self.submit(slot, [(given, task)])
            return
        each = [GivenWork(slot, job, (grasp,)) for grasp in work.grasps]
        self.submit(
            slot,
            [
                (one, Task(judge_one, one.grasps[0], {}, job.session, limit, one.begins))
                for one in each
            ],
        )

    def submit(self, slot: WorkerSlot, work: list[tuple[GivenWork, Task[Any]]]) -> None:
        """Sends a worker tasks; what becomes of each comes to `run`."""
        if self.stopped or self._workers is None:
            raise SimulationError("the worker processes were stopped")
        futures = self._workers.submit_tasks([task for _, task in work], slot.number)
        for (given, _), future in zip(work, futures, strict=True):
            given.future = future
            slot.given.append(given)
        for (given, _), future in zip(work, futures, strict=True):
            future.add_done_callback(partial(_put, self._done, given))

    def take_result(self, given: GivenWork) -> Iterator[Answer]:
        """Deals with what became of work."""
        job, future = given.job, given.future
        assert future is not None
        error = future.exception()
        if error is not None and error is job.session.error:
            self.fail(job, _cannot_build(error))
        elif not given.grasps:
            if error is None:
                self._screens[job.key] = future.result()
                job.set_screens(future.result())
        elif given.screening:
            if (
                error is not None
            ):  # each goes through what is left, so that the one to blame is found
                job.open.extend(given.grasps)
                return
            candidates = [candidate for candidate, _ in given.grasps]
            for candidate, verdict in job.sort(candidates, future.result()):
                yield job.job, candidate, verdict
        elif error is None:
            job.crashes_in_a_row = 0
            yield job.job, given.grasps[0][0], future.result()
        else:
            yield from self.settle(given, error)

    def settle(self, given: GivenWork, error: BaseException) -> Iterator[Answer]:
        """Deals with a grasp that has ended its workers."""
        job, candidate = given.job, given.grasps[0][0]
        died = isinstance(error, WorkerDied)
        reason = str(error) if died else one_line(error)
        interrupted = isinstance(error, WorkerDied) and error.from_outside
        failed = Outcome.SIMULATION_FAILED
        self.crashing.append(candidate.id)
        yield (
            job.job,
            candidate,
            Verdict(failed, given.stage, reason=reason, interrupted=interrupted),
        )
        job.crashes_in_a_row += 1
        if job.crashes_in_a_row >= self.limits.hopeless:
            self.fail(
                job,
                SimulationError(
                    f"{self.limits.hopeless} grasps in a row could not be simulated; the"
                    f" reason of the last one: {reason}"
                ),
            )

    def fail(self, job: OpenJob, error: BurgError) -> None:
        """Gives a job up, and tells of it once."""
        if job.failed:
            return
        job.give_up()
        for given in [given for slot in self.slots for given in slot.given if given.job is job]:
            if given.future is not None:
                given.future.interrupt()
        if self._on_failure is None:
            raise error
        self._on_failure(JobFailed(job.job, error))

    def release(self) -> None:
        """Lets idle workers end by themselves, and ends those that are at work."""
        if self._workers is not None and not any(slot.busy for slot in self.slots):
            self._workers.shutdown()
        self.kill()

    def stop(self) -> None:
        """Ends all workers, and with them `run` in another thread."""
        self.stopped = True
        if self._workers is not None:
            self._workers.kill_workers()

    def kill(self) -> None:
        """Ends all workers at once."""
        workers, self._workers = self._workers, None
        if workers is not None:
            workers.kill_workers()
        self.slots.clear()
        self.jobs.clear()


def _put(done: SimpleQueue[GivenWork], given: GivenWork, future: object) -> None:
    done.put(given)


def _cannot_build(error: BaseException) -> BurgError:
    if isinstance(error, BurgError) and not isinstance(error, WorkerDied):
        return error
    why = str(error) if isinstance(error, WorkerDied) else one_line(error)
    return SimulationError(f"cannot build the simulation: {why}")
