"""Executors take jobs of grasps and yield verdicts in any order. `LocalExecutor` uses processes.

A job has the grasps of one judge, such as those of one scene. Workers build the judge of a job when
they first need it, so the same workers can take many jobs.

A grasp that kills its worker (a crash inside Drake, or a time limit) is tried once more, alone, in
a fresh process. If that dies too, the outcome is `simulation_failed` and the other grasps go on.
The verdict records whether the last worker was killed from outside; a later call may then retry.

A device that fails, such as a graphics card, decides nothing about grasps: its worker gets no more
work, and the others take its grasps. If there is no other, the call ends with the device's error.

Screens take many grasps at once, which costs a fraction of screening each. Only grasps that pass
are handed out one by one. If a worker dies during a screening, its grasps go through the remaining
stages one by one, to find the grasp that kills it.

A worker stays with a job while grasps wait, as its judge is built. Then it begins the next job, or
joins other workers on theirs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple, Protocol

from burg_drake.core import (
    BurgError,
    DeviceError,
    Outcome,
    Session,
    SimulationError,
    Stage,
    Task,
    TimeLimit,
    Verdict,
    WorkerDied,
    WorkerFuture,
    WorkerPool,
    one_line,
    worker_count,
)
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import Judge, JudgingState, judge_grasp, screen_grasps


@dataclass(frozen=True, eq=False)
class Job:
    """Grasps for one judge.

    Attributes:
        key: name of the judge; jobs with the same key share it.
        make_judge: builds the judge; pickled by reference, see `judge_all`.
        candidates: the grasps.
    """

    key: str
    make_judge: Callable[[], Judge]
    candidates: Sequence[Candidate]


@dataclass(frozen=True, eq=False)
class JobFailed:
    """A job that was given up while some of its grasps have no verdict.

    Attributes:
        job: the job.
        error: the cause: its judge cannot be built, or too many grasps in a row kill their workers.
    """

    job: Job
    error: BurgError


OnFailure = Callable[[JobFailed], None]
"""Callback for a job that failed; the other jobs go on."""


@dataclass(frozen=True)
class WorkerLimits:
    """Limits of an executor.

    Attributes:
        cpu: CPU time for one grasp, or one screening [s]. A trial takes about a second, the slowest
            ones some tens. On a busy machine it takes longer, but not more CPU time.
        build: CPU time to build a judge [s].
        wall: wall time for a grasp, screening or build [s]; ends calls that hang.
        hopeless: number of grasps in a row that kill their workers, after which a job is given up.
        false_starts: number of workers in a row that die while building the judge of a job, after
            which it is given up.
    """

    cpu: float = 300.0
    build: float = 1800.0
    wall: float = 3600.0
    hopeless: int = 50
    false_starts: int = 2


PendingGrasp = tuple[Candidate, JudgingState]
"""A grasp without a verdict, and the decisions on it so far."""


def build_judge(make_judge: Callable[[], Judge]) -> Judge:
    """Builds a judge.

    Raises:
        BurgError: the judge cannot be built.
    """
    try:
        return make_judge()
    except BurgError:
        raise
    except Exception as error:
        raise SimulationError(f"cannot build the simulation: {one_line(error)}") from error


class ScreenSize(NamedTuple):
    """Batch size of a screen.

    Attributes:
        batch: as in `Screen`.
        executes: whether it executes the grasps, which takes as long as a trial for some of them.
    """

    batch: int
    executes: bool


def _screen_sizes(judge: Judge) -> tuple[ScreenSize, ...]:
    """Batch size of each screen."""
    return tuple(
        ScreenSize(screen.batch, screen.stage is Stage.EXECUTED) for screen in judge.screens
    )


GRASPS_PER_TASK = 4
"""Grasps handed out at a time: few, so that workers finish together."""


class GraspQueue:
    """Queue of waiting grasps; fresh grasps come before appended ones.

    Args:
        fresh: grasps on which no stage has decided. Their `JudgingState` takes memory, so it is
            made when a grasp is taken.
    """

    def __init__(self, fresh: Sequence[Candidate] = ()) -> None:
        self._fresh, self._taken_count = fresh, 0
        self._appended: deque[PendingGrasp] = deque()

    def __len__(self) -> int:
        return len(self._fresh) - self._taken_count + len(self._appended)

    def append(self, grasp: PendingGrasp) -> None:
        """Adds a grasp at the end."""
        self._appended.append(grasp)

    def take(self, n: int) -> tuple[PendingGrasp, ...]:
        """Removes and returns the first n grasps, or all if there are fewer."""
        begin, end = self._taken_count, min(self._taken_count + n, len(self._fresh))
        self._taken_count = end
        fresh = [(self._fresh[k], JudgingState()) for k in range(begin, end)]
        rest = min(n - len(fresh), len(self._appended))
        return (*fresh, *(self._appended.popleft() for _ in range(rest)))


class OpenJob:
    """The remaining work of a job.

    Attributes:
        job: the job.
        session: session of the workers that have its judge.
        to_judge: grasps to be judged one by one.
        to_screen: queue of each screen.
        batches: batch size of each screen.
        returned: batches that a screen takes again, before others: those that killed a worker, in
            halves, and those whose device failed.
        crashes_in_a_row: number of grasps that killed their workers since one was judged.
        failed: whether the job is given up; later results are ignored.
    """

    def __init__(self, job: Job, limits: WorkerLimits) -> None:
        self.job = job
        self.session = Session(
            job.key,
            partial(build_judge, job.make_judge),
            TimeLimit(limits.build, limits.wall),
            limits.false_starts,
        )
        self.to_judge = GraspQueue(job.candidates)
        self.batches: tuple[ScreenSize, ...] = ()
        self.returned: deque[tuple[PendingGrasp, ...]] = deque()
        self.to_screen: list[GraspQueue] = []
        self.crashes_in_a_row = 0
        self.failed = False

    @property
    def waiting(self) -> int:
        """Number of grasps not handed to a worker."""
        return len(self.to_judge) + sum(map(len, self.to_screen)) + sum(map(len, self.returned))

    def set_screens(self, batches: tuple[ScreenSize, ...]) -> None:
        """Sets the screens once the first worker reports them; until then no grasp is screened."""
        if not self.to_screen and batches:
            self.batches = batches
            self.to_screen = [self.to_judge, *(GraspQueue() for _ in batches[1:])]
            self.to_judge = GraspQueue()

    def next_work(self) -> tuple[tuple[PendingGrasp, ...], bool]:
        """Grasps to work on next, and whether a screen (the same for all) takes them.

        Grasps are screened when few are left to judge. The last screen comes first, unless too few
        grasps wait for it. Screening and judging thus alternate, so that the rate of verdicts
        predicts the remaining time.
        """
        if self.returned:
            return self.returned.popleft(), True
        if len(self.to_judge) < GRASPS_PER_TASK:
            for k in reversed(range(len(self.batches))):
                queue, size = self.to_screen[k], self.batches[k].batch
                if len(queue) >= size or (queue and not any(self.to_screen[:k])):
                    return queue.take(size), True
        return self.to_judge.take(GRASPS_PER_TASK), False

    def sort_screened(
        self, grasps: Sequence[PendingGrasp], states: Sequence[JudgingState]
    ) -> list[tuple[Candidate, Verdict]]:
        """Queues the grasps that a screen passed on; returns the verdicts of rejected grasps."""
        verdicts = []
        for (candidate, _), state in zip(grasps, states, strict=True):
            if state.outcome is not None:
                verdicts.append((candidate, state.verdict()))
                continue
            screened = len(state.decisions)
            queue = self.to_screen[screened] if screened < len(self.batches) else self.to_judge
            queue.append((candidate, state))
        return verdicts

    def give_up(self) -> None:
        """Marks the job as failed and drops its remaining grasps."""
        self.failed = True
        self.to_judge = GraspQueue()
        self.to_screen = []
        self.returned.clear()

    def take_back(self, grasps: tuple[PendingGrasp, ...], *, screening: bool) -> None:
        """Queues grasps again that a worker could not judge, through no fault of theirs.

        Args:
            grasps: the grasps.
            screening: whether they were screened together.
        """
        if screening:
            self.returned.append(grasps)
            return
        for grasp in grasps:
            self.to_judge.append(grasp)

    def executes(self, grasps: Sequence[PendingGrasp]) -> bool:
        """Whether the next screen of these grasps executes them."""
        number = len(grasps[0][1].decisions)
        return number < len(self.batches) and self.batches[number].executes

    def screen_again(self, grasps: tuple[PendingGrasp, ...]) -> None:
        """Queues grasps at whose screening a worker died: many that are executed together in
        halves, others to be judged one by one, to find the grasp that kills it."""
        few = 64
        if self.executes(grasps) and len(grasps) > few:
            half = len(grasps) // 2
            self.returned += [grasps[:half], grasps[half:]]
            return
        for grasp in grasps:
            self.to_judge.append(grasp)


@dataclass(eq=False)
class AssignedWork:
    """A piece of work assigned to a worker.

    Attributes:
        slot: the worker.
        job: the job of the work.
        grasps: one grasp to judge, several to screen, or none to build the judge.
        screening: whether the grasps are screened.
        future: future of the result.
        stage: last stage that began.
    """

    slot: WorkerSlot
    job: OpenJob
    grasps: tuple[PendingGrasp, ...]
    screening: bool = False
    future: WorkerFuture[Any] | None = None
    stage: Stage = Stage.CLEAR

    def begin_stage(self, stage: Stage) -> None:
        """Records that a stage begins."""
        self.stage = stage


@dataclass(eq=False)
class WorkerSlot:
    """A worker.

    Attributes:
        number: index in the pool.
        job: current or last job of the worker.
        assigned: work that it has not finished yet.
        started: whether the worker was ever given work.
        device_failed: whether its device failed; it gets no more work.
    """

    number: int
    job: OpenJob | None = None
    assigned: list[AssignedWork] = field(default_factory=list)
    started: bool = False
    device_failed: bool = False


JudgedGrasp = tuple[Job, Candidate, Verdict]
"""A job, one of its grasps, and the verdict on the grasp."""


class JudgePool:
    """Open work and the workers that judge.

    Attributes:
        count: largest number of workers.
        limits: limits of the workers.
        slots: the workers.
        jobs: jobs in progress.
        stopped: whether `stop` was called.
        crashing: ids of grasps that killed their workers, in order of occurrence.
    """

    def __init__(self, count: int, limits: WorkerLimits) -> None:
        self.count = count
        self.limits = limits
        self.slots: list[WorkerSlot] = []
        self.jobs: list[OpenJob] = []
        self.crashing: list[str] = []
        self.stopped = False
        self._workers: WorkerPool | None = None
        self._done: SimpleQueue[AssignedWork] = SimpleQueue()
        self._screens: dict[str, tuple[ScreenSize, ...]] = {}
        self._remaining_jobs: Iterator[Job | None] = iter(())
        self._on_failure: OnFailure | None = None
        self._job_is_pending = False

    def run(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[JudgedGrasp, None, None]:
        """Judges all grasps of all jobs; see `Executor.judge`.

        Idle workers stay for another call; an error or closing the generator ends all workers.
        """
        job_poll = 0.2  # Seconds after which a job that was not ready is asked for again.
        self._remaining_jobs, self._on_failure = iter(jobs), on_failure
        self.create_workers()
        try:
            while not self.stopped:
                self.assign_work()
                if not any(slot.assigned for slot in self.slots):
                    break
                try:
                    work = self._done.get(timeout=job_poll if self._job_is_pending else None)
                except Empty:
                    continue
                finally:
                    if self.stopped:
                        raise SimulationError("the worker processes were stopped")
                work.slot.assigned.remove(work)
                if not work.job.failed:
                    yield from self.handle_result(work)
        except BaseException:
            self.kill()
            raise

    def create_workers(self) -> None:
        """Creates the worker pool if there is none; processes start when there is work."""
        if self._workers is None:
            self._workers = WorkerPool(self.count)
            self._done = SimpleQueue()
            self.slots = [WorkerSlot(k) for k in range(self.count)]

    def assign_work(self) -> None:
        """Gives work to idle workers, first to those whose process has started."""
        self._job_is_pending = False
        usable = [slot for slot in self.slots if not slot.device_failed]
        for slot in sorted(usable, key=lambda slot: not slot.started):
            if not slot.assigned and (job := self.choose_job(slot)) is not None:
                self.give_work(slot, job)
        open_jobs = [job for job in self.jobs if not job.failed]
        self.jobs = [job for job in open_jobs if job.waiting or self.worker_count_of(job)]

    def worker_count_of(self, job: OpenJob) -> int:
        """Number of workers that work on a job."""
        return sum(bool(slot.assigned) and slot.job is job for slot in self.slots)

    def choose_job(self, slot: WorkerSlot) -> OpenJob | None:
        """Chooses the job for an idle worker; None if there is none."""
        built = self.built_judges(slot)
        if slot.job is not None and slot.job.waiting:
            return slot.job
        for job in self._remaining_jobs:
            if job is None:  # none is ready yet
                self._job_is_pending = True
                break
            if job.candidates:
                self.jobs.append(OpenJob(job, self.limits))
                return self.jobs[-1]
        priorities = {
            job: (job.job.key in built, job.waiting / (1 + self.worker_count_of(job)))
            for job in self.jobs
            if job.waiting
            > (0 if job.job.key in built else GRASPS_PER_TASK * self.worker_count_of(job))
        }
        return max(priorities, key=priorities.__getitem__) if priorities else None

    def built_judges(self, slot: WorkerSlot) -> tuple[str, ...]:
        """Keys of the judges that a worker has built."""
        assert self._workers is not None
        return self._workers.sessions(slot.number)

    def give_work(self, slot: WorkerSlot, job: OpenJob) -> None:
        """Gives a worker grasps of a job, or has it build the judge first."""
        slot.job, slot.started = job, True
        if job.job.key not in self.built_judges(slot) or job.job.key not in self._screens:
            build: Task[Any] = Task(_screen_sizes, session=job.session)
            self.submit(slot, [(AssignedWork(slot, job, ()), build)])
            return
        job.set_screens(self._screens[job.job.key])
        grasps, are_screened = job.next_work()
        limit = TimeLimit(self.limits.cpu, self.limits.wall)
        if are_screened and job.executes(grasps):  # the first time it compiles, too
            cpu, wall = (each * len(grasps) for each in (self.limits.cpu, self.limits.wall))
            limit = TimeLimit(self.limits.build + cpu, wall)
        if are_screened:
            work = AssignedWork(slot, job, grasps, screening=True)
            task: Task[Any] = Task(screen_grasps, (grasps,), {}, job.session, limit, retries=0)
            self.submit(slot, [(work, task)])
            return
        works = [AssignedWork(slot, job, (grasp,)) for grasp in grasps]
        tasks = [
            Task(judge_grasp, work.grasps[0], {}, job.session, limit, work.begin_stage)
            for work in works
        ]
        self.submit(slot, list(zip(works, tasks, strict=True)))

    def submit(self, slot: WorkerSlot, tasks: list[tuple[AssignedWork, Task[Any]]]) -> None:
        """Sends tasks to a worker; `run` receives each result."""
        if self.stopped or self._workers is None:
            raise SimulationError("the worker processes were stopped")
        futures = self._workers.submit_tasks([task for _, task in tasks], slot.number)
        for (work, _), future in zip(tasks, futures, strict=True):
            work.future = future
            slot.assigned.append(work)
        for (work, _), future in zip(tasks, futures, strict=True):
            future.add_done_callback(partial(self._note_done, work))

    def _note_done(self, work: AssignedWork, future: object) -> None:
        self._done.put(work)

    def handle_result(self, work: AssignedWork) -> Iterator[JudgedGrasp]:
        """Handles the result of a piece of work; yields the verdicts in it."""
        job, future = work.job, work.future
        assert future is not None
        error = future.exception()
        if error is not None and error is job.session.error:
            self.fail_job(job, _build_error(error))
        elif isinstance(error, DeviceError):
            self.retire_worker(work, error)
        elif not work.grasps:
            if error is None:
                self._screens[job.job.key] = future.result()
                job.set_screens(future.result())
        elif work.screening:
            if error is not None:
                job.screen_again(work.grasps)
                return
            for candidate, verdict in job.sort_screened(work.grasps, future.result()):
                yield job.job, candidate, verdict
        elif error is None:
            job.crashes_in_a_row = 0
            yield job.job, work.grasps[0][0], future.result()
        else:
            yield from self.handle_crash(work, error)

    def retire_worker(self, work: AssignedWork, error: DeviceError) -> None:
        """Gives no more work to a worker whose device failed, and its grasps to others.

        Raises:
            DeviceError: there is no other worker.
        """
        work.job.take_back(work.grasps, screening=work.screening)
        work.slot.device_failed = True
        if all(slot.device_failed for slot in self.slots):
            raise error

    def handle_crash(self, work: AssignedWork, error: BaseException) -> Iterator[JudgedGrasp]:
        """Yields `simulation_failed` for a grasp that killed its workers.

        Gives the job up after too many such grasps in a row.
        """
        job, candidate = work.job, work.grasps[0][0]
        reason, interrupted = one_line(error), False
        if isinstance(error, WorkerDied):
            reason, interrupted = str(error), error.from_outside
        self.crashing.append(candidate.id)
        failed = Outcome.SIMULATION_FAILED
        verdict = Verdict(failed, work.stage, reason=reason, interrupted=interrupted)
        yield job.job, candidate, verdict
        job.crashes_in_a_row += 1
        if job.crashes_in_a_row >= self.limits.hopeless:
            self.fail_job(job, hopeless_error(self.limits, reason))

    def fail_job(self, job: OpenJob, error: BurgError) -> None:
        """Gives a job up, and reports it once."""
        if job.failed:
            return
        job.give_up()
        for work in [work for slot in self.slots for work in slot.assigned if work.job is job]:
            if work.future is not None:
                work.future.interrupt()
        report_failure(JobFailed(job.job, error), self._on_failure)

    def release(self) -> None:
        """Shuts down idle workers and kills busy ones."""
        if self._workers is not None and not any(slot.assigned for slot in self.slots):
            self._workers.shutdown()
        self.kill()

    def stop(self) -> None:
        """Kills all workers, which ends `run` in another thread."""
        self.stopped = True
        if self._workers is not None:
            self._workers.kill_workers()

    def kill(self) -> None:
        """Kills all workers at once."""
        workers, self._workers = self._workers, None
        if workers is not None:
            workers.kill_workers()
        self.slots.clear()
        self.jobs.clear()


def report_failure(failure: JobFailed, on_failure: OnFailure | None) -> None:
    """Passes the failure of a job to `on_failure`; raises its error if that is None."""
    if on_failure is None:
        raise failure.error
    on_failure(failure)


def hopeless_error(limits: WorkerLimits, reason: str) -> SimulationError:
    """Error of a job that is given up after `WorkerLimits.hopeless` failed grasps in a row.

    Args:
        limits: limits of the workers.
        reason: why the last grasp failed.
    """
    return SimulationError(
        f"{limits.hopeless} grasps in a row could not be simulated; the reason of the last one:"
        f" {reason}"
    )


def _build_error(error: BaseException) -> BurgError:
    if isinstance(error, BurgError) and not isinstance(error, WorkerDied):
        return error
    why = str(error) if isinstance(error, WorkerDied) else one_line(error)
    return SimulationError(f"cannot build the simulation: {why}")


class Executor(Protocol):
    """Judges the grasps of jobs, in any order."""

    @property
    def workers(self) -> int:
        """Number of worker processes."""

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """Judges all grasps of all jobs.

        Args:
            jobs: taken one after the other, when workers run out of work. None means that no job
                is ready yet, and that workers have others to work on meanwhile.
            on_failure: called with a job that cannot be done, such as one whose judge cannot be
                built; it gets no more verdicts, and the other jobs go on. If None, its error is
                raised.

        Yields:
            Each grasp with its verdict, in the order of completion. Closing the iterator ends the
            work.

        Raises:
            BurgError: a job cannot be done, and there is no `on_failure`; see `judge_all`.
            DeviceError: the devices of all workers failed.
        """


@dataclass(frozen=True)
class LocalExecutor:
    """Judges in worker processes of this machine.

    Attributes:
        workers: number of processes.
        limits: limits of the workers.
    """

    workers: int
    limits: WorkerLimits = field(default_factory=WorkerLimits)
    _kept: JudgePool | None = field(default=None, repr=False)  # See `keep_workers`.

    def __post_init__(self) -> None:
        worker_count(self.workers)  # refuses what is below 1

    @classmethod
    def of_this_machine(
        cls, workers: int | None = None, limits: WorkerLimits | None = None
    ) -> LocalExecutor:
        """Executor with this number of processes (None: one per processor) and limits.

        Raises:
            InvalidInputError: workers is below 1.
        """
        return cls(worker_count(workers), limits or WorkerLimits())

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """See `Executor.judge`."""
        pool = self._kept or JudgePool(self.workers, self.limits)
        yield from pool.run(jobs, on_failure)
        if self._kept is None:
            pool.release()


@contextmanager
def keep_workers(executor: LocalExecutor) -> Iterator[LocalExecutor]:
    """Context manager that yields an executor whose processes stay until the context ends.

    It is for one call at a time. Jobs of different calls must have different keys, or the same
    judge.
    """
    pool = JudgePool(executor.workers, executor.limits)
    try:
        yield replace(executor, _kept=pool)
    finally:
        pool.release()


def judge_all(
    candidates: Sequence[Candidate],
    make_judge: Callable[[], Judge],
    *,
    workers: int | None = None,
    limits: WorkerLimits | None = None,
) -> Generator[tuple[Candidate, Verdict], None, None]:
    """Judges grasps in parallel.

    Args:
        candidates: the grasps.
        make_judge: builds the judge, called once in each worker; pickled by reference, hence an
            instance of an importable class or an importable function.
        workers: number of processes; one per processor if None.
        limits: limits of the workers; the defaults if None.

    Yields:
        Each candidate with its verdict, in the order of completion. Closing the iterator ends the
        workers.

    Raises:
        InvalidInputError: workers is below 1.
        BurgError: the judge cannot be built.
        SimulationError: workers die while the judge is built, or at `WorkerLimits.hopeless` grasps
            in a row.
        DeviceError: the devices of all workers failed.
    """
    executor = LocalExecutor.of_this_machine(workers, limits)
    with closing(executor.judge([Job("", make_judge, candidates)])) as answers:
        for _, candidate, verdict in answers:
            yield candidate, verdict
