"""What runs in a worker of Dask for `cluster_map`: child processes call functions.

As in `remote`, Drake never runs in the worker itself, and nothing of a call is unpickled there.
"""

from __future__ import annotations

import pickle
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker

from burg_drake.core import BurgError, SimulationError, one_line
from burg_drake.core.workers import WorkerPool
from burg_drake.evaluation.cluster.bundles import bundle_folder
from burg_drake.evaluation.cluster.remote import IDLE, bundle_place


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
                self._timer = threading.Timer(IDLE, self._rest)
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
