"""The workers of a cluster that may be used, and what each of them has."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from burg_drake.core import BurgError, ClusterError
from burg_drake.evaluation.cluster.document import require_safe
from burg_drake.evaluation.cluster.sent_job import DEPTH, SentChunk, SentJob
from burg_drake.evaluation.cluster.versions import require_same, software

ANSWER = 20.0
"""A scheduler that does not answer for so long is lost [s]."""
LOST = (
    OSError,  # with Dask's CommClosedError
    TimeoutError,
    asyncio.TimeoutError,
    concurrent.futures.CancelledError,
    asyncio.CancelledError,
)
"""What is raised when the other side is gone."""


@dataclass(eq=False)
class ClusterWorker:
    """A worker.

    Attributes:
        address: where it is.
        threads: number of chunks that it works on at a time.
        chunks: those that it has, the first ones first.
        job: the one that it works on.
    """

    address: str
    threads: int
    chunks: list[SentChunk] = field(default_factory=list)
    job: SentJob | None = None

    @property
    def room(self) -> int:
        """Number of chunks that it may get."""
        return DEPTH * self.threads - len(self.chunks)

    @property
    def load(self) -> float:
        """Chunks a thread."""
        return len(self.chunks) / self.threads


class ClusterWorkers:
    """Workers by address.

    Attributes:
        workers: the workers.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self.workers: dict[str, ClusterWorker] = {}

    @property
    def threads(self) -> int:
        """Number of chunks that they work on at a time."""
        return sum(worker.threads for worker in self.workers.values())

    def update(self) -> list[ClusterWorker]:
        """Takes on new workers whose versions are ours and whose addresses are safe.

        Returns:
            Those that are gone.

        Raises:
            ClusterError: the scheduler is lost, or a worker has other versions or is not safe.
        """
        there = threads_by_address(self._client)
        lost = [worker for address, worker in self.workers.items() if address not in there]
        for worker in lost:
            del self.workers[worker.address]
        new = [address for address in there if address not in self.workers]
        for address in new:
            require_safe(address, "worker ")
        for address in admitted(self._client, new):
            self.workers[address] = ClusterWorker(address, there[address])
        return lost


def threads_by_address(client: Any) -> dict[str, int]:
    """The workers that a scheduler has now.

    Raises:
        ClusterError: it does not answer.
    """
    if client.status != "running":  # a scheduler that is started again knows nothing of us
        raise lost_scheduler(client)
    with scheduler_errors(client):
        found: dict[str, int] = client.sync(client.scheduler.ncores, callback_timeout=ANSWER)
        return found


@contextlib.contextmanager
def scheduler_errors(client: Any) -> Iterator[None]:
    """Around what asks the scheduler: its loss is said in one line.

    Raises:
        ClusterError: it is lost.
    """
    try:
        yield
    except LOST as error:
        raise lost_scheduler(client) from error
    except BurgError:
        raise
    except Exception as error:  # Dask has no class of its own for a client that was closed
        if client.status == "running":
            raise
        raise lost_scheduler(client) from error


def lost_scheduler(client: Any) -> ClusterError:
    """What is said when it does not answer."""
    address = client.scheduler.address if client.scheduler is not None else "the given address"
    return ClusterError(
        f"the scheduler at {address} does not answer any more; the results so far are"
        " kept: start a scheduler and run the same command to continue"
    )


def admitted(client: Any, addresses: Iterable[str]) -> list[str]:
    """Those of some workers that are still there, after a look at their versions.

    Raises:
        ClusterError: a worker has other versions, or the scheduler is lost.
    """
    addresses = list(addresses)
    if not addresses:
        return []
    with scheduler_errors(client):
        found = client.run(software, workers=addresses, on_error="return")
    gone = {a for a, answer in found.items() if isinstance(answer, OSError)}  # died meanwhile
    require_same({a: answer for a, answer in found.items() if a not in gone})
    return [a for a in addresses if a in found and a not in gone]
