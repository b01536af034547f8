"""Judges candidates in worker processes, in any order, surviving the death of workers.

A grasp that ends its worker (a crash inside Drake) is tried once more, alone, in a fresh process;
when that dies too, the grasp's outcome is `simulation_failed` and the others go on. So do they when
a grasp takes longer than `GRASP_TIME_LIMIT`: its worker is ended. A verdict tells whether the last
worker was ended from outside; then a later call may ask again.

Screens are asked about many grasps at once, which costs a fraction of asking about each, and only
what they pass on is handed out grasp by grasp. When a worker ends while it screens, its grasps go
through what is left one by one, so that the one to blame is found.
"""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from multiprocessing.connection import wait

from burg_drake.core.errors import InvalidInputError, SimulationError
from burg_drake.core.outcome import Outcome
from burg_drake.core.processes import default_workers
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import Judge, Screened, Verdict
from burg_drake.evaluation.worker import (
    Begins,
    Dying,
    Judged,
    Message,
    Ready,
    Screening,
    Screens,
    Task,
    Unable,
)
from burg_drake.evaluation.worker_process import Grasp, WorkerProcess, start

TASK_SIZE = 4
"""Grasps handed out at a time: few enough that workers finish together."""
GRASP_TIME_LIMIT = 300.0
"""Wall time for one grasp, or one screening [s]; a trial takes about a second, the slowest ones
some tens."""
HOPELESS = 50
"""So many grasps in a row that end their workers, with none judged in between, end the run."""
FALSE_STARTS = 2
"""So many workers in a row that die before their judge is built end the run."""
FAREWELL = 5.0
"""Time that an idle worker is given to end by itself [s]."""


def judge_all(
    candidates: Sequence[Candidate], make_judge: Callable[[], Judge], *, workers: int | None = None
) -> Generator[tuple[Candidate, Verdict], None, None]:
    """Judges grasps in parallel.

    Args:
        candidates: the grasps.
        make_judge: builds the judge, called once in each worker; pickled by reference, hence an
            instance of an importable class or an importable function.
        workers: number of processes; as many as there are processors if None.

    Yields:
        Each candidate with its verdict, in the order of completion. Closing the iterator ends the
        workers.

    Raises:
        InvalidInputError: workers is below 1.
        BurgError: the judge cannot be built.
        SimulationError: workers die while the judge is built, or at `HOPELESS` grasps in a row.
    """
    count = default_workers() if workers is None else workers
    if count < 1:
        raise InvalidInputError(f"workers is {count}; give 1 or more")
    pool = _Pool(make_judge, candidates)
    try:
        yield from pool.run(min(count, -(-len(candidates) // TASK_SIZE)))
    except BaseException:
        pool.kill()
        raise
    pool.dismiss()


class _Pool:
    """Open work and living workers.

    Attributes:
        unscreened: grasps that wait for each screen.
        open: grasps to be judged one by one.
        batches: how many grasps to screen at a time, by screen.
        workers: by their connection.
    """

    def __init__(self, make_judge: Callable[[], Judge], candidates: Sequence[Candidate]) -> None:
        self.make_judge = make_judge
        self.open: deque[Grasp] = deque((candidate, Screened()) for candidate in candidates)
        self.batches: tuple[int, ...] = ()
        self.unscreened: list[deque[Grasp]] = []
        self.workers: dict[object, WorkerProcess] = {}
        self.false_starts = 0
        self.crashes_in_a_row = 0

    def run(self, count: int) -> Iterator[tuple[Candidate, Verdict]]:
        for _ in range(count):
            self.hire()
        while self.has_work or any(w.busy or w.first for w in self.workers.values()):
            for connection in wait([w.connection for w in self.workers.values()], self.patience):
                worker = self.workers[connection]
                try:
                    message: Message = worker.connection.recv()
                except (EOFError, OSError):
                    yield from self.bury(worker)
                else:
                    yield from self.hear(worker, message)
            for worker in self.workers.values():
                if worker.busy:
                    worker.end_if_overdue(GRASP_TIME_LIMIT)
                elif worker.ready and self.has_work:
                    worker.give(self.next_work())

    @property
    def has_work(self) -> bool:
        return bool(self.open) or any(self.unscreened)

    def know(self, batches: tuple[int, ...]) -> None:
        """Learns of the screens, from the first worker that is ready; all grasps are open then."""
        if not self.unscreened and batches:
            self.batches = batches
            self.unscreened = [self.open, *(deque() for _ in batches[1:])]
            self.open = deque()

    def next_work(self) -> Task | Screening:
        """Grasps to judge; when there are few of them left, grasps to screen, of which the last
        screen comes first, unless too few have come to it. So they take turns, and the pace of
        judging tells how long the rest takes."""
        if len(self.open) < TASK_SIZE:
            for k in reversed(range(len(self.batches))):
                waiting = self.unscreened[k]
                if len(waiting) >= self.batches[k] or (waiting and not any(self.unscreened[:k])):
                    return Screening(_take(waiting, self.batches[k]))
        return Task(_take(self.open, TASK_SIZE))

    @property
    def patience(self) -> float | None:
        """Time until the next grasp takes too long [s]."""
        since = [w.since for w in self.workers.values() if w.busy and not w.overdue]
        return max(0.0, min(since) + GRASP_TIME_LIMIT - time.monotonic()) if since else None

    def hire(self, first: Task | None = None) -> None:
        worker = start(self.make_judge, first)
        self.workers[worker.connection] = worker

    def replace(self) -> None:
        """Starts a worker in the place of a dead one, if there is work for it."""
        if self.has_work:
            self.hire()

    def hear(self, worker: WorkerProcess, message: Message) -> Iterator[tuple[Candidate, Verdict]]:
        match message:
            case Unable(error):
                raise error
            case Dying(reason):
                worker.last_words = reason
            case Begins(stage):
                worker.stage = stage
            case Ready(batches):
                self.know(batches)
                worker.ready = True
                self.false_starts = 0
                if worker.first is not None:
                    worker.give(worker.first)
                    worker.first = None
            case Screens(screened):
                for candidate, answer in zip(worker.screened(), screened, strict=True):
                    if answer.outcome is not None:
                        yield candidate, answer.verdict()
                        continue
                    asked = len(answer.decisions)
                    last = asked == len(self.batches)
                    (self.open if last else self.unscreened[asked]).append((candidate, answer))
            case Judged(verdict):
                self.crashes_in_a_row = 0
                yield worker.judged(), verdict

    def bury(self, worker: WorkerProcess) -> Iterator[tuple[Candidate, Verdict]]:
        """Deals with the death of a worker: the grasp it was at is suspect, the rest is kept."""
        del self.workers[worker.connection]
        worker.connection.close()
        reason = worker.cause_of_death(GRASP_TIME_LIMIT)
        if not worker.ready:
            self.false_starts += 1
            if self.false_starts >= FALSE_STARTS:
                raise SimulationError(f"cannot build the simulation: {reason}")
            self.hire(worker.first)
            return
        self.open.extend(worker.screening)
        if not worker.task:
            self.replace()
            return
        suspect = worker.task.popleft()
        self.open.extendleft(reversed(worker.task))
        if not (worker.last_try or worker.overdue):
            self.hire(Task((suspect,), last_try=True))
            return
        interrupted = worker.was_interrupted
        failed = Outcome.SIMULATION_FAILED
        yield suspect[0], Verdict(failed, worker.stage, reason=reason, interrupted=interrupted)
        self.crashes_in_a_row += 1
        if self.crashes_in_a_row >= HOPELESS:
            raise SimulationError(
                f"{HOPELESS} grasps in a row could not be simulated; the last one: {reason}"
            )
        self.replace()

    def dismiss(self) -> None:
        """Lets idle workers end by themselves, and ends those that are still starting."""
        for worker in self.workers.values():
            if worker.ready:
                worker.send(None)
            else:
                worker.process.kill()
        for worker in self.workers.values():
            with contextlib.suppress(subprocess.TimeoutExpired):
                worker.process.wait(FAREWELL)
        self.kill()

    def kill(self) -> None:
        """Ends all workers at once."""
        for worker in self.workers.values():
            worker.process.kill()
        for worker in self.workers.values():
            worker.process.wait()
            worker.connection.close()
        self.workers.clear()


def _take(queue: deque[Grasp], n: int) -> tuple[Grasp, ...]:
    """Takes the first n items off, or as many as there are."""
    return tuple(queue.popleft() for _ in range(min(n, len(queue))))
