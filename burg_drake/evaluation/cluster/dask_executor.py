"""Judges jobs, and calls functions, on a Dask cluster."""

from __future__ import annotations

import contextlib
import logging
import queue
import socket
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from burg_drake.core import ClusterError, MissingDependencyError, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.bundle import Bundle
from burg_drake.evaluation.cluster.document import (
    ClusterDocument,
    read_cluster,
    require_safe_address,
    start_jobqueue,
)
from burg_drake.evaluation.cluster.node import LocalNodes
from burg_drake.evaluation.executor import Job, OnFailure, WorkerLimits

SCHEDULER_TIMEOUT = 5.0
"""Seconds until a scheduler must have answered."""

Work = TypeVar("Work")
Result = TypeVar("Result")


class DaskExecutor:
    """The workers of a cluster; see `executor.Executor`.

    Attributes:
        client: client of `distributed`.
        limits: limits of the workers' children.
        maintain: called from time to time during the work.
    """

    def __init__(
        self,
        client: Any,
        limits: WorkerLimits | None = None,
        maintain: Callable[[], None] | None = None,
    ) -> None:
        """Uses a connected cluster.

        Args:
            client: a `distributed.Client`; its connection must be safe, see `require_safe_address`.
            limits: limits of the workers' children; the defaults if None.
            maintain: called from time to time while grasps are judged, such as to restart workers;
                may be None.

        Raises:
            ClusterError: the connection is not encrypted and goes beyond this machine.
        """
        from burg_drake.evaluation.cluster.members import scheduler_errors

        address = client.scheduler.address if client.scheduler is not None else ""
        require_safe_address(address, "the scheduler at ")
        with scheduler_errors(client):  # its listening addresses may differ from the one used here
            require_safe_address(client.scheduler_info()["address"], "the scheduler listens at ")
        self.client = client
        self.limits = limits or WorkerLimits()
        self.maintain = maintain or (lambda: None)

    @property
    def workers(self) -> int:
        """Number of children that judge at a time in the present cluster."""
        from burg_drake.evaluation.cluster.members import threads_by_address

        return sum(threads_by_address(self.client).values())

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """See `executor.Executor.judge`.

        Raises:
            ClusterError: a worker has other software versions, or the scheduler is lost.
        """
        from burg_drake.evaluation.cluster.dispatch import Dispatch
        from burg_drake.evaluation.cluster.jobs import grasp_jobs

        # Each thread has one chunk in progress and one waiting.
        dispatch = Dispatch(self.client, self.maintain, chunks_per_thread=2)
        yield from dispatch.run(grasp_jobs(jobs, self.limits, on_failure))


def map_on_cluster(
    executor: DaskExecutor,
    function: Callable[[Any, Path], Result],
    work: Sequence[Work],
    bundle: Bundle,
    pack: Callable[[Work], Any],
) -> Generator[tuple[Work, Result | BaseException], None, None]:
    """Yields results of a function on the cluster in the order of completion, like
    `core.map_unordered`.

    Args:
        executor: the cluster.
        function: importable; called in a child process of a worker with the result of `pack` and
            the folder of the bundle.
        work: pieces of work, begun in this order.
        bundle: needed by all calls; sent to each machine once.
        pack: converts a piece of work to the argument that is sent; called when a worker is free.

    Yields:
        Each piece of work with its result or error: the function's or `pack`'s error, or the loss
        of several workers at it. Closing the iterator ends the children.

    Raises:
        ClusterError: a worker has other software versions, or the scheduler is lost.
    """
    from burg_drake.evaluation.cluster.dispatch import Dispatch
    from burg_drake.evaluation.cluster.jobs import CallJob

    jobs = iter([CallJob(function, work, bundle, pack)])
    yield from Dispatch(executor.client, executor.maintain).run(jobs)


@contextlib.contextmanager
def connect_cluster(cluster: str, limits: WorkerLimits | None = None) -> Iterator[DaskExecutor]:
    """Context manager that yields an executor on a cluster.

    Args:
        cluster: `local:4` starts four workers on this machine; `tls://HOST:PORT` is a running
            scheduler; else the path of a cluster file, see `document.ClusterDocument`.
        limits: limits of the workers' children; the defaults if None.

    Raises:
        MissingDependencyError: Dask is not installed.
        ClusterError: no scheduler is reached, or it is not safe.
        BurgError: see `read_cluster`.
    """
    asked = read_cluster(cluster)
    try:
        import dask
        import distributed
    except ImportError as error:
        raise MissingDependencyError(
            "a cluster needs Dask: pip install burg-drake[dask]"
        ) from error
    quiet = dask.config.set({"distributed.comm.timeouts.connect": f"{SCHEDULER_TIMEOUT:g}s"})
    with quiet, _silence_dask_log(), contextlib.ExitStack() as stack:
        maintain: Callable[[], None] | None = None
        where: Any
        security: Any = None
        if isinstance(asked, int):
            nodes = LocalNodes(asked)
            stack.callback(nodes.close)
            where, maintain = nodes.address, nodes.restart_workers
        elif asked.jobqueue is not None:
            security = _tls_security(distributed, asked)
            where = stack.enter_context(start_jobqueue(asked, security))
            security = where.security
        else:
            where, security = asked.address, _tls_security(distributed, asked)
        client = _make_client(distributed, where, security)
        stack.callback(_close_client, client)
        yield DaskExecutor(client, limits, maintain)


def _make_client(distributed: Any, where: Any, security: Any) -> Any:
    """A client of the scheduler. It connects in a thread, because Dask's own time-out does not
    cover a silent listener; the thread is then abandoned.
    """
    timeout_factor = 3  # A connection takes several steps, each with this timeout.
    made: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def make() -> None:
        options = {"timeout": SCHEDULER_TIMEOUT, "security": security, "set_as_default": False}
        try:
            made.put(distributed.Client(where, **options))
        except BaseException as error:
            made.put(error)

    threading.Thread(target=make, name="client", daemon=True).start()
    try:
        found = made.get(timeout=timeout_factor * SCHEDULER_TIMEOUT)
    except queue.Empty:
        found = TimeoutError("no answer")
    if isinstance(found, (OSError, TimeoutError, ValueError, RuntimeError, TypeError)):
        raise ClusterError(
            f"no Dask scheduler answered at {where} within {SCHEDULER_TIMEOUT:.0f} s: "
            f"{_connection_failure_reason(where, found)}"
        ) from found
    if isinstance(found, BaseException):
        raise found
    return found


def _connection_failure_reason(where: object, error: BaseException) -> str:
    """The reason for a failed connection, in one line.

    Args:
        where: the address, or a cluster object of Dask.
        error: Dask's error.
    """
    connect_timeout = 2.0  # Seconds.
    words = _innermost_error(error)
    if not isinstance(where, str):
        return words
    parts = urlsplit(where)
    place = (parts.hostname or "", parts.port or 0)
    try:
        socket.create_connection(place, timeout=connect_timeout).close()
    except ConnectionRefusedError:
        return "nobody listens there (connection refused)"
    except socket.gaierror:
        return f"there is no machine with the name {parts.hostname}"
    except TimeoutError:
        return "the machine does not answer; is it off, or does a firewall block the connection?"
    except OSError as refused:
        return refused.strerror or words
    return (
        "something listens there, but does not answer like a scheduler with "
        f"{parts.scheme}:// ({words})"
    )


def _innermost_error(error: BaseException) -> str:
    """Message of the innermost cause of an error."""
    words = type(error).__name__
    cause: BaseException | None = error
    while cause is not None:
        words = " ".join(str(cause).split()) or words
        cause = cause.__cause__
    return words


def _close_client(client: Any) -> None:
    with contextlib.suppress(Exception):  # the scheduler may be gone
        client.close(timeout=SCHEDULER_TIMEOUT)


def _tls_security(distributed: Any, document: ClusterDocument) -> Any:
    """TLS of the files that the cluster file names, or else of Dask's configuration."""
    files = document.tls
    if files is not None:
        parts = {
            f"tls_{role}_{part}": getattr(files, part)
            for role in ("client", "scheduler", "worker")
            for part in ("cert", "key")
        }
        return distributed.Security(tls_ca_file=files.ca, require_encryption=True, **parts)
    if document.address.startswith("tls://"):
        security = distributed.Security(require_encryption=True)
        if security.tls_ca_file is None:
            raise ClusterError(
                f"{document.address} needs certificates; name them in a cluster.yaml as"
                " tls: {ca: CA.pem, cert: CERT.pem, key: KEY.pem}, or in Dask's"
                " configuration as distributed.comm.tls"
            )
        return security
    return None


@contextlib.contextmanager
def _silence_dask_log() -> Iterator[None]:
    """Silences Dask's log of lost connections, which our errors report in one line."""
    # Dask's configuration gives the second log a level of its own
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)
