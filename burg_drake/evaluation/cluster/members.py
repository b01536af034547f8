"""Checks versions and addresses of a cluster's workers, and notices lost workers."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import functools
import time
import uuid
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import burg_drake
from burg_drake.core import (
    JUDGING_PACKAGES,
    BurgError,
    ClusterError,
    content_hash,
    one_line,
    software_versions,
)
from burg_drake.evaluation.cluster.document import require_safe_address
from burg_drake.evaluation.cluster.jobs import ClusterWorker
from burg_drake.station import ENGINES


@functools.cache
def deciding_versions() -> dict[str, str]:
    """Software versions by name, with a hash of burg_drake's code (unreleased versions differ)."""
    # Packages of all engines that affect verdicts or images.
    packages = {
        **JUDGING_PACKAGES,
        **{name: package for e in ENGINES.values() for name, package in e.packages.items()},
        "opencv": "opencv-python-headless",
    }
    code = code_hash(Path(burg_drake.__file__).parent)
    return {**software_versions(packages, with_platform=False), "code of burg_drake": code}


def code_hash(package: Path) -> str:
    """Hash of all files of an installed package that affect results."""
    code_suffixes = (".py", ".json")  # Modules and confidence curves.
    files = sorted(file for file in package.rglob("*") if file.suffix in code_suffixes)
    names = [file.relative_to(package).as_posix() for file in files]
    return content_hash(names, files)[:12]


def require_same_versions(workers: Mapping[str, Mapping[str, str] | BaseException]) -> None:
    """Refuses workers with other versions than ours.

    Args:
        workers: result or error of `deciding_versions` by the worker's address.

    Raises:
        ClusterError: names the first such worker, and how many there are.
    """
    ours = deciding_versions()
    refused = []
    for address, theirs in workers.items():
        if isinstance(theirs, BaseException):
            refused.append(f"worker {address} cannot run burg_drake ({one_line(theirs)})")
            continue
        other = [
            f"{name} {theirs.get(name, 'none')} (here {version})"
            for name, version in ours.items()
            if theirs.get(name) != version
        ]
        if other:
            refused.append(f"worker {address} has {', '.join(other)}")
    if refused:
        more = f", and {len(refused) - 1} more differ" if len(refused) > 1 else ""
        raise ClusterError(
            f"{refused[0]}{more}; results agree only if all machines have the same"
            " versions: install the same environment on all of them"
        )


CONNECTION_ERRORS = (
    OSError,  # with Dask's CommClosedError
    TimeoutError,
    asyncio.TimeoutError,
    concurrent.futures.CancelledError,
    asyncio.CancelledError,
)
"""Errors raised when the scheduler or worker is gone."""


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
        """Number of chunks that all workers process at a time."""
        return sum(worker.threads for worker in self.workers.values())

    def update(self) -> list[ClusterWorker]:
        """Adds new workers after checks of their versions and addresses.

        Returns:
            Lost workers.

        Raises:
            ClusterError: the scheduler is lost, or a worker has other versions or is not safe.
        """
        there = threads_by_address(self._client)
        lost = [worker for address, worker in self.workers.items() if address not in there]
        for worker in lost:
            del self.workers[worker.address]
        new = [address for address in there if address not in self.workers]
        for address in new:
            require_safe_address(address, "worker ")
        for address in check_versions(self._client, new):
            self.workers[address] = ClusterWorker(address, there[address])
        return lost


def threads_by_address(client: Any) -> dict[str, int]:
    """The workers that a scheduler has now.

    Raises:
        ClusterError: it does not answer.
    """
    answer_timeout = 20.0  # Seconds after which a scheduler that does not answer counts as lost.
    if client.status != "running":  # a restarted scheduler does not know this client
        raise lost_scheduler_error(client)
    with scheduler_errors(client):
        found: dict[str, int] = client.sync(
            client.scheduler.ncores, callback_timeout=answer_timeout
        )
        return found


@contextlib.contextmanager
def scheduler_errors(client: Any) -> Iterator[None]:
    """Converts errors of calls to the scheduler into a one-line error.

    Raises:
        ClusterError: it is lost.
    """
    try:
        yield
    except CONNECTION_ERRORS as error:
        raise lost_scheduler_error(client) from error
    except BurgError:
        raise
    except Exception as error:  # Dask has no class of its own for a client that was closed
        if client.status == "running":
            raise
        raise lost_scheduler_error(client) from error


def lost_scheduler_error(client: Any) -> ClusterError:
    """The error for a scheduler that does not answer."""
    address = client.scheduler.address if client.scheduler is not None else "the given address"
    return ClusterError(
        f"the scheduler at {address} does not answer any more; the results so far are"
        " kept: start a scheduler and run the same command to continue"
    )


def check_versions(client: Any, addresses: Iterable[str]) -> list[str]:
    """Checks the versions of workers; returns the addresses of the workers that still run.

    Raises:
        ClusterError: a worker has other versions, or the scheduler is lost.
    """
    addresses = list(addresses)
    if not addresses:
        return []
    with scheduler_errors(client):
        found = client.run(deciding_versions, workers=addresses, on_error="return")
    gone = {a for a, answer in found.items() if isinstance(answer, OSError)}  # died meanwhile
    require_same_versions({a: answer for a, answer in found.items() if a not in gone})
    return [a for a in addresses if a in found and a not in gone]


WORKER_TIMEOUT = 600.0
"""Seconds that a run waits without any worker."""


class WorkerWait:
    """Wait for workers. A task at the scheduler meanwhile tells Dask that workers are wanted."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._since: float | None = None
        self._call: Any = None

    def end(self) -> None:
        """Ends the wait, because there are workers or no work is left."""
        self._since = self._call = None

    def continue_wait(self) -> None:
        """Begins or continues the wait.

        Raises:
            ClusterError: there was no worker for too long, or the scheduler is lost.
        """
        if self._since is None:
            self._since = time.monotonic()
            with scheduler_errors(self._client):
                key = f"call-{uuid.uuid4().hex}"
                self._call = self._client.submit(int, key=key, pure=False)
        if time.monotonic() > self._since + WORKER_TIMEOUT:
            raise ClusterError(
                f"the scheduler at {self._client.scheduler.address} has had no worker for"
                f" {WORKER_TIMEOUT / 60:.0f} minutes; the results so far are kept: start"
                " workers and run the same command to continue"
            )
