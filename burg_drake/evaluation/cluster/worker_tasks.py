"""Tasks that run in a Dask worker: child processes judge chunks of grasps, or call functions."""

from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Sequence
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
    """What became of a chunk.

    Attributes:
        verdicts: in the order of completion, with the place of the grasp in the chunk.
        crashing: places of the grasps whose outcome is that they end the child.
        seconds: time that it took.
        missing: whether the bundle is not on this machine, and nothing was done.
        ended: whether the worker closes or the run has ended, and nothing is known.
        error: why the judge could not be built, if so.
    """

    verdicts: Sequence[tuple[int, Verdict]] = ()
    crashing: frozenset[int] = frozenset()
    seconds: float = 0.0
    missing: bool = False
    ended: bool = False
    error: BurgError | None = None


class Supervisor(WorkerPlugin):
    """The children of one worker, for one run.

    Attributes:
        name: of the run.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __getstate__(self) -> dict[str, Any]:
        return {"name": self.name}

    def setup(self, worker: Any) -> None:
        """Called by Dask as the worker starts, or as the plugin is registered."""
        self._pools: list[JudgePool] = []
        self._idle: list[JudgePool] = []
        self._lock = threading.Lock()
        self._timers: dict[int, threading.Timer] = {}
        self._stopped = False

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
        pool = self._take(limits)
        if pool is None:
            return ChunkAnswers(ended=True)
        start, failed = time.monotonic(), list[JobFailed]()
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
            self._give_back(pool)
        ids = [grasp.id for grasp in job.candidates]
        return ChunkAnswers(
            found,
            frozenset(ids.index(id) for id in pool.crashing),
            time.monotonic() - start,
            error=failed[0].error if failed else None,
        )

    def _take(self, limits: WorkerLimits) -> JudgePool | None:
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

    def _give_back(self, pool: JudgePool) -> None:
        with self._lock:
            if self._stopped:
                return
            self._idle.append(pool)
            timer = threading.Timer(CHILD_IDLE_TIMEOUT, self._end, [pool])
            timer.daemon = True
            self._timers[id(pool)] = timer
            timer.start()

    def _end(self, pool: JudgePool) -> None:
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
    """What became of a call.

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


class CallChildren(WorkerPlugin):
    """The children of one worker, for one run: one for each of its threads.

    Attributes:
        name: of the run.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __getstate__(self) -> dict[str, Any]:
        return {"name": self.name}

    def setup(self, worker: Any) -> None:
        """Called by Dask as the worker starts, or as the plugin is registered."""
        self._threads: int = worker.state.nthreads
        self._pool: WorkerPool | None = None
        self._calls = 0
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._stopped = False

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
        pool = self._begin()
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
            self._end()

    def _begin(self) -> WorkerPool | None:
        with self._lock:
            if self._stopped:
                return None
            if self._timer is not None:
                self._timer.cancel()
            self._calls += 1
            if self._pool is None:
                self._pool = WorkerPool(self._threads, retries=0, own_group=True)
            return self._pool

    def _end(self) -> None:
        with self._lock:
            self._calls -= 1
            if self._calls == 0 and not self._stopped:
                self._timer = threading.Timer(CHILD_IDLE_TIMEOUT, self._rest)
                self._timer.daemon = True
                self._timer.start()

    def _rest(self) -> None:
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
