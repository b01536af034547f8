"""Calls of a function on the workers of a cluster, one for each piece of work, in any order."""

from __future__ import annotations

import pickle
from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import KilledWorker

from burg_drake.core import BurgError, SimulationError
from burg_drake.evaluation.cluster.bundle import Bundle
from burg_drake.evaluation.cluster.dispatch import ClusterRun, send_bundle
from burg_drake.evaluation.cluster.members import ChunkSettings, ClusterWorker, SentTask
from burg_drake.evaluation.cluster.worker_tasks import (
    CallAnswer,
    CallChildren,
    ClusterCall,
    make_call,
)

Outcomes = Iterator[tuple[Any, Any]]
"""Work with its results or errors."""


@dataclass(eq=False)
class SentCall(SentTask):
    """Work that a worker has.

    Attributes:
        work: the work.
        losses: workers that were lost at it before.
    """

    work: Any
    losses: int


class ClusterMap(ClusterRun[SentCall]):
    """Calls under way on a cluster; see `dask_executor.map_on_cluster`."""

    def __init__(
        self,
        client: Any,
        function: Callable[[Any, Path], Any],
        bundle: Bundle,
        pack: Callable[[Any], Any],
        maintain: Callable[[], None],
    ) -> None:
        super().__init__(client, maintain)
        self._function, self._bundle, self._pack = function, bundle, pack
        self._open: deque[tuple[Any, int]] = deque()
        self._deliveries: Counter[str] = Counter()
        self._ready: set[str] = set()

    def run(self, work: Sequence[Any]) -> Generator[tuple[Any, Any], None, None]:
        """Yields work with its results or errors, as they come."""
        self._open.extend((one, 0) for one in work)
        self.begin(CallChildren(self.name))
        try:
            while self._open or self.sent:
                if self.poll_is_due():
                    yield from self.update_workers()
                yield from self._hand_out(self.cluster.workers)
                if self._open or self.sent:
                    yield from self._collect()
        finally:
            self.end()

    def handle_lost_worker(self, worker: ClusterWorker) -> Outcomes:
        """Has the work of a lost worker done by others."""
        for key, sent in list(self.sent.items()):
            if sent.worker is worker:
                del self.sent[key]
                sent.future.cancel()
                yield from self._take_back(sent, blamed=not sent.done)

    def _hand_out(self, addresses: Collection[str]) -> Outcomes:
        """Gives every idle thread of some workers a call; the most idle worker comes first."""
        workers = self.cluster.workers
        room = Counter({a: workers[a].threads for a in addresses if a in workers})
        busy = [sent.worker.address for sent in self.sent.values()]
        room.subtract(address for address in busy if address in room)
        while self._open and (most := room.most_common(1)) and most[0][1] > 0:
            address = most[0][0]
            work, losses = self._open.popleft()
            try:
                packed = pickle.dumps((self._function, self._pack(work)))
            except BurgError as error:
                yield work, error
                continue
            call = ClusterCall(self.name, self._bundle.name, packed)
            self.submit(make_call, call, SentCall(work, losses), workers[address])
            room[address] -= 1

    def _collect(self) -> Outcomes:
        """Waits a while for results, and yields all that have come."""
        ended = self.wait_for_tasks()
        for sent in ended:
            del self.sent[sent.future.key]
        yield from self._hand_out(self._ready)  # they go on while results are on their way
        missing = []
        for sent in ended:
            # Seconds; a result may have many megabytes, or its worker may be lost.
            result_timeout = 60.0
            try:
                answer: CallAnswer = self.read_answer(sent, result_timeout) or CallAnswer(
                    ended=True
                )
            except KilledWorker:
                yield from self._take_back(sent, blamed=True)
                continue
            except OSError:
                self.sent[sent.future.key] = sent
                self.retry_answer(sent)
                continue
            if answer.missing or answer.ended:
                missing += [sent.worker.address] * answer.missing
                yield from self._take_back(sent)
                self.poll_soon()
                continue
            self._ready.add(sent.worker.address)
            yield sent.work, pickle.loads(answer.result) if answer.error is None else answer.error
        there = [a for a in dict.fromkeys(missing) if a in self.cluster.workers]
        what = "the files that its work needs"
        send_bundle(self.client, self._bundle, what, self._deliveries, there)

    def _take_back(self, sent: SentCall, *, blamed: bool = False) -> Outcomes:
        """Has work done by another worker, unless too many were lost at it."""
        losses = sent.losses + blamed
        if losses < ChunkSettings.max_losses:
            self._open.appendleft((sent.work, losses))
            return
        reason = (
            f"{losses} workers of the cluster were lost while working on it, one after the other"
        )
        yield sent.work, SimulationError(reason)
