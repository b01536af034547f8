"""Tasks that run in a Dask worker: child processes judge chunks of grasps, or call functions."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker

from burg_drake.core import BurgError, SimulationError, Verdict, WorkerPool, one_line
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.unpacked_bundle import JudgeRecipe, bundle_folder, unpack
from burg_drake.evaluation.executor import Job, JobFailed, JudgePool, WorkerLimits

CHILD_IDLE_TIMEOUT = 60.0
"""Seconds after which a child without work ends, as its driver may be gone."""


@dataclass(frozen=True)
class Chunk:
    """Grasps for a worker.

    Attributes:
        run: name of the plugin whose child judges them.
        recipe: how to build the judge.
        grasps: of one job.
        limits: what the child may take.
    """

    run: str
    recipe: JudgeRecipe
    grasps: tuple[Candidate, ...]
    limits: WorkerLimits


@dataclass(frozen=True)
class ChunkAnswers:
    """Verdicts of a chunk, or why there are none.

    Attributes:
        verdicts: in the order of completion, with the place of the grasp in the chunk.
        crashing: places of the grasps at which the child crashes.
        missing: whether the bundle is not on this machine, and nothing was done.
        ended: whether the worker closes or the run has ended, and nothing is known.
        error: why the judge could not be built, if so.
    """

    verdicts: Sequence[tuple[int, Verdict]] = ()
    crashing: frozenset[int] = frozenset()
    missing: bool = False
    ended: bool = False
    error: BurgError | None = None


class RunPlugin(WorkerPlugin):
    """What a worker keeps for one run: child processes, which end when nobody needs them.

    Attributes:
        name: of the run.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __getstate__(self) -> dict[str, Any]:
        return {"name": self.name}

    def setup(self, worker: Any) -> None:
        """Called by Dask as the worker starts, or as the plugin is registered."""
        self._lock = threading.Lock()
        self._stopped = False


def _start_idle_timer(function: Callable[..., None], *arguments: Any) -> threading.Timer:
    """Calls a function after the idle time-out, unless the timer is cancelled."""
    timer = threading.Timer(CHILD_IDLE_TIMEOUT, function, arguments)
    timer.daemon = True
    timer.start()
    return timer


class Supervisor(RunPlugin):
    """Children of a worker that judge grasps, each with a judge of its own."""

    def setup(self, worker: Any) -> None:
        """Called by Dask as the worker starts, or as the plugin is registered."""
        super().setup(worker)
        self._pools: list[JudgePool] = []
        self._idle: list[JudgePool] = []
        self._timers: dict[int, threading.Timer] = {}

    def teardown(self, worker: Any) -> None:
        """Called by Dask as the worker closes, or as the run ends."""
        with self._lock:
            self._stopped = True
            for timer in self._timers.values():
                timer.cancel()
            for pool in self._pools:
                pool.stop()
            idle, self._idle = self._idle, []
        for pool in idle:
            pool.kill()

    def judge(self, job: Job, limits: WorkerLimits) -> ChunkAnswers:
        """Has a child judge the grasps of a job."""
        pool = self._take_pool(limits)
        if pool is None:
            return ChunkAnswers(ended=True)
        failed: list[JobFailed] = []
        places = {id(grasp): k for k, grasp in enumerate(job.candidates)}
        pool.crashing.clear()
        try:
            found = [
                (places[id(grasp)], verdict) for _, grasp, verdict in pool.run([job], failed.append)
            ]
        except SimulationError:
            if not pool.stopped:
                raise
            return ChunkAnswers(ended=True)
        finally:
            self._return_pool(pool)
        ids = [grasp.id for grasp in job.candidates]
        return ChunkAnswers(
            found,
            frozenset(ids.index(id) for id in pool.crashing),
            error=failed[0].error if failed else None,
        )

    def _take_pool(self, limits: WorkerLimits) -> JudgePool | None:
        with self._lock:
            if self._stopped:
                return None
            if self._idle:
                pool = self._idle.pop()
                self._timers.pop(id(pool)).cancel()
            else:
                pool = JudgePool(1, limits)
                self._pools.append(pool)
            return pool

    def _return_pool(self, pool: JudgePool) -> None:
        with self._lock:
            if self._stopped:
                return
            self._idle.append(pool)
            self._timers[id(pool)] = _start_idle_timer(self._end_if_idle, pool)

    def _end_if_idle(self, pool: JudgePool) -> None:
        with self._lock:
            if pool not in self._idle:
                return
            self._idle.remove(pool)
            self._pools.remove(pool)
            del self._timers[id(pool)]
        pool.release()


def judge_chunk(chunk: Chunk) -> ChunkAnswers:
    """The task of Dask."""
    worker = get_worker()
    make_judge = chunk.recipe.load(bundle_place(worker))
    if make_judge is None:
        return ChunkAnswers(missing=True)
    supervisor: Supervisor | None = worker.plugins.get(chunk.run)
    if supervisor is None:
        return ChunkAnswers(ended=True)
    return supervisor.judge(Job(chunk.recipe.key, make_judge, chunk.grasps), chunk.limits)


def unpack_on_worker(data: bytes, name: str, dask_worker: Any = None) -> None:
    """Unpacks a bundle on a worker's machine; runs in the worker, see `Client.run`."""
    unpack(data, bundle_place(dask_worker), name)


def bundle_place(worker: Any) -> Path:
    """A folder that all workers of a machine share."""
    return Path(worker.local_directory).parent


@dataclass(frozen=True)
class ClusterCall:
    """A call for a worker.

    Attributes:
        run: name of the plugin whose child makes it.
        bundle: name of the bundle whose folder the function is told.
        work: the function and its first argument, pickled.
    """

    run: str
    bundle: str
    work: bytes


@dataclass(frozen=True)
class CallAnswer:
    """Result of a call, or why there is none.

    Attributes:
        result: of the function, pickled.
        error: that it has raised, or that has ended its process.
        missing: whether the bundle is not on this machine, and nothing was done.
        ended: whether the worker closes or the run has ended, and nothing is known.
    """

    result: bytes = b""
    error: BurgError | None = None
    missing: bool = False
    ended: bool = False


class CallChildren(RunPlugin):
    """Children of a worker that call functions, one for each of its threads."""

    def setup(self, worker: Any) -> None:
        """Called by Dask as the worker starts, or as the plugin is registered."""
        super().setup(worker)
        self._threads: int = worker.state.nthreads
        self._pool: WorkerPool | None = None
        self._calls = 0
        self._timer: threading.Timer | None = None

    def teardown(self, worker: Any) -> None:
        """Called by Dask as the worker closes, or as the run ends."""
        with self._lock:
            self._stopped = True
            if self._timer is not None:
                self._timer.cancel()
            pool, self._pool = self._pool, None
        if pool is not None:
            pool.kill_workers()

    def call(self, work: bytes, folder: Path) -> CallAnswer:
        """Has a child make a call. What ends the child is not tried again.

        Args:
            work: see `ClusterCall`.
            folder: of the bundle.
        """
        pool = self._begin_call()
        if pool is None:
            return CallAnswer(ended=True)
        try:
            return CallAnswer(pool.submit(call_pickled, work, folder).result())
        except Exception as error:
            if self._stopped:
                return CallAnswer(ended=True)
            if isinstance(error, BurgError):
                return CallAnswer(error=error)
            return CallAnswer(error=SimulationError(one_line(error)))
        finally:
            self._end_call()

    def _begin_call(self) -> WorkerPool | None:
        with self._lock:
            if self._stopped:
                return None
            if self._timer is not None:
                self._timer.cancel()
            self._calls += 1
            if self._pool is None:
                self._pool = WorkerPool(self._threads, retries=0, own_group=True)
            return self._pool

    def _end_call(self) -> None:
        with self._lock:
            self._calls -= 1
            if self._calls == 0 and not self._stopped:
                self._timer = _start_idle_timer(self._end_if_idle)

    def _end_if_idle(self) -> None:
        """Ends idle children, as their driver may be gone."""
        with self._lock:
            if self._calls:
                return
            pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown()


def call_pickled(work: bytes, folder: Path) -> bytes:
    """Makes a call; runs in the child."""
    function, argument = pickle.loads(work)
    return pickle.dumps(function(argument, folder))


def make_call(call: ClusterCall) -> CallAnswer:
    """The task of Dask."""
    worker = get_worker()
    folder = bundle_folder(bundle_place(worker), call.bundle)
    if folder is None:
        return CallAnswer(missing=True)
    children: CallChildren | None = worker.plugins.get(call.run)
    if children is None:
        return CallAnswer(ended=True)
    return children.call(call.work, folder)
