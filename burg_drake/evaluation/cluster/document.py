"""The cluster document: address of a running Dask scheduler, or how a batch system starts one."""

from __future__ import annotations

import ipaddress
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from burg_drake.core import (
    ClusterError,
    FieldError,
    InvalidInputError,
    MissingDependencyError,
    load_document,
    quote_value,
    resolve_reference,
)
from burg_drake.evaluation.cluster.node import LOOPBACK

LOCAL_CLUSTER_PATTERN = re.compile(r"local:(\d{1,4})")
SCHEDULER_ADDRESS_PATTERN = re.compile(r"(tls|tcp)://(\[[^\]]+\]|[^:/\s]+):(\d{1,5})")


@dataclass(frozen=True, kw_only=True)
class TlsFiles:
    """Certificates (PEM files, relative to this file).

    Attributes:
        ca: certificate of the authority that signed those of all machines.
        cert: certificate of this machine.
        key: private key of this machine.
    """

    ca: str
    cert: str
    key: str


@dataclass(frozen=True, kw_only=True)
class AdaptiveJobs:
    """Smallest and largest number of jobs. Jobs start and end with the amount of work.

    Attributes:
        minimum: smallest number of jobs.
        maximum: largest number of jobs.
    """

    minimum: int = 0
    maximum: int

    def __post_init__(self) -> None:
        if not 0 <= self.minimum <= self.maximum or self.maximum < 1:
            raise InvalidInputError(
                f"adapt from {self.minimum} to {self.maximum} jobs; minimum is at most maximum,"
                " which is 1 or more"
            )


@dataclass(frozen=True, kw_only=True)
class JobQueue:
    """How a batch system starts workers (by dask-jobqueue).

    Attributes:
        kind: kind of batch system.
        workers: number of workers in a job, each with one processor.
        memory: memory of a job, such as `16GB`.
        walltime: time limit of a job, such as `04:00:00`; dask-jobqueue's default if empty.
        queue: queue or partition; the default one if empty.
        account: account or project; the default one if empty.
        interface: network interface between the machines, such as `ib0`; the default one if empty.
        local_directory: folder on the workers' machines for temporary files.
        python: Python to start workers with; this one if empty.
        log_directory: folder for the jobs' output.
        directives: further lines for the head of the job script, without `#SBATCH` or `#PBS`.
        prologue: commands before the workers start, such as to activate an environment.
        shared_directory: folder that all machines see, for temporary certificates if there is no
            `tls`.
    """

    kind: Literal["slurm", "pbs", "sge", "lsf", "htcondor", "oar", "moab"]
    workers: int
    memory: str
    walltime: str = ""
    queue: str = ""
    account: str = ""
    interface: str = ""
    local_directory: str = ""
    python: str = ""
    log_directory: str = ""
    directives: tuple[str, ...] = ()
    prologue: tuple[str, ...] = ()
    shared_directory: str = ""

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise FieldError(f"workers is {self.workers}; give 1 or more", "workers")


@dataclass(frozen=True, kw_only=True)
class ClusterDocument:
    """A cluster of machines for `--cluster`: either a running Dask scheduler, or a batch system
    that starts workers.

    Attributes:
        address: address of a running scheduler, such as `tls://head:8786`.
        tls: certificates for an encrypted connection.
        jobqueue: batch system that starts the workers.
        scale: number of jobs.
        adapt: smallest and largest number of jobs, in place of `scale`.
    """

    version: int = 1
    address: str = ""
    tls: TlsFiles | None = None
    jobqueue: JobQueue | None = None
    scale: int | None = None
    adapt: AdaptiveJobs | None = None

    def __post_init__(self) -> None:
        if bool(self.address) == (self.jobqueue is not None):
            raise InvalidInputError("give either address or jobqueue")
        if self.jobqueue is None:
            if self.scale is not None or self.adapt is not None:
                raise InvalidInputError("scale and adapt belong to a jobqueue, which is missing")
            require_safe_address(self.address)
            if self.tls is not None and not self.address.startswith("tls://"):
                raise FieldError(
                    f"address is {self.address}, but tls files are given; write tls://", "address"
                )
            return
        if (self.scale is None) == (self.adapt is None):
            raise InvalidInputError("give either scale or adapt with a jobqueue")
        if self.scale is not None and self.scale < 1:
            raise FieldError(f"scale is {self.scale}; give 1 or more", "scale")


def read_cluster(text: str) -> int | ClusterDocument:
    """The cluster that a text names.

    Args:
        text: `local:4`, the address of a scheduler, or the path of a cluster file.

    Returns:
        Number of workers on this machine; or a document, with the paths of its TLS files.

    Raises:
        InvalidInputError: the text is none of these.
        ClusterError: the address is not safe.
        DocumentError: the file does not fit the schema.
        UnknownNameError: there is no such file.
    """
    if found := LOCAL_CLUSTER_PATTERN.fullmatch(text):
        if int(found[1]) < 1:
            raise InvalidInputError(f"{text} has no workers; give local:1 or more")
        return int(found[1])
    if "://" in text:
        require_safe_address(text)
        return ClusterDocument(address=text)
    if Path(text).suffix not in (".yaml", ".yml"):
        raise InvalidInputError(
            f"{quote_value(text)} is not a cluster; give local:N, tls://HOST:PORT or a cluster.yaml"
        )
    path = resolve_reference(text)
    document = load_document(path, ClusterDocument)
    tls = document.tls
    if tls is not None:
        ca, cert, key = (
            str(resolve_reference(file, base=path.parent)) for file in (tls.ca, tls.cert, tls.key)
        )
        document = replace(document, tls=TlsFiles(ca=ca, cert=cert, key=key))
    return document


def require_safe_address(address: str, prefix: str = "") -> None:
    """Refuses an address at which others could eavesdrop or run code.

    Args:
        address: address at which a scheduler or a worker listens.
        prefix: names the connected scheduler or worker in messages; an `inproc://` address is
            accepted with it.

    Raises:
        InvalidInputError: it is not an address.
        ClusterError: plain TCP beyond this machine.
    """
    max_port = 65_535
    tls_instructions = (
        "start scheduler and workers with --protocol tls --tls-ca-file CA --tls-cert CERT --tls-key"
        " KEY, and give a cluster.yaml with address: tls://HOST:PORT and tls: {ca, cert, key}"
    )
    if prefix and address.startswith("inproc://"):
        return
    found = SCHEDULER_ADDRESS_PATTERN.fullmatch(address)
    if found is None:
        what = "worker" if "worker" in prefix else "scheduler"
        raise InvalidInputError(
            f"{prefix}{quote_value(address)} is not an address of a {what}; write tls://HOST:PORT"
        )
    if not 1 <= int(found[3]) <= max_port:
        raise InvalidInputError(
            f"{prefix}{address}: there is no port {found[3]}; ports go from 1 to {max_port}"
        )
    if found[1] == "tcp" and not _is_loopback(found[2].strip("[]")):
        raise ClusterError(
            f"{prefix}{address} is not encrypted: whoever reaches this port can run"
            f" programs as you. {tls_instructions}"
        )


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def start_jobqueue(document: ClusterDocument, security: Any) -> Any:
    """Starts a scheduler here and asks the batch system for workers.

    Args:
        document: document with a `jobqueue`.
        security: security with the document's TLS files; None for temporary certificates.

    Returns:
        The cluster of dask-jobqueue.

    Raises:
        MissingDependencyError: dask-jobqueue or cryptography is not installed.
        ClusterError: dask-jobqueue refuses the parameters, or there is no batch system.
    """
    # Class of dask-jobqueue for each batch system.
    classes = {
        "slurm": "SLURMCluster",
        "pbs": "PBSCluster",
        "sge": "SGECluster",
        "lsf": "LSFCluster",
        "htcondor": "HTCondorCluster",
        "oar": "OARCluster",
        "moab": "MoabCluster",
    }
    assert document.jobqueue is not None
    try:
        import dask_jobqueue
    except ImportError as error:
        raise MissingDependencyError(
            "jobqueue in a cluster file needs dask-jobqueue: pip install burg-drake[dask,jobqueue]"
        ) from error
    if security is None:
        try:
            import cryptography  # noqa: F401
        except ImportError as error:
            raise MissingDependencyError(
                "a jobqueue without tls files makes certificates of its own, which needs"
                " cryptography: pip install burg-drake[jobqueue], or give tls: {ca, cert, key}"
            ) from error
    make = getattr(dask_jobqueue, classes[document.jobqueue.kind])
    submit = str(make.job_cls.submit_command).split()[0]
    if shutil.which(submit) is None:
        raise ClusterError(
            f"this machine has no {submit}, so jobs cannot be submitted to "
            f"{document.jobqueue.kind}; run this where jobs are submitted"
        )
    try:
        started = make(security=security or True, **jobqueue_parameters(document.jobqueue))
        if document.adapt is not None:
            started.adapt(minimum_jobs=document.adapt.minimum, maximum_jobs=document.adapt.maximum)
        else:
            started.scale(jobs=document.scale)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise ClusterError(f"{document.jobqueue.kind} does not start a cluster: {error}") from error
    return started


def jobqueue_parameters(queue: JobQueue) -> dict[str, Any]:
    """Keywords of dask-jobqueue's classes."""
    named = {
        "walltime": queue.walltime,
        "queue": queue.queue,
        "account": queue.account,
        "interface": queue.interface,
        "local_directory": queue.local_directory,
        "python": queue.python,
        "log_directory": queue.log_directory,
        "shared_temp_directory": queue.shared_directory,
        "job_extra_directives": list(queue.directives),
        "job_script_prologue": list(queue.prologue),
    }
    return {
        "cores": queue.workers,
        "processes": queue.workers,
        "memory": queue.memory,
        "protocol": "tls://",
        "worker_extra_args": ["--dashboard-address", f"{LOOPBACK}:0"],
        "scheduler_options": {"dashboard_address": f"{LOOPBACK}:0"},
        **{name: value for name, value in named.items() if value},
    }
