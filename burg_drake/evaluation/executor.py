"""Executors take jobs of grasps and return verdicts in any order; here on this machine.

A job is what one judge can judge, such as the grasps of one scene. Workers build the judge of a job
when they first need it, so many jobs go through the same workers.

A grasp that ends its worker (a crash inside Drake, or a time limit) is tried once more, alone, in a
fresh process. If that dies too, the outcome is `simulation_failed` and the other grasps go on. The
verdict tells whether the last worker was ended from outside; then a later call may ask again.

Screens are asked about many grasps at once, which costs a fraction of asking about each. Only
grasps that pass are handed out one by one. If a worker ends while it screens, its grasps go through
the remaining stages one by one, so that the one to blame is found.

A worker stays with a job while grasps wait, as its judge is built. Then it begins the next job, or
helps with one that other workers are at.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from queue import SimpleQueue
from typing import Any, Protocol

from burg_drake.core import (
    BurgError,
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
from burg_drake.evaluation.judge import Judge, ScreenAnswers, judge_grasp, screen_grasps


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


@dataclass(frozen=True, eq=False)
class JobFailed:
    """No more verdicts come for a job, and some of its grasps have none.

    Attributes:
        job: the job.
        error: why: its judge cannot be built, or too many grasps in a row end their workers.
    """

    job: Job
    error: BurgError


OnFailure = Callable[[JobFailed], None]
"""Is told of a job that failed; the others go on."""


@dataclass(frozen=True)
class WorkerLimits:
    """Limits of an executor.

    Attributes:
        cpu: CPU time for one grasp, or one screening [s]. A trial takes about a second, the slowest
            ones some tens. On a busy machine it takes longer, but not more CPU time.
        build: CPU time to build a judge [s].
        wall: wall time for each of these [s]; ends what waits for ever.
        hopeless: so many grasps of a job in a row that end their workers, with none judged in
            between, end the job.
        false_starts: so many workers in a row that die while they build the judge of a job end it.
    """

    cpu: float = 300.0
    build: float = 1800.0
    wall: float = 3600.0
    hopeless: int = 50
    false_starts: int = 2


Grasp = tuple[Candidate, ScreenAnswers]
"""A grasp with the answers of the screens that have been asked."""


def build_judge(make_judge: Callable[[], Judge]) -> Judge:
    """Builds a judge.

    Raises:
        BurgError: it cannot be built.
    """
    try:
        return make_judge()
    except BurgError:
        raise
    except Exception as error:
        raise SimulationError(f"cannot build the simulation: {one_line(error)}") from error


def _screen_batches(judge: Judge) -> tuple[int, ...]:
    """How many grasps to screen at a time, by screen."""
    return tuple(screen.batch for screen in judge.screens)


GRASPS_PER_TASK = 4
"""Grasps handed out at a time: few, so that workers finish together."""


class GraspQueue:
    """Grasps that wait, first those that nobody has been asked about.

    Args:
        fresh: those; a grasp with answers takes memory, so each is made when it is taken.
    """

    def __init__(self, fresh: Sequence[Candidate] = ()) -> None:
        self._fresh, self._taken = fresh, 0
        self._others: deque[Grasp] = deque()

    def __len__(self) -> int:
        return len(self._fresh) - self._taken + len(self._others)

    def append(self, grasp: Grasp) -> None:
        """Adds a grasp at the end."""
        self._others.append(grasp)

    def take(self, n: int) -> tuple[Grasp, ...]:
        """Takes the first n grasps off, or as many as there are."""
        begin, end = self._taken, min(self._taken + n, len(self._fresh))
        self._taken = end
        fresh = [(self._fresh[k], ScreenAnswers()) for k in range(begin, end)]
        rest = min(n - len(fresh), len(self._others))
        return (*fresh, *(self._others.popleft() for _ in range(rest)))


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
            job.key,
            partial(build_judge, job.make_judge),
            TimeLimit(limits.build, limits.wall),
            limits.false_starts,
        )
        self.open = GraspQueue(job.candidates)
        self.batches: tuple[int, ...] = ()
        self.unscreened: list[GraspQueue] = []
        self.crashes_in_a_row = 0
        self.failed = False

    @property
    def waiting(self) -> int:
        """Number of grasps that no worker has."""
        return len(self.open) + sum(map(len, self.unscreened))

    def set_screens(self, batches: tuple[int, ...]) -> None:
        """Learns of the screens, from the first worker that is ready; all grasps are open then."""
        if not self.unscreened and batches:
            self.batches = batches
            self.unscreened = [self.open, *(GraspQueue() for _ in batches[1:])]
            self.open = GraspQueue()

    def next_work(self) -> tuple[tuple[Grasp, ...], bool]:
        """Grasps to work on, and whether they are screened: all have been through the same screens.

        Grasps are screened when few are left to judge. The last screen comes first, unless too few
        grasps have come to it. So they take turns, and the pace of judging tells how long the rest
        takes.
        """
        if len(self.open) < GRASPS_PER_TASK:
            for k in reversed(range(len(self.batches))):
                waiting = self.unscreened[k]
                if len(waiting) >= self.batches[k] or (waiting and not any(self.unscreened[:k])):
                    return waiting.take(self.batches[k]), True
        return self.open.take(GRASPS_PER_TASK), False

    def take_screen_answers(
        self, grasps: Sequence[Grasp], answers: Sequence[ScreenAnswers]
    ) -> list[tuple[Candidate, Verdict]]:
        """Takes the answers of a screen; returns the verdicts that are among them."""
        verdicts = []
        for (candidate, _), answer in zip(grasps, answers, strict=True):
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
        self.open = GraspQueue()
        self.unscreened = []


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

    def begin_stage(self, stage: Stage) -> None:
        """Notes that a stage begins."""
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
        """Judges all grasps of all jobs; see `Executor.judge`. Workers that are idle at
        the end stay, for another call; whatever else ends it, ends them."""
        self._coming, self._on_failure = iter(jobs), on_failure
        self.open()
        try:
            while not self.stopped:
                self.assign_work()
                if not any(slot.given for slot in self.slots):
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
            self._workers = WorkerPool(self.count)
            self._done = SimpleQueue()
            self.slots = [WorkerSlot(k) for k in range(self.count)]

    def assign_work(self) -> None:
        """Gives idle workers something to do, those first that are there already."""
        for slot in sorted(self.slots, key=lambda slot: not slot.started):
            if not slot.given and (job := self.choose_job(slot)) is not None:
                self.give_work(slot, job)
        open_jobs = [job for job in self.jobs if not job.failed]
        self.jobs = [job for job in open_jobs if job.waiting or self.worker_count_of(job)]

    def worker_count_of(self, job: OpenJob) -> int:
        """Number of workers that are at a job."""
        return sum(bool(slot.given) and slot.job is job for slot in self.slots)

    def choose_job(self, slot: WorkerSlot) -> OpenJob | None:
        """What an idle worker is to work on."""
        built = self.judges_of(slot)
        if slot.job is not None and slot.job.waiting:
            return slot.job
        for job in self._coming:
            if job is None:  # none is ready yet; asked again when something has happened
                break
            if job.candidates:
                self.jobs.append(OpenJob(job, self.limits))
                return self.jobs[-1]
        share = {
            job: (job.job.key in built, job.waiting / (1 + self.worker_count_of(job)))
            for job in self.jobs
            if job.waiting
            > (0 if job.job.key in built else GRASPS_PER_TASK * self.worker_count_of(job))
        }
        return max(share, key=share.__getitem__) if share else None

    def judges_of(self, slot: WorkerSlot) -> tuple[str, ...]:
        """Keys of the judges that a worker has."""
        assert self._workers is not None
        return self._workers.sessions(slot.number)

    def give_work(self, slot: WorkerSlot, job: OpenJob) -> None:
        """Hands a worker work of a job, or has it build the judge first."""
        slot.job, slot.started = job, True
        if job.job.key not in self.judges_of(slot) or job.job.key not in self._screens:
            build: Task[Any] = Task(_screen_batches, session=job.session)
            self.submit(slot, [(GivenWork(slot, job, ()), build)])
            return
        job.set_screens(self._screens[job.job.key])
        grasps, are_screened = job.next_work()
        limit = TimeLimit(self.limits.cpu, self.limits.wall)
        if are_screened:
            given = GivenWork(slot, job, grasps, screening=True)
            task: Task[Any] = Task(screen_grasps, (grasps,), {}, job.session, limit, retries=0)
            self.submit(slot, [(given, task)])
            return
        each = [GivenWork(slot, job, (grasp,)) for grasp in grasps]
        tasks = [
            Task(judge_grasp, one.grasps[0], {}, job.session, limit, one.begin_stage)
            for one in each
        ]
        self.submit(slot, list(zip(each, tasks, strict=True)))

    def submit(self, slot: WorkerSlot, work: list[tuple[GivenWork, Task[Any]]]) -> None:
        """Sends a worker tasks; what becomes of each comes to `run`."""
        if self.stopped or self._workers is None:
            raise SimulationError("the worker processes were stopped")
        futures = self._workers.submit_tasks([task for _, task in work], slot.number)
        for (given, _), future in zip(work, futures, strict=True):
            given.future = future
            slot.given.append(given)
        for (given, _), future in zip(work, futures, strict=True):
            future.add_done_callback(partial(self._note_done, given))

    def _note_done(self, given: GivenWork, future: object) -> None:
        self._done.put(given)

    def take_result(self, given: GivenWork) -> Iterator[Answer]:
        """Deals with what became of work."""
        job, future = given.job, given.future
        assert future is not None
        error = future.exception()
        if error is not None and error is job.session.error:
            self.fail_job(job, _build_error(error))
        elif not given.grasps:
            if error is None:
                self._screens[job.job.key] = future.result()
                job.set_screens(future.result())
        elif given.screening:
            if error is not None:  # each goes through the rest, so that the one to blame is found
                for grasp in given.grasps:
                    job.open.append(grasp)
                return
            for candidate, verdict in job.take_screen_answers(given.grasps, future.result()):
                yield job.job, candidate, verdict
        elif error is None:
            job.crashes_in_a_row = 0
            yield job.job, given.grasps[0][0], future.result()
        else:
            yield from self.take_crash(given, error)

    def take_crash(self, given: GivenWork, error: BaseException) -> Iterator[Answer]:
        """Deals with a grasp that has ended its workers."""
        job, candidate = given.job, given.grasps[0][0]
        reason, interrupted = one_line(error), False
        if isinstance(error, WorkerDied):
            reason, interrupted = str(error), error.from_outside
        self.crashing.append(candidate.id)
        failed = Outcome.SIMULATION_FAILED
        verdict = Verdict(failed, given.stage, reason=reason, interrupted=interrupted)
        yield job.job, candidate, verdict
        job.crashes_in_a_row += 1
        if job.crashes_in_a_row >= self.limits.hopeless:
            why = (
                f"{self.limits.hopeless} grasps in a row could not be simulated; the"
                f" reason of the last one: {reason}"
            )
            self.fail_job(job, SimulationError(why))

    def fail_job(self, job: OpenJob, error: BurgError) -> None:
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
        if self._workers is not None and not any(slot.given for slot in self.slots):
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


def _build_error(error: BaseException) -> BurgError:
    if isinstance(error, BurgError) and not isinstance(error, WorkerDied):
        return error
    why = str(error) if isinstance(error, WorkerDied) else one_line(error)
    return SimulationError(f"cannot build the simulation: {why}")


class Executor(Protocol):
    """Judges jobs."""

    @property
    def workers(self) -> int:
        """Number of processes that judge."""

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
        workers: number of processes; as many as there are processors if None.
        limits: what they may take; the usual ones if None.

    Yields:
        Each candidate with its verdict, in the order of completion. Closing the iterator ends the
        workers.

    Raises:
        InvalidInputError: workers is below 1.
        BurgError: the judge cannot be built.
        SimulationError: workers die while the judge is built, or at `WorkerLimits.hopeless` grasps
            in a row.
    """
    executor = LocalExecutor.of_this_machine(workers, limits)
    with closing(executor.judge([Job("", make_judge, candidates)])) as answers:
        for _, candidate, verdict in answers:
            yield candidate, verdict
