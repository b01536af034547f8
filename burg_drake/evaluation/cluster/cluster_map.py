"""Calls of a function on the workers of a cluster, one for each piece of work, in any order."""

from __future__ import annotations

import pickle
import queue
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import KilledWorker

from burg_drake.core import BurgError, ClusterError, SimulationError, one_line
from burg_drake.evaluation.cluster.bundle import Bundle
from burg_drake.evaluation.cluster.dispatch import end_run, register_plugin, send_bundle
from burg_drake.evaluation.cluster.members import (
    ChunkSettings,
    ClusterWorkers,
    WorkerWait,
    lost_scheduler_error,
    scheduler_errors,
)
from burg_drake.evaluation.cluster.worker_tasks import (
    CallAnswer,
    CallChildren,
    ClusterCall,
    make_call,
)

CALL_POLL_INTERVAL = 1.0
"""Seconds between checks for new and lost workers."""


@dataclass(eq=False)
class SentCall:
    """Work that a worker has.

    Attributes:
        work: the work.
        losses: workers that were lost at it before.
        address: of the worker.
        future: of Dask.
        done: whether the worker has done it; the result may be lost with it nonetheless.
    """

    work: Any
    losses: int
    address: str
    future: Any
    done: bool = False


class ClusterMap:
    """Calls under way on a cluster; see `dask_executor.map_on_cluster`."""

    def __init__(
        self,
        client: Any,
        function: Callable[[Any, Path], Any],
        bundle: Bundle,
        pack: Callable[[Any], Any],
    ) -> None:
        self._client, self._function, self._bundle, self._pack = client, function, bundle, pack
        self._cluster = ClusterWorkers(client)
        self._name = f"burg-drake-{uuid.uuid4().hex}"
        self._open: deque[tuple[Any, int]] = deque()
        self._sent: dict[Any, SentCall] = {}
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._outcomes: deque[tuple[Any, Any]] = deque()
        self._deliveries: Counter[str] = Counter()
        self._ready: set[str] = set()
        self._waiting = WorkerWait(client)
        self._seen = -CALL_POLL_INTERVAL

    def run(
        self, work: Sequence[Any], maintain: Callable[[], None]
    ) -> Generator[tuple[Any, Any], None, None]:
        """Work with its results or errors, as they come.

        Args:
            work: the work.
            maintain: called from time to time, such as to restart workers.
        """
        self._open.extend((one, 0) for one in work)
        register_plugin(self._client, self._cluster, CallChildren(self._name))
        try:
            while self._open or self._sent or self._outcomes:
                if time.monotonic() > self._seen + CALL_POLL_INTERVAL:
                    maintain()
                    self._look()
                self._hand_out(self._cluster.workers)
                self._collect()
                while self._outcomes:
                    yield self._outcomes.popleft()
        finally:
            self._waiting.end()
            end_run(self._client, self._name, [sent.future for sent in self._sent.values()])

    def _look(self) -> None:
        """Sees who is there; what lost workers had is to be done by others."""
        lost = {worker.address for worker in self._cluster.update()}
        for key, sent in list(self._sent.items()):
            if sent.address in lost:
                del self._sent[key]
                sent.future.cancel()
                self._take_back(sent, blamed=not sent.done)
        self._seen = time.monotonic()
        if self._cluster.workers:
            self._waiting.end()
        else:
            self._waiting.go_on()

    def _hand_out(self, addresses: Collection[str]) -> None:
        """Gives every idle thread of some workers a call; the most idle worker comes first."""
        workers = self._cluster.workers
        room = Counter({a: workers[a].threads for a in addresses if a in workers})
        room.subtract(sent.address for sent in self._sent.values() if sent.address in room)
        while self._open and (most := room.most_common(1)) and most[0][1] > 0:
            address = most[0][0]
            room[address] -= self._send(*self._open.popleft(), address)

    def _send(self, work: Any, losses: int, address: str) -> bool:
        """Sends work to a worker; False if it cannot be packed."""
        try:
            packed = pickle.dumps((self._function, self._pack(work)))
        except BurgError as error:
            self._outcomes.append((work, error))
            return False
        with scheduler_errors(self._client):
            future = self._client.submit(
                make_call,
                ClusterCall(self._name, self._bundle.name, packed),
                key=f"call-{uuid.uuid4().hex}",
                pure=False,
                retries=0,
                workers=[address],
                allow_other_workers=False,
            )
        sent = SentCall(work, losses, address, future)
        self._sent[future.key] = sent

        def finished(future: Any) -> None:  # in another thread
            sent.done = True
            self._done.put(future)

        future.add_done_callback(finished)
        return True

    def _collect(self) -> None:
        """Waits a while for what comes, and takes all that has come."""
        if self._outcomes:
            return
        try:
            futures = [self._done.get(timeout=CALL_POLL_INTERVAL)]
        except queue.Empty:
            return
        while not self._done.empty():
            futures.append(self._done.get())
        done = [self._sent.pop(f.key) for f in futures if f.key in self._sent]
        self._hand_out(self._ready)  # they go on while results are on their way
        missing = [sent.address for sent in done if self._take(sent)]
        there = [a for a in dict.fromkeys(missing) if a in self._cluster.workers]
        what = "the files that its work needs"
        send_bundle(self._client, self._bundle, what, self._deliveries, there)

    def _take(self, sent: SentCall) -> bool:
        """Deals with what became of a call; whether the worker has to be sent the bundle first."""
        # Seconds; a result may have many megabytes, or its worker may be lost.
        result_timeout = 60.0
        try:
            answer: CallAnswer = sent.future.result(timeout=result_timeout)
        except KilledWorker:
            self._take_back(sent, blamed=True)
            return False
        except OSError:
            self._refetch(sent)
            return False
        except CancelledError:  # by the loss of the scheduler, or by somebody else
            answer = CallAnswer(ended=True)
        except Exception as error:
            raise ClusterError(f"worker {sent.address}: {one_line(error)}") from error
        if answer.missing or answer.ended:
            self._take_back(sent)
            self._seen = -CALL_POLL_INTERVAL
            return answer.missing
        self._ready.add(sent.address)
        found = pickle.loads(answer.result) if answer.error is None else answer.error
        self._outcomes.append((sent.work, found))
        return False

    def _refetch(self, sent: SentCall) -> None:
        """A result did not come: the worker is lost, or the network is slow."""
        if self._client.status != "running":
            raise lost_scheduler_error(self._client)
        self._look()
        if sent.address in self._cluster.workers:
            self._sent[sent.future.key] = sent
            self._done.put(sent.future)
        else:
            self._take_back(sent)

    def _take_back(self, sent: SentCall, *, blamed: bool = False) -> None:
        """Has work done by another worker, unless too many were lost at it."""
        losses = sent.losses + blamed
        if losses < ChunkSettings.max_losses:
            self._open.appendleft((sent.work, losses))
            return
        reason = (
            f"{losses} workers of the cluster were lost while working on it, one after the other"
        )
        self._outcomes.append((sent.work, SimulationError(reason)))
