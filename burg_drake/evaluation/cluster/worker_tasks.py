"""Tasks that run in a Dask worker: child processes judge chunks of grasps, or call functions."""

from __future__ import annotations

import pickle
import platform
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from distributed import WorkerPlugin, get_worker

from burg_drake.core import (
    BurgError,
    DeviceError,
    SimulationError,
    Verdict,
    WorkerPool,
    one_line,
)
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.unpacked_bundle import JudgeRecipe, bundle_folder, unpack
from burg_drake.evaluation.executor import Job, JobFailed, JudgePool, WorkerLimits

CHILD_IDLE_TIMEOUT = 60.0
"""Seconds after which an idle child ends, as its driver may be gone."""


@dataclass(frozen=True, kw_only=True)
class TaskAnswer:
    """Result of a task, or why there is none.

    Attributes:
        missing: whether the task was not run because the bundle is not on this machine.
        ended: whether the task was not run to its end because the worker closes or the run has
            ended.
        error: error of the call, end of its process, or reason why the judge could not be built.
    """

    missing: bool = False
    ended: bool = False
    error: BurgError | None = None


@dataclass(frozen=True)
class ChunkAnswers(TaskAnswer):
    """Verdicts of a chunk.

    Attributes:
        verdicts: index in the chunk and verdict of each grasp, in the order of completion.
        crashing: indices of the grasps at which the child crashes.
    """

    verdicts: Sequence[tuple[int, Verdict]] = ()
    crashing: frozenset[int] = frozenset()


@dataclass(frozen=True)
class CallAnswer(TaskAnswer):
    """Result of a call.

    Attributes:
        result: the function's result, pickled.
    """

    result: bytes = b""


@dataclass(frozen=True)
class ClusterTask(ABC):
    """Work for a worker.

    Attributes:
        run: name of the plugin whose child runs the task.
        bundle: name of the required bundle; empty if none.
    """

    run: str
    bundle: str

    @abstractmethod
    def execute(self, children: Supervisor, folder: Path | None) -> TaskAnswer:
        """Runs the task in a child.

        Args:
            children: children of this worker.
            folder: folder of the bundle; None if none is needed.
        """


@dataclass(frozen=True)
class GraspChunk(ClusterTask):
    """Grasps for a worker.

    Attributes:
        recipe: how to build the judge.
        grasps: grasps of one job.
        limits: time and memory limits of the child.
    """

    recipe: JudgeRecipe
    grasps: tuple[Candidate, ...]
    limits: WorkerLimits

    def execute(self, children: Supervisor, folder: Path | None) -> ChunkAnswers:
        """See `ClusterTask.execute`."""
        make_judge = replace(self.recipe, folder=folder)
        return children.judge(Job(self.recipe.key, make_judge, self.grasps), self.limits)


@dataclass(frozen=True)
class ClusterCall(ClusterTask):
    """A call for a worker.

    Attributes:
        work: the function and its first argument, pickled; the second one is the bundle's folder.
    """

    work: bytes

    def execute(self, children: Supervisor, folder: Path | None) -> CallAnswer:
        """See `ClusterTask.execute`."""
        assert folder is not None
        return children.call(self.work, folder)


class _Child(Protocol):
    """A child process, started on demand."""

    def stop(self) -> None:
        """Ends the child at once, and any call of another thread that waits for it."""

    def release(self) -> None:
        """Lets the idle child end by itself."""


class _CallingChild:
    """A child that calls functions. A call that ends its process is not repeated."""

    def __init__(self) -> None:
        self._pool = WorkerPool(1, retries=0, own_group=True)
        self.stop, self.release = self._pool.kill_workers, self._pool.shutdown

    def call(self, work: bytes, folder: Path) -> bytes:
        """Makes a call; see `ClusterCall`."""
        return self._pool.submit(call_pickled, work, folder).result()


class Supervisor(WorkerPlugin):
    """Children of a worker for one run: each judges grasps with its own judge, or calls functions.
    They end with the run, or after a while without work.

    Attributes:
        name: name of the plugin; see `Dispatch.name`.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __getstate__(self) -> dict[str, Any]:
        return {"name": self.name}

    def setup(self, worker: Any) -> None:
        """Called by Dask as the worker starts, or as the plugin is registered."""
        self._lock = threading.Lock()
        self._stopped = False
        self._busy: list[_Child] = []
        self._idle: dict[_Child, threading.Timer] = {}

    def teardown(self, worker: Any) -> None:
        """Called by Dask as the worker closes, or as the run ends."""
        with self._lock:
            self._stopped = True
            for child in self._busy:
                child.stop()
            idle, self._idle = self._idle, {}
        for child, timer in idle.items():
            timer.cancel()
            child.stop()

    def judge(self, job: Job, limits: WorkerLimits) -> ChunkAnswers:
        """Has a child judge the grasps of a job."""
        failed: list[JobFailed] = []
        places = {id(grasp): k for k, grasp in enumerate(job.candidates)}
        with self._child(lambda: JudgePool(1, limits)) as pool:
            if pool is None:
                return ChunkAnswers(ended=True)
            pool.crashing.clear()
            found: list[tuple[int, Verdict]] = []
            try:
                for _, grasp, verdict in pool.run([job], failed.append):
                    found.append((places[id(grasp)], verdict))
            except DeviceError as error:
                failed.append(JobFailed(job, DeviceError(f"{error}, on {platform.node()}")))
            except SimulationError:
                if not pool.stopped:
                    raise
                return ChunkAnswers(ended=True)
            crashing = set(pool.crashing)
        return ChunkAnswers(
            found,
            frozenset(k for k, grasp in enumerate(job.candidates) if grasp.id in crashing),
            error=failed[0].error if failed else None,
        )

    def call(self, work: bytes, folder: Path) -> CallAnswer:
        """Has a child make a call; see `ClusterCall`."""
        with self._child(_CallingChild) as child:
            if child is None:
                return CallAnswer(ended=True)
            try:
                return CallAnswer(child.call(work, folder))
            except Exception as error:
                if self._stopped:
                    return CallAnswer(ended=True)
                if isinstance(error, BurgError):
                    return CallAnswer(error=error)
                return CallAnswer(error=SimulationError(one_line(error)))

    @contextmanager
    def _child(self, make: Callable[[], Any]) -> Iterator[Any]:
        """Context manager that lends an idle or new child; None if the run has ended."""
        with self._lock:
            child = None
            if not self._stopped:
                if self._idle:
                    child, timer = self._idle.popitem()
                    timer.cancel()
                else:
                    child = make()
                self._busy.append(child)
        try:
            yield child
        finally:
            with self._lock:
                if child is not None and not self._stopped:
                    self._busy.remove(child)
                    self._idle[child] = timer = threading.Timer(
                        CHILD_IDLE_TIMEOUT, self._end_if_idle, [child]
                    )
                    timer.daemon = True
                    timer.start()

    def _end_if_idle(self, child: _Child) -> None:
        with self._lock:
            if self._idle.pop(child, None) is None:
                return
        child.release()


def call_pickled(work: bytes, folder: Path) -> bytes:
    """Makes a call; runs in the child."""
    function, argument = pickle.loads(work)
    return pickle.dumps(function(argument, folder))


def run_task(task: ClusterTask) -> TaskAnswer:
    """Runs a task in a worker; the function that Dask calls."""
    worker = get_worker()
    folder = None
    if task.bundle:
        folder = bundle_folder(bundles_parent(worker), task.bundle)
        if folder is None:
            return TaskAnswer(missing=True)
    supervisor: Supervisor | None = worker.plugins.get(task.run)
    return TaskAnswer(ended=True) if supervisor is None else task.execute(supervisor, folder)


def unpack_on_worker(data: bytes, name: str, dask_worker: Any = None) -> None:
    """Unpacks a bundle on a worker's machine; runs in the worker, see `Client.run`."""
    unpack(data, bundles_parent(dask_worker), name)


def bundles_parent(worker: Any) -> Path:
    """A folder that all workers of a machine share."""
    return Path(worker.local_directory).parent
