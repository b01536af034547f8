"""Sends bundles, chunks of grasps and calls to the workers of a cluster, and collects results."""

from __future__ import annotations

import queue
import time
import uuid
from collections import Counter
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any

from distributed import KilledWorker

from burg_drake.core import BurgError, ClusterError, one_line
from burg_drake.evaluation.cluster.bundle import Bundle
from burg_drake.evaluation.cluster.jobs import ClusterJob, ClusterWorker, SentChunk
from burg_drake.evaluation.cluster.members import (
    CONNECTION_ERRORS,
    ClusterWorkers,
    WorkerWait,
    lost_scheduler_error,
    scheduler_errors,
)
from burg_drake.evaluation.cluster.worker_tasks import Supervisor, run_task, unpack_on_worker

DELIVERY_ATTEMPTS = 3
"""Number of times that a worker is sent a plugin or a bundle."""


def send_bundle(
    client: Any, bundle: Bundle, what: str, deliveries: Counter[str], addresses: Sequence[str]
) -> None:
    """Sends a bundle to workers.

    Args:
        client: client of Dask.
        bundle: bundle with its data.
        what: purpose of the bundle, for messages.
        deliveries: number of deliveries by the worker's address; updated.
        addresses: addresses of the workers.

    Raises:
        ClusterError: a worker cannot unpack the bundle, or lacks it after several attempts; or the
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


class Dispatch:
    """Work of one run on a cluster.

    Attributes:
        client: client of Dask.
        cluster: the workers.
        chunks_per_thread: chunks that a worker holds per thread, including waiting ones.
        name: name of the plugin that runs tasks on a worker.
        jobs: jobs with unfinished work.
        sent: chunks that workers have, by the key of their future.
    """

    def __init__(
        self, client: Any, maintain: Callable[[], None], chunks_per_thread: int = 1
    ) -> None:
        self.client = client
        self.cluster = ClusterWorkers(client)
        self.chunks_per_thread = chunks_per_thread
        self.name = f"burg-drake-{uuid.uuid4().hex}"
        self.jobs: list[ClusterJob] = []
        self.sent: dict[str, SentChunk] = {}
        self._maintain = maintain
        self._remaining_jobs: Iterator[ClusterJob | None] = iter(())
        self._exhausted = False
        self._answering: set[str] = set()
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._last_poll = -WORKER_POLL_INTERVAL
        self._waiting = WorkerWait(client)

    def run(self, jobs: Iterator[ClusterJob | None]) -> Generator[Any, None, None]:
        """Yields the results of jobs in the order of completion.

        Args:
            jobs: requested one by one when workers run out of work. None means that no job is ready
                yet and that the workers go on with the others.

        Raises:
            ClusterError: a worker has other software versions, or the scheduler is lost.
        """
        self._remaining_jobs = jobs
        self.begin()
        try:
            while True:
                if self.poll_is_due():
                    yield from self.update_workers()
                yield from self.send_chunks(self.cluster.workers)
                if not self.sent and not any(job.unsent_count for job in self.jobs):
                    if self.open_next_job() is not None:
                        continue
                    if self._exhausted:
                        return
                yield from self.collect()
        finally:
            self.end()

    def begin(self) -> None:
        """Registers the plugin of the run on all present and future workers. Workers that die
        meanwhile are ignored.

        Raises:
            ClusterError: see `ClusterWorkers.update`.
        """
        retry_interval = 1.0  # Seconds between attempts.
        for attempt in range(1, DELIVERY_ATTEMPTS + 1):
            self.cluster.update()  # refuses workers that do not know the plugin
            try:
                self.client.register_plugin(Supervisor(self.name), name=self.name)
                return
            except CONNECTION_ERRORS as error:
                if self.client.status != "running" or attempt == DELIVERY_ATTEMPTS:
                    raise lost_scheduler_error(self.client) from error
                time.sleep(retry_interval)

    def end(self) -> None:
        """Cancels all unfinished tasks, and ends the child processes of the run."""
        self._waiting.end()
        if self.client.status != "running":
            return
        try:
            self.client.cancel([chunk.future for chunk in self.sent.values()], force=True)
            self.client.unregister_worker_plugin(self.name)
        except CONNECTION_ERRORS:
            pass  # the scheduler is lost, and its workers end with it

    def poll_is_due(self) -> bool:
        """Whether it is time to check for new and lost workers."""
        return time.monotonic() > self._last_poll + WORKER_POLL_INTERVAL

    def request_poll(self) -> None:
        """Makes the next check for new and lost workers due."""
        self._last_poll = -WORKER_POLL_INTERVAL

    def update_workers(self) -> Iterator[Any]:
        """Adds new workers, and takes back the work of lost ones; yields the results of items that
        are given up.
        """
        self._maintain()
        for worker in self.cluster.update():
            yield from self.handle_lost_worker(worker)
        self._last_poll = time.monotonic()
        if self.cluster.workers:
            self._waiting.end()
        else:
            self._waiting.continue_wait()

    def handle_lost_worker(self, worker: ClusterWorker) -> Iterator[Any]:
        """Takes back the chunks of a lost worker; items of begun chunks are sent alone."""
        suspects = [chunk for chunk in worker.chunks if not chunk.done][: worker.threads]
        for chunk in list(worker.chunks):
            self.drop_chunk(chunk)
            chunk.future.cancel()
            if chunk in suspects:
                yield from chunk.job.retry_alone(chunk)
            else:
                chunk.job.take_back(chunk)

    def send_chunks(self, addresses: Collection[str]) -> Iterator[Any]:
        """Gives workers as many chunks as they have room for, the least loaded workers first.

        Args:
            addresses: addresses of the workers; other workers get no chunks.

        Yields:
            Results of items that cannot be sent.
        """
        places = max(1, self.chunks_per_thread * self.cluster.threads)
        there = self.cluster.workers
        while True:
            idle = [
                worker
                for worker in (there[address] for address in addresses if address in there)
                if len(worker.chunks) < self.chunks_per_thread * worker.threads
            ]
            for worker in idle:
                worker.job = self.choose_job(worker)
            idle = [worker for worker in idle if worker.job is not None]
            if not idle:
                return
            least = min(worker.load for worker in idle)
            for worker in idle:
                if worker.load <= least and worker.job is not None and worker.job.unsent_count:
                    yield from self.send(worker.job.take_chunk(places), worker)

    def choose_job(self, worker: ClusterWorker) -> ClusterJob | None:
        """The job for a worker: its current one, the next one, or one of other workers."""
        if worker.job is not None and worker.job.unsent_count:
            return worker.job
        job = self.open_next_job()
        if job is not None:
            return job
        self.jobs = [job for job in self.jobs if job.unsent_count or job.sent]
        open_jobs = [job for job in self.jobs if job.unsent_count]
        return max(open_jobs, key=lambda job: job.unsent_count / (1 + job.sent), default=None)

    def open_next_job(self) -> ClusterJob | None:
        """The next job, if one is ready."""
        for job in self._remaining_jobs:
            if job is not None:  # None: no job is ready yet
                self.jobs.append(job)
            return job
        self._exhausted = True
        return None

    def send(self, chunk: SentChunk, worker: ClusterWorker) -> Iterator[Any]:
        """Sends a chunk to a worker; yields the results of items that cannot be sent."""
        try:
            task = chunk.job.task(self.name, chunk.items)
        except BurgError as error:
            for item in chunk.items:
                yield chunk.job.failure(item, error)
            return
        with scheduler_errors(self.client):
            chunk.future = self.client.submit(
                run_task,
                task,
                key=f"{type(task).__name__}-{uuid.uuid4().hex}",
                pure=False,
                retries=0,
                workers=[worker.address],
                allow_other_workers=False,
            )
        chunk.worker = worker
        self.note_sent(chunk)

        def finish(future: Any) -> None:  # in another thread
            chunk.done = True
            self._ended.put(future)

        chunk.future.add_done_callback(finish)

    def note_sent(self, chunk: SentChunk) -> None:
        """Notes that a worker has a chunk."""
        self.sent[chunk.future.key] = chunk
        chunk.worker.chunks.append(chunk)
        chunk.job.sent += 1

    def drop_chunk(self, chunk: SentChunk) -> None:
        """Notes that no worker has a chunk any more."""
        del self.sent[chunk.future.key]
        chunk.worker.chunks.remove(chunk)
        chunk.job.sent -= 1

    def collect(self) -> Iterator[Any]:
        """Waits a while for answers, and yields the results of all answers received."""
        missing: dict[str, tuple[ClusterJob, list[str]]] = {}
        ended = self.wait_for_chunks()
        for chunk in ended:
            self.drop_chunk(chunk)
        yield from self.send_chunks(self._answering)  # workers go on while results are transferred
        for chunk in ended:
            job, address = chunk.job, chunk.worker.address
            try:
                answer = self.read_answer(chunk)
            except KilledWorker:
                yield from job.retry_alone(chunk)
                continue
            except OSError:
                self.retry_answer(chunk)
                continue
            if answer is None or answer.ended:
                job.take_back(chunk)
                self.request_poll()
            elif answer.missing:
                job.take_back(chunk)
                assert job.bundle is not None
                missing.setdefault(job.bundle.name, (job, []))[1].append(address)
            else:
                self._answering.add(address)
                if not job.failed:
                    yield from job.read_answer(chunk, answer)
        for job, addresses in missing.values():
            there = [a for a in dict.fromkeys(addresses) if a in self.cluster.workers]
            assert job.bundle is not None
            send_bundle(self.client, job.bundle, job.what, job.deliveries, there)

    def wait_for_chunks(self) -> list[SentChunk]:
        """Waits a while for a task to end, and returns the chunks of all ended tasks."""
        try:
            futures = [self._ended.get(timeout=WORKER_POLL_INTERVAL)]
        except queue.Empty:
            return []
        while not self._ended.empty():
            futures.append(self._ended.get())
        return [self.sent[f.key] for f in futures if f.key in self.sent]

    def read_answer(self, chunk: SentChunk) -> Any:
        """The answer of a task that has ended; None if it was cancelled.

        Raises:
            KilledWorker: the worker of the chunk was lost.
            OSError: the answer does not arrive within the time-out; see `retry_answer`.
            ClusterError: the task failed.
        """
        try:
            return chunk.future.result(timeout=chunk.job.result_timeout)
        except (KilledWorker, OSError):
            raise
        except CancelledError:  # by the loss of the scheduler, or by another client
            return None
        except Exception as error:
            raise ClusterError(f"worker {chunk.worker.address}: {one_line(error)}") from error

    def retry_answer(self, chunk: SentChunk) -> None:
        """Schedules another attempt to read an answer whose worker is busy or lost.

        Raises:
            ClusterError: the scheduler is lost.
        """
        if self.client.status != "running":
            raise lost_scheduler_error(self.client)
        self.note_sent(chunk)
        if chunk.worker.address in self.cluster.workers:
            self._ended.put(chunk.future)
        self.request_poll()
