"""What runs in a worker of Dask: it hands chunks of grasps to a child process and waits.

Drake never runs in the worker itself, whose death would cost Dask seconds and the chunks of others.
Each thread of a worker has one child, in which judges stay built from one chunk to the next.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker

from burg_drake.core import BurgError, SimulationError
from burg_drake.core.grasps import Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.bundles import JudgeRecipe, unpack
from burg_drake.evaluation.workers import Job, JobFailed, JudgePool, WorkerLimits

IDLE = 60.0
"""A child without work ends after that time, as its driver may be gone [s]."""


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
class Answers:
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

    def judge(self, job: Job, limits: WorkerLimits) -> Answers:
        """Has a child judge the grasps of a job."""
        pool = self._take(limits)
        if pool is None:
            return Answers(ended=True)
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
            return Answers(ended=True)
        finally:
            self._give_back(pool)
        ids = [grasp.id for grasp in job.candidates]
        return Answers(
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
            timer = threading.Timer(IDLE, self._end, [pool])
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


def judge_chunk(chunk: Chunk) -> Answers:
    """The task of Dask."""
    worker = get_worker()
    make_judge = chunk.recipe.load(bundle_place(worker))
    if make_judge is None:
        return Answers(missing=True)
    supervisor: Supervisor | None = worker.plugins.get(chunk.run)
    if supervisor is None:
        return Answers(ended=True)
    return supervisor.judge(Job(chunk.recipe.key, make_judge, chunk.grasps), chunk.limits)


def deliver(data: bytes, name: str, dask_worker: Any = None) -> None:
    """Unpacks a bundle on a worker's machine; runs in the worker, see `Client.run`."""
    unpack(data, bundle_place(dask_worker), name)


def bundle_place(worker: Any) -> Path:
    """A folder that all workers of a machine share."""
    return Path(worker.local_directory).parent
