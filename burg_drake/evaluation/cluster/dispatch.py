"""Sends bundles and chunks of grasps to the workers of a cluster, and collects their verdicts."""

from __future__ import annotations

import queue
import time
import uuid
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any, Generic, TypeVar

from distributed import KilledWorker

from burg_drake.core import (
    BurgError,
    ClusterError,
    Outcome,
    SimulationError,
    Stage,
    Verdict,
    one_line,
)
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.bundle import Bundle
from burg_drake.evaluation.cluster.members import (
    CONNECTION_ERRORS,
    ChunkSettings,
    ClusterWorker,
    ClusterWorkers,
    SentChunk,
    SentJob,
    SentTask,
    WorkerWait,
    lost_scheduler_error,
    scheduler_errors,
)
from burg_drake.evaluation.cluster.worker_tasks import (
    Chunk,
    ChunkAnswers,
    Supervisor,
    judge_chunk,
    unpack_on_worker,
)
from burg_drake.evaluation.executor import Answer, Job, JobFailed, OnFailure, WorkerLimits

DELIVERY_ATTEMPTS = 3
"""Number of times that a worker is sent a plugin or a bundle."""


def send_bundle(
    client: Any, bundle: Bundle, what: str, deliveries: Counter[str], addresses: Sequence[str]
) -> None:
    """Sends a bundle to workers.

    Args:
        client: of Dask.
        bundle: with its data.
        what: the bundle is for, as messages name it.
        deliveries: number of times that it was sent, by the worker's address; counted on.
        addresses: of the workers.

    Raises:
        ClusterError: a worker cannot unpack it, or lacks it after several attempts; or the
            scheduler is lost.
    """
    if not addresses:
        return

    def refusal(address: str, why: str) -> ClusterError:
        return ClusterError(f"worker {address} did not receive {what}: {why}")

    for address in addresses:
        deliveries[address] += 1
        if deliveries[address] > DELIVERY_ATTEMPTS:
            raise refusal(address, "its files are not there afterwards")
    with scheduler_errors(client):
        errors = client.run(
            unpack_on_worker, bundle.data, bundle.name, workers=list(addresses), on_error="return"
        )
    for address, error in errors.items():
        if isinstance(error, CONNECTION_ERRORS) and deliveries[address] < DELIVERY_ATTEMPTS:
            continue  # the next check of the workers shows whether this one is lost
        if isinstance(error, BaseException):
            why = str(error) if isinstance(error, BurgError) else one_line(error)
            raise refusal(address, why)


WORKER_POLL_INTERVAL = 1.0
"""Seconds between checks for new and lost workers."""
SentT = TypeVar("SentT", bound=SentTask)


class ClusterRun(ABC, Generic[SentT]):
    """Tasks of one run under way on a cluster.

    Attributes:
        client: of Dask.
        cluster: the workers.
        name: of the plugin that runs tasks on a worker.
        sent: tasks that workers have, by the key of their future.
    """

    def __init__(self, client: Any, maintain: Callable[[], None]) -> None:
        self.client = client
        self.cluster = ClusterWorkers(client)
        self.name = f"burg-drake-{uuid.uuid4().hex}"
        self.sent: dict[str, SentT] = {}
        self._maintain = maintain
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._last_poll = -WORKER_POLL_INTERVAL
        self._waiting = WorkerWait(client)

    @abstractmethod
    def handle_lost_worker(self, worker: ClusterWorker) -> Iterator[Any]:
        """Takes back the tasks of a lost worker, and yields the results of those given up."""

    def begin(self, plugin: Any) -> None:
        """Registers the plugin of the run on all workers and on those that join later. A worker
        that dies meanwhile is no reason to stop.

        Raises:
            ClusterError: as `ClusterWorkers.update`.
        """
        retry_interval = 1.0  # Seconds between attempts.
        for attempt in range(1, DELIVERY_ATTEMPTS + 1):
            self.cluster.update()  # refuses workers that do not know the plugin
            try:
                self.client.register_plugin(plugin, name=self.name)
                return
            except CONNECTION_ERRORS as error:
                if self.client.status != "running" or attempt == DELIVERY_ATTEMPTS:
                    raise lost_scheduler_error(self.client) from error
                time.sleep(retry_interval)

    def end(self) -> None:
        """Cancels the tasks that are under way, and ends the children of the run."""
        self._waiting.end()
        if self.client.status != "running":
            return
        try:
            self.client.cancel([sent.future for sent in self.sent.values()], force=True)
            self.client.unregister_worker_plugin(self.name)
        except CONNECTION_ERRORS:
            pass  # the scheduler is lost, and its workers end with it

    def poll_is_due(self) -> bool:
        """Whether it is time to check for new and lost workers."""
        return time.monotonic() > self._last_poll + WORKER_POLL_INTERVAL

    def poll_soon(self) -> None:
        """Makes the next check for new and lost workers due."""
        self._last_poll = -WORKER_POLL_INTERVAL

    def update_workers(self) -> Iterator[Any]:
        """Takes on new workers, and yields the results that `handle_lost_worker` gives."""
        self._maintain()
        for worker in self.cluster.update():
            yield from self.handle_lost_worker(worker)
        self._last_poll = time.monotonic()
        if self.cluster.workers:
            self._waiting.end()
        else:
            self._waiting.go_on()

    def submit(
        self, function: Callable[[Any], Any], argument: Any, sent: SentT, worker: ClusterWorker
    ) -> None:
        """Has a worker call a function."""
        with scheduler_errors(self.client):
            future = self.client.submit(
                function,
                argument,
                key=f"{type(argument).__name__}-{uuid.uuid4().hex}",
                pure=False,
                retries=0,
                workers=[worker.address],
                allow_other_workers=False,
            )
        sent.worker, sent.future = worker, future
        self.sent[future.key] = sent

        def finish(future: Any) -> None:  # in another thread
            sent.done = True
            self._ended.put(future)

        future.add_done_callback(finish)

    def wait_for_tasks(self) -> list[SentT]:
        """Waits a while for a task that ends, and returns all that have ended."""
        try:
            futures = [self._ended.get(timeout=WORKER_POLL_INTERVAL)]
        except queue.Empty:
            return []
        while not self._ended.empty():
            futures.append(self._ended.get())
        return [self.sent[f.key] for f in futures if f.key in self.sent]

    def read_answer(self, sent: SentT, timeout: float) -> Any:
        """The answer of a task that has ended; None if it was cancelled.

        Raises:
            KilledWorker: its worker was lost.
            OSError: it does not come within the time-out [s]; see `retry_answer`.
            ClusterError: the task failed.
        """
        try:
            return sent.future.result(timeout=timeout)
        except (KilledWorker, OSError):
            raise
        except CancelledError:  # by the loss of the scheduler, or by somebody else
            return None
        except Exception as error:
            raise ClusterError(f"worker {sent.worker.address}: {one_line(error)}") from error

    def retry_answer(self, sent: SentT) -> None:
        """Reads an answer again later: its worker is busy, or the next check shows its loss.

        Raises:
            ClusterError: the scheduler is lost.
        """
        if self.client.status != "running":
            raise lost_scheduler_error(self.client)
        if sent.worker.address in self.cluster.workers:
            self._ended.put(sent.future)
        self.poll_soon()


class Dispatch(ClusterRun[SentChunk]):
    """Jobs under way on a cluster.

    Attributes:
        limits: of the workers' children.
        jobs: those under way.
    """

    def __init__(self, client: Any, limits: WorkerLimits, maintain: Callable[[], None]) -> None:
        super().__init__(client, maintain)
        self.limits = limits
        self.jobs: list[SentJob] = []
        self._coming: Iterator[Job | None] = iter(())
        self._on_failure: OnFailure | None = None
        self._exhausted = False

    def run(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None
    ) -> Generator[Answer, None, None]:
        """See `executor.Executor.judge`."""
        self._coming, self._on_failure = iter(jobs), on_failure
        self.begin(Supervisor(self.name))
        try:
            while True:
                if self.poll_is_due():
                    yield from self.update_workers()
                self.hand_out()
                if not self.sent and not any(job.left for job in self.jobs):
                    if self.open_next_job() is not None:
                        continue
                    if self._exhausted:
                        return
                yield from self.collect()
        finally:
            self.end()

    def hand_out(self) -> None:
        """Gives every worker as many chunks as it has room for; those with the least come first."""
        while True:
            workers = [worker for worker in self.cluster.workers.values() if worker.room > 0]
            for worker in workers:
                worker.job = self.choose(worker)
            workers = [worker for worker in workers if worker.job is not None]
            if not workers:
                return
            least = min(worker.load for worker in workers)
            for worker in workers:
                if worker.load <= least and worker.job is not None and worker.job.left:
                    self.send(worker.job.take_chunk(max(1, self.cluster.threads)), worker)

    def choose(self, worker: ClusterWorker) -> SentJob | None:
        """The job that a worker goes on with: its own, the next one, or one that others work on."""
        if worker.job is not None and worker.job.left:
            return worker.job
        job = self.open_next_job()
        if job is not None:
            return job
        self.jobs = [job for job in self.jobs if job.left or job.sent]
        open_jobs = [job for job in self.jobs if job.left]
        return max(open_jobs, key=lambda job: job.left / (1 + job.sent), default=None)

    def open_next_job(self) -> SentJob | None:
        """The next job, if one is ready."""
        for job in self._coming:
            if job is None:  # none is ready yet
                return None
            if job.candidates:
                try:
                    self.jobs.append(SentJob(job))
                except BurgError as error:
                    self._report_failure(JobFailed(job, error))
                    continue
                return self.jobs[-1]
        self._exhausted = True
        return None

    def send(self, chunk: SentChunk, worker: ClusterWorker) -> None:
        """Sends a chunk to a worker."""
        packed = Chunk(self.name, chunk.job.recipe, chunk.grasps, self.limits)
        self.submit(judge_chunk, packed, chunk, worker)
        chunk.job.sent += 1
        worker.chunks.append(chunk)

    def collect(self) -> Iterator[Answer]:
        """Waits a while for answers, and passes on all that have come."""
        result_timeout = 3.0  # Seconds; the worker may be lost by now.
        missing: dict[str, tuple[SentJob, list[str]]] = {}
        for chunk in self.wait_for_tasks():
            try:
                answers: ChunkAnswers = self.read_answer(chunk, result_timeout) or ChunkAnswers(
                    ended=True
                )
            except KilledWorker:
                self.forget(chunk)
                yield from self.suspect_grasps(chunk)
                continue
            except OSError:
                self.retry_answer(chunk)
                continue
            self.forget(chunk)
            if answers.ended:
                chunk.take_back()
                self.poll_soon()
            elif answers.missing:
                chunk.take_back()
                place = missing.setdefault(chunk.job.recipe.bundle, (chunk.job, []))
                place[1].append(chunk.worker.address)
            elif not chunk.job.failed:
                yield from self.handle_answers(chunk, answers)
        for job, addresses in missing.values():
            there = [a for a in dict.fromkeys(addresses) if a in self.cluster.workers]
            assert job.bundle is not None
            what = f"the scene {job.job.key!r}"
            send_bundle(self.client, job.bundle, what, job.deliveries, there)

    def handle_answers(self, chunk: SentChunk, answers: ChunkAnswers) -> Iterator[Answer]:
        """Passes the verdicts of a chunk on."""
        job = chunk.job
        judged = set()
        for place, verdict in answers.verdicts:
            judged.add(place)
            yield job.job, chunk.grasps[place], verdict
            job.crashes_in_a_row = job.crashes_in_a_row + 1 if place in answers.crashing else 0
            if job.crashes_in_a_row >= self.limits.hopeless:
                self.fail(
                    job,
                    SimulationError(
                        f"{self.limits.hopeless} grasps in a row could not be simulated;"
                        f" the reason of the last one: {verdict.reason}"
                    ),
                )
        if answers.error is not None:
            self.fail(job, answers.error)
        open_ones = [grasp for k, grasp in enumerate(chunk.grasps) if k not in judged]
        yield from self.suspect_grasps(chunk, open_ones, "gave no answer about it")

    def handle_lost_worker(self, worker: ClusterWorker) -> Iterator[Answer]:
        """Takes back the chunks of a lost worker; the grasps of those under way are sent alone."""
        suspects = [chunk for chunk in worker.chunks if not chunk.done][: worker.threads]
        for chunk in list(worker.chunks):
            self.forget(chunk)
            chunk.future.cancel()
            if chunk in suspects:
                yield from self.suspect_grasps(chunk)
            else:
                chunk.take_back()

    def suspect_grasps(
        self,
        chunk: SentChunk,
        grasps: Sequence[Candidate] | None = None,
        what: str = "were lost while working on it",
    ) -> Iterator[Answer]:
        """Sends grasps again that a lost worker had or that it left out, or gives them up.

        Args:
            chunk: that it had.
            grasps: those of the chunk; all if None.
            what: the last workers did, for the verdict's reason.
        """
        for grasp in chunk.suspect(chunk.grasps if grasps is None else grasps):
            reason = (
                f"{ChunkSettings.max_losses} workers of the cluster {what}, one after the other"
            )
            failed = Outcome.SIMULATION_FAILED
            verdict = Verdict(failed, Stage.CLEAR, reason=reason, interrupted=True)
            yield chunk.job.job, grasp, verdict

    def forget(self, chunk: SentChunk) -> None:
        """Notes that no worker has a chunk any more."""
        del self.sent[chunk.future.key]
        chunk.worker.chunks.remove(chunk)
        chunk.job.sent -= 1

    def fail(self, job: SentJob, error: BurgError) -> None:
        """Gives a job up, and reports that once."""
        if not job.failed:
            job.give_up()
            self._report_failure(JobFailed(job.job, error))

    def _report_failure(self, failure: JobFailed) -> None:
        if self._on_failure is None:
            raise failure.error
        self._on_failure(failure)
