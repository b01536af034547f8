"""Sends bundles and chunks of grasps to the workers of a cluster, and collects their verdicts."""

from __future__ import annotations

import queue
import time
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any

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
"""Number of times that a worker is sent what it needs to begin."""


def register_plugin(client: Any, cluster: ClusterWorkers, plugin: Any) -> None:
    """Has the workers, and those that join later, begin a run. A worker that dies meanwhile is no
    reason to stop.

    Args:
        client: of Dask.
        cluster: the workers; looked at before anything is registered where others would not know
            it.
        plugin: of Dask's workers, with the `name` of the run.

    Raises:
        ClusterError: as `ClusterWorkers.update`.
    """
    retry_interval = 1.0  # Seconds between attempts.
    for attempt in range(1, DELIVERY_ATTEMPTS + 1):
        cluster.update()
        try:
            client.register_plugin(plugin, name=plugin.name)
            return
        except CONNECTION_ERRORS as error:
            if client.status != "running" or attempt == DELIVERY_ATTEMPTS:
                raise lost_scheduler_error(client) from error
            time.sleep(retry_interval)


def end_run(client: Any, name: str, futures: Sequence[Any]) -> None:
    """Gives up what is under way, and ends the children of a run.

    Args:
        client: of Dask.
        name: of the run's plugin.
        futures: of Dask.
    """
    if client.status != "running":
        return
    try:
        client.cancel(list(futures), force=True)
        client.unregister_worker_plugin(name)
    except CONNECTION_ERRORS:
        pass  # the scheduler is lost, and its workers end with it


def deliver_bundle(client: Any, job: SentJob, addresses: Sequence[str]) -> None:
    """Sends it; a worker that lacks it nonetheless, after some attempts, is told of.

    Args:
        client: of Dask.
        job: has a bundle.
        addresses: of the workers.

    Raises:
        ClusterError: a worker cannot unpack it, or does not keep it; or the scheduler is lost.
    """
    assert job.bundle is not None
    send_bundle(client, job.bundle, f"the scene {job.job.key!r}", job.deliveries, addresses)


def send_bundle(
    client: Any, bundle: Bundle, what: str, deliveries: Counter[str], addresses: Sequence[str]
) -> None:
    """Sends a bundle; a worker that lacks it nonetheless, after some attempts, is told of.

    Args:
        client: of Dask.
        bundle: with its data.
        what: it is, for people.
        deliveries: how often it was sent, by the worker's address; counted on.
        addresses: of the workers.

    Raises:
        ClusterError: as `deliver_bundle`.
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
            continue  # a look will tell whether the worker is lost
        if isinstance(error, BaseException):
            why = str(error) if isinstance(error, BurgError) else one_line(error)
            raise refusal(address, why)


WORKER_POLL_INTERVAL = 1.0
"""Seconds between checks for new and lost workers."""


class Dispatch:
    """Jobs under way on a cluster.

    Attributes:
        client: of Dask.
        limits: of the workers' children.
        cluster: the workers.
        jobs: those under way.
    """

    def __init__(self, client: Any, limits: WorkerLimits, maintain: Callable[[], None]) -> None:
        self.client = client
        self.limits = limits
        self._maintain = maintain
        self.cluster = ClusterWorkers(client)
        self.jobs: list[SentJob] = []
        self._name = f"burg-drake-{uuid.uuid4().hex}"
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._sent: dict[Any, tuple[SentChunk, ClusterWorker]] = {}
        self._coming: Iterator[Job | None] = iter(())
        self._on_failure: OnFailure | None = None
        self._exhausted = False
        self._seen = -WORKER_POLL_INTERVAL
        self._waiting = WorkerWait(client)

    def run(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None
    ) -> Generator[Answer, None, None]:
        """See `executor.Executor.judge`."""
        self._coming, self._on_failure = iter(jobs), on_failure
        register_plugin(self.client, self.cluster, Supervisor(self._name))
        try:
            while True:
                if time.monotonic() > self._seen + WORKER_POLL_INTERVAL:
                    yield from self.update_workers()
                self.hand_out()
                if not self._sent and not any(job.left for job in self.jobs):
                    if self.take_up() is not None:
                        continue
                    if self._exhausted:
                        return
                yield from self.collect()
        finally:
            self.end()

    def update_workers(self) -> Iterator[Answer]:
        """Sees who is there."""
        self._maintain()
        for worker in self.cluster.update():
            yield from self.lose(worker)
        self._seen = time.monotonic()
        if self.cluster.workers:
            self._waiting.end()
        else:
            self._waiting.go_on()

    def hand_out(self) -> None:
        """Gives every worker what it has room for; those with the least come first."""
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
                    self.send(worker.job.cut(max(1, self.cluster.threads)), worker)

    def choose(self, worker: ClusterWorker) -> SentJob | None:
        """What a worker is to work on: its job, or the next one, or one that others are at."""
        if worker.job is not None and worker.job.left:
            return worker.job
        job = self.take_up()
        if job is not None:
            return job
        self.jobs = [job for job in self.jobs if job.left or job.sent]
        open_jobs = [job for job in self.jobs if job.left]
        return max(open_jobs, key=lambda job: job.left / (1 + job.sent), default=None)

    def take_up(self) -> SentJob | None:
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
        packed = Chunk(self._name, chunk.job.recipe, chunk.grasps, self.limits)
        with scheduler_errors(self.client):
            future = self.client.submit(
                judge_chunk,
                packed,
                key=f"grasps-{uuid.uuid4().hex}",
                pure=False,
                retries=0,
                workers=[worker.address],
                allow_other_workers=False,
            )
        chunk.future = future
        chunk.job.sent += 1
        worker.chunks.append(chunk)
        self._sent[future.key] = (chunk, worker)

        def finished(future: Any) -> None:  # in another thread
            chunk.done = True
            self._done.put(future)

        future.add_done_callback(finished)

    def collect(self) -> Iterator[Answer]:
        """Waits a while for what comes, and takes all that has come."""
        result_timeout = 3.0  # Seconds; the worker may be lost by now.
        try:
            futures = [self._done.get(timeout=WORKER_POLL_INTERVAL)]
        except queue.Empty:
            return
        while not self._done.empty():
            futures.append(self._done.get())
        missing: dict[str, tuple[SentJob, list[str]]] = {}
        for future in futures:
            if future.key not in self._sent:
                continue  # was taken back
            chunk, worker = self._sent[future.key]
            try:
                answers: ChunkAnswers = future.result(timeout=result_timeout)
            except KilledWorker:
                self.forget(chunk, worker)
                yield from self.doubt(chunk)
                continue
            except OSError:
                self._refetch(future, worker)
                continue
            except CancelledError:  # by the loss of the scheduler, or by somebody else
                answers = ChunkAnswers(ended=True)
            except Exception as error:
                raise ClusterError(f"worker {worker.address}: {one_line(error)}") from error
            self.forget(chunk, worker)
            if answers.ended:
                chunk.take_back()
                self._seen = -WORKER_POLL_INTERVAL
            elif answers.missing:
                chunk.take_back()
                missing.setdefault(chunk.job.recipe.bundle, (chunk.job, []))[1].append(
                    worker.address
                )
            elif not chunk.job.failed:
                yield from self.take(chunk, answers)
        for job, addresses in missing.values():
            there = [a for a in dict.fromkeys(addresses) if a in self.cluster.workers]
            deliver_bundle(self.client, job, there)

    def take(self, chunk: SentChunk, answers: ChunkAnswers) -> Iterator[Answer]:
        """Passes the verdicts of a chunk on."""
        job = chunk.job
        judged = set()
        for place, verdict in answers.verdicts:
            judged.add(place)
            yield job.job, chunk.grasps[place], verdict
            job.crashes_in_a_row = job.crashes_in_a_row + 1 if place in answers.crashing else 0
            if job.crashes_in_a_row >= self.limits.hopeless and not job.failed:
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
        yield from self.doubt(chunk, open_ones, "gave no answer about it")

    def lose(self, worker: ClusterWorker) -> Iterator[Answer]:
        """Takes back what a lost worker had; what it was at is sent again grasp by grasp."""
        suspects = [chunk for chunk in worker.chunks if not chunk.done][: worker.threads]
        for chunk in list(worker.chunks):
            self.forget(chunk, worker)
            chunk.future.cancel()
            if chunk in suspects:
                yield from self.doubt(chunk)
            else:
                chunk.take_back()

    def doubt(
        self,
        chunk: SentChunk,
        grasps: Sequence[Candidate] | None = None,
        what: str = "were lost while working on it",
    ) -> Iterator[Answer]:
        """Deals with grasps at which a worker was lost, or which it has not answered.

        Args:
            chunk: that it had.
            grasps: those of the chunk; all if None.
            what: the last worker did, for people.
        """
        for grasp in chunk.suspect(chunk.grasps if grasps is None else grasps):
            reason = (
                f"{ChunkSettings.max_losses} workers of the cluster {what}, one after the other"
            )
            failed = Outcome.SIMULATION_FAILED
            yield (
                chunk.job.job,
                grasp,
                Verdict(failed, Stage.CLEAR, reason=reason, interrupted=True),
            )

    def forget(self, chunk: SentChunk, worker: ClusterWorker) -> None:
        """A worker does not have a chunk any more."""
        del self._sent[chunk.future.key]
        worker.chunks.remove(chunk)
        chunk.job.sent -= 1

    def fail(self, job: SentJob, error: BurgError) -> None:
        """Gives a job up, and tells of it once."""
        if not job.failed:
            job.give_up()
            self._report_failure(JobFailed(job.job, error))

    def _report_failure(self, failure: JobFailed) -> None:
        if self._on_failure is None:
            raise failure.error
        self._on_failure(failure)

    def _refetch(self, future: Any, worker: ClusterWorker) -> None:
        """A result did not come: the worker is lost, which a look will tell, or is busy."""
        if self.client.status != "running":
            raise lost_scheduler_error(self.client)
        if worker.address in self.cluster.workers:
            self._done.put(future)
        self._seen = -WORKER_POLL_INTERVAL

    def end(self) -> None:
        """Ends the children of this run."""
        futures = [chunk.future for chunk, _ in self._sent.values()]
        self._sent.clear()
        self._waiting.end()
        end_run(self.client, self._name, futures)
