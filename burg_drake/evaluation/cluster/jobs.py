"""Work that the workers of a cluster share: grasps of a job, or calls of a function."""

from __future__ import annotations

import pickle
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from burg_drake.core import BurgError, Outcome, SimulationError, Stage, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.bundle import Bundle, make_recipe
from burg_drake.evaluation.cluster.worker_tasks import (
    CallAnswer,
    ChunkAnswers,
    ClusterCall,
    ClusterTask,
    GraspChunk,
)
from burg_drake.evaluation.executor import (
    Job,
    JobFailed,
    JudgedGrasp,
    OnFailure,
    WorkerLimits,
    hopeless_error,
    report_failure,
)
from burg_drake.evaluation.judge import StationJudgeFactory


class ChunkSettings:
    """Chunk size, and number of attempts for a grasp or a call."""

    max_grasps = 32  # Dask takes milliseconds per chunk; a lost worker's chunk is judged again.
    max_parallel_grasps = 4096  # With trials in parallel; a card takes seconds for them.
    min_parallel_grasps = 512  # Fewer take a card as long.
    max_losses = 3  # Workers lost at a grasp, the last ones alone, until it is given up.


@dataclass(eq=False)
class ClusterWorker:
    """A worker.

    Attributes:
        address: network address of the worker.
        threads: number of chunks that it processes at a time.
        chunks: chunks sent to it, oldest first.
        job: current job of the worker.
    """

    address: str
    threads: int
    chunks: list[SentChunk] = field(default_factory=list)
    job: ClusterJob | None = None

    @property
    def load(self) -> float:
        """Chunks per thread."""
        return len(self.chunks) / self.threads


@dataclass(eq=False)
class SentChunk:
    """Grasps or a call sent to a worker.

    Attributes:
        job: the job that they belong to.
        items: grasps, or the argument of the call.
        losses: workers lost so far at the chunk's only item.
        worker: the worker.
        future: future of Dask.
        done: whether the worker has finished; the answer is lost if the worker is lost now.
        suspect: whether a worker was lost at these items together.
    """

    job: ClusterJob
    items: tuple[Any, ...]
    losses: int = 0
    suspect: bool = False
    worker: ClusterWorker = field(init=False)
    future: Any = field(init=False)
    done: bool = field(init=False, default=False)


class ClusterJob(ABC):
    """Items of work that need the same bundle.

    Attributes:
        what: purpose of the bundle, for messages.
        bundle: the bundle; None if none is needed.
        returned: items that workers did not begin; they are sent before further ones.
        suspects: groups of items at which a worker was lost, each with the number of workers that
            were lost at an item alone.
        sent: number of chunks held by workers.
        failed: whether the job is given up.
        deliveries: number of deliveries of the bundle by the worker's address.
    """

    max_items = min_items = 1
    """Largest number of items in a chunk, and smallest while there are as many."""
    result_timeout = 60.0
    """Seconds to wait for a result, which may have many megabytes or be lost with its worker."""

    def __init__(self, what: str, bundle: Bundle | None, items: Sequence[Any]) -> None:
        self.what, self.bundle = what, bundle
        self._fresh, self._fresh_count = iter(items), len(items)
        self.returned: deque[Any] = deque()
        self.suspects: deque[tuple[tuple[Any, ...], int]] = deque()
        self.sent = 0
        self.failed = False
        self.deliveries: Counter[str] = Counter()

    @abstractmethod
    def task(self, run: str, items: Sequence[Any]) -> ClusterTask:
        """The task that a worker gets for some items.

        Raises:
            BurgError: the items cannot be sent.
        """

    @abstractmethod
    def read_answer(self, chunk: SentChunk, answer: Any) -> Iterator[Any]:
        """Yields the results of a chunk from the answer of its task."""

    @abstractmethod
    def failure(self, item: Any, error: BurgError) -> Any:
        """The result of an item that failed with an error."""

    @property
    def unsent_count(self) -> int:
        """Number of items that no worker has."""
        return (
            self._fresh_count + len(self.returned) + sum(len(items) for items, _ in self.suspects)
        )

    def take_chunk(self, places: int) -> SentChunk:
        """Takes items for the next chunk; chunks shrink towards the end of the work.

        Args:
            places: number of chunks among which the remaining items could be divided.
        """
        if self.suspects:
            return SentChunk(self, *self.suspects.popleft(), suspect=True)
        size = max(self.min_items, -(-self.unsent_count // places))
        size = min(size, self.max_items, self.unsent_count)
        again = [self.returned.popleft() for _ in range(min(size, len(self.returned)))]
        fresh = list(islice(self._fresh, size - len(again)))
        self._fresh_count -= len(fresh)
        return SentChunk(self, (*again, *fresh))

    def take_back(self, chunk: SentChunk) -> None:
        """Returns the items of a chunk that was not begun to the queue."""
        if self.failed:
            return
        if chunk.suspect:
            self.suspects.appendleft((chunk.items, chunk.losses))
        else:
            self.returned.extendleft(reversed(chunk.items))

    def retry_alone(
        self,
        chunk: SentChunk,
        items: Sequence[Any] | None = None,
        what: str = "were lost while working on it",
    ) -> Iterator[Any]:
        """Takes back items that a lost worker had or left out. As one of them may be the cause,
        each is sent alone next time, or each half of them where workers take many.

        Args:
            chunk: the worker's chunk.
            items: items of the chunk to take back; all if None.
            what: verb phrase for what the last workers did, for the reason of the failure.

        Yields:
            Results of items at which too many workers were lost.
        """
        if self.failed:
            return
        items, losses = tuple(chunk.items if items is None else items), chunk.losses + 1
        if self.max_items > ChunkSettings.max_grasps and len(items) > 1:
            half = len(items) // 2
            self.suspects.extend(((items[:half], 0), (items[half:], 0)))
            return
        if losses < ChunkSettings.max_losses:
            self.suspects.extend(((item,), losses) for item in items)
            return
        error = SimulationError(f"{losses} workers of the cluster {what}, one after the other")
        for item in items:
            yield self.failure(item, error)

    def give_up(self) -> None:
        """Drops the items that no worker has."""
        self.failed = True
        self._fresh_count = 0
        self.returned.clear()
        self.suspects.clear()


class GraspJob(ClusterJob):
    """Grasps to be judged on the cluster; see `executor.Executor.judge`.

    Attributes:
        job: the job.
        crashes_in_a_row: grasps that crashed their child process since the last verdict.
    """

    result_timeout = 3.0  # Seconds; the worker may be lost by now.

    def __init__(self, job: Job, limits: WorkerLimits, on_failure: OnFailure | None) -> None:
        """Packs the scene of a job.

        Raises:
            BurgError: see `make_bundle`.
        """
        self._recipe, bundle = make_recipe(job.make_judge)
        super().__init__(f"the scene {job.key!r}", bundle, job.candidates)
        self.job = job
        self.crashes_in_a_row = 0
        self._limits, self._on_failure = limits, on_failure
        self.max_items = ChunkSettings.max_grasps
        make = job.make_judge
        if isinstance(make, StationJudgeFactory) and make.engine.parallel:
            self.max_items = ChunkSettings.max_parallel_grasps
            self.min_items = ChunkSettings.min_parallel_grasps
            self.result_timeout = ClusterJob.result_timeout

    def task(self, run: str, items: Sequence[Candidate]) -> GraspChunk:
        """See `ClusterJob.task`."""
        return GraspChunk(run, self._recipe.bundle, self._recipe, tuple(items), self._limits)

    def read_answer(self, chunk: SentChunk, answer: ChunkAnswers) -> Iterator[JudgedGrasp]:
        """See `ClusterJob.read_answer`; the job fails after too many crashes in a row."""
        judged = set()
        for place, verdict in answer.verdicts:
            judged.add(place)
            yield self.job, chunk.items[place], verdict
            self.crashes_in_a_row = self.crashes_in_a_row + 1 if place in answer.crashing else 0
            if self.crashes_in_a_row >= self._limits.hopeless:
                self.fail(hopeless_error(self._limits, verdict.reason))
        if answer.error is not None:
            self.fail(answer.error)
        left = [grasp for k, grasp in enumerate(chunk.items) if k not in judged]
        yield from self.retry_alone(chunk, left, "gave no answer about it")

    def failure(self, item: Candidate, error: BurgError) -> JudgedGrasp:
        """See `ClusterJob.failure`."""
        failed = Outcome.SIMULATION_FAILED
        return self.job, item, Verdict(failed, Stage.CLEAR, reason=str(error), interrupted=True)

    def fail(self, error: BurgError) -> None:
        """Gives the job up, and reports the failure once."""
        if not self.failed:
            self.give_up()
            report_failure(JobFailed(self.job, error), self._on_failure)


def grasp_jobs(
    jobs: Iterable[Job | None], limits: WorkerLimits, on_failure: OnFailure | None
) -> Iterator[GraspJob | None]:
    """Packs jobs on request; yields None while no job is ready."""
    for job in jobs:
        if job is None:
            yield None
        elif job.candidates:
            try:
                packed = GraspJob(job, limits, on_failure)
            except BurgError as error:
                report_failure(JobFailed(job, error), on_failure)
            else:
                yield packed


class CallJob(ClusterJob):
    """Calls of a function, one per piece of work; see `dask_executor.map_on_cluster`."""

    def __init__(
        self,
        function: Callable[[Any, Path], Any],
        work: Sequence[Any],
        bundle: Bundle,
        pack: Callable[[Any], Any],
    ) -> None:
        super().__init__("the files that its work needs", bundle, work)
        self._function, self._pack = function, pack
        self._bundle_name = bundle.name

    def task(self, run: str, items: Sequence[Any]) -> ClusterCall:
        """See `ClusterJob.task`."""
        (work,) = items
        packed = pickle.dumps((self._function, self._pack(work)))
        return ClusterCall(run, self._bundle_name, packed)

    def read_answer(self, chunk: SentChunk, answer: CallAnswer) -> Iterator[tuple[Any, Any]]:
        """See `ClusterJob.read_answer`."""
        result = pickle.loads(answer.result) if answer.error is None else answer.error
        yield chunk.items[0], result

    def failure(self, item: Any, error: BurgError) -> tuple[Any, BurgError]:
        """See `ClusterJob.failure`."""
        return item, error
