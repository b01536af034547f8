"""Judges jobs, and calls functions, on a cluster of Dask."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from burg_drake.core import ClusterError, MissingDependencyError
from burg_drake.core.grasps import Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.bundles import Bundle
from burg_drake.evaluation.cluster.connection_failure import unreached_reason
from burg_drake.evaluation.cluster.document import Cluster, TlsFiles, read_cluster, require_safe
from burg_drake.evaluation.workers import Job, OnFailure, WorkerLimits

REACH = 5.0
"""Time in which a scheduler has to be reached [s]."""
HANDSHAKES = 3
"""So many times longer a connection may take whose steps all keep to that time."""
Work = TypeVar("Work")
Result = TypeVar("Result")


class DaskExecutor:
    """The workers of a cluster; see `executor.Executor`.

    Attributes:
        client: of `distributed`.
        limits: what the workers' children may take.
        maintain: called from time to time while they work.
    """

    def __init__(
        self,
        client: Any,
        limits: WorkerLimits | None = None,
        maintain: Callable[[], None] = lambda: None,
    ) -> None:
        """Uses a cluster that one is connected to.

        Args:
            client: a `distributed.Client`; what it is connected to has to be safe, see
                `require_safe`.
            limits: the usual ones if None.
            maintain: called from time to time while grasps are judged, such as to restart workers.

        Raises:
            ClusterError: the connection is not encrypted and goes beyond this machine.
        """
        from burg_drake.evaluation.cluster.members import scheduler_errors

        address = client.scheduler.address if client.scheduler is not None else ""
        require_safe(address, "the scheduler at ")
        with scheduler_errors(client):  # it may listen elsewhere, too, than where it was reached
            require_safe(client.scheduler_info()["address"], "the scheduler listens at ")
        self.client = client
        self.limits = limits or WorkerLimits()
        self.maintain = maintain

    @property
    def workers(self) -> int:
        """Number of children that judge at a time, as the cluster is now."""
        from burg_drake.evaluation.cluster.members import threads_by_address

        return sum(threads_by_address(self.client).values())

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """See `executor.Executor.judge`.

        Raises:
            ClusterError: a worker has other versions of what decides, or the scheduler is lost.
        """
        from burg_drake.evaluation.cluster.dispatch import Dispatch

        yield from Dispatch(self.client, self.limits, self.maintain).run(jobs, on_failure)


def map_on_cluster(
    executor: DaskExecutor,
    function: Callable[[Any, Path], Result],
    work: Sequence[Work],
    bundle: Bundle,
    pack: Callable[[Work], Any],
) -> Generator[tuple[Work, Result | BaseException], None, None]:
    """Results of a function as they come, as `core.workers.map_unordered` gives them.

    Args:
        executor: the cluster.
        function: importable; called in a child process of a worker with what `pack` gives and the
            folder of the bundle.
        work: what is to be done, begun in this order.
        bundle: which all calls need; each machine gets it once.
        pack: makes of work what is sent; called when a worker is free.

    Yields:
        The work, and the result or the error: of the function, of `pack`, or because workers were
        lost at it one after the other. Closing the iterator ends the children.

    Raises:
        ClusterError: a worker has other versions of what decides, or the scheduler is lost.
    """
    from burg_drake.evaluation.cluster.cluster_map import ClusterMap

    yield from ClusterMap(executor.client, function, bundle, pack).run(work, executor.maintain)


@contextlib.contextmanager
def connect_cluster(cluster: str, limits: WorkerLimits | None = None) -> Iterator[DaskExecutor]:
    """An executor on a cluster, until the block is left.

    Args:
        cluster: `local:4` starts four workers on this machine; `tls://HOST:PORT` is a scheduler
            that runs; else the path of a cluster file, see `document.ClusterDocument`.
        limits: what the workers' children may take; the usual ones if None.

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
    quiet = dask.config.set({"distributed.comm.timeouts.connect": f"{REACH:g}s"})
    with quiet, _without_its_log(), contextlib.ExitStack() as stack:
        maintain: Callable[[], None] = lambda: None  # noqa: E731
        where: Any
        security = _security(distributed, asked)
        if asked.local:
            from burg_drake.evaluation.cluster.local_nodes import LocalNodes

            nodes = LocalNodes(asked.local)
            stack.callback(nodes.close)
            where, maintain = nodes.address, nodes.restart_workers
        elif asked.document is not None and asked.document.jobqueue is not None:
            from burg_drake.evaluation.cluster.jobqueue import start_jobqueue

            where = stack.enter_context(start_jobqueue(asked, security))
            security = where.security
        else:
            assert asked.document is not None
            where = asked.document.address
        client = _client(distributed, where, security)
        stack.callback(_leave, client)
        yield DaskExecutor(client, limits, maintain)


def _client(distributed: Any, where: Any, security: Any) -> Any:
    """A client of the scheduler. Dask's own time-out does not cover what a listener that stays
    silent never answers, hence a thread that is left behind then."""
    made: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def make() -> None:
        options = {"timeout": REACH, "security": security, "set_as_default": False}
        try:
            made.put(distributed.Client(where, **options))
        except BaseException as error:
            made.put(error)

    threading.Thread(target=make, name="client", daemon=True).start()
    try:
        found = made.get(timeout=HANDSHAKES * REACH)
    except queue.Empty:
        found = TimeoutError("no answer")
    if isinstance(found, (OSError, TimeoutError, ValueError, RuntimeError, TypeError)):
        raise ClusterError(
            f"no Dask scheduler answered at {where} within {REACH:.0f} s: "
            f"{unreached_reason(where, found)}"
        ) from found
    if isinstance(found, BaseException):
        raise found
    return found


def _leave(client: Any) -> None:
    with contextlib.suppress(Exception):  # of a scheduler that is gone
        client.close(timeout=REACH)


def _security(distributed: Any, cluster: Cluster) -> Any:
    """TLS of the files that the cluster file names, or else of Dask's configuration."""
    document, files = cluster.document, cluster.tls
    if document is None or (document.jobqueue is not None and files is None):
        return None
    if files is not None:
        return _of_files(distributed, files)
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


def _of_files(distributed: Any, files: TlsFiles) -> Any:
    return distributed.Security(
        tls_ca_file=files.ca,
        tls_client_cert=files.cert,
        tls_client_key=files.key,
        tls_scheduler_cert=files.cert,
        tls_scheduler_key=files.key,
        tls_worker_cert=files.cert,
        tls_worker_key=files.key,
        require_encryption=True,
    )


@contextlib.contextmanager
def _without_its_log() -> Iterator[None]:
    """What Dask would say of lost connections is said by our errors, in one line."""
    # Dask's configuration gives the second one a level of its own
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)
