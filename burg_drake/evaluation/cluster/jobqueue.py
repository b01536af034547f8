"""Clusters that a batch system starts, by dask-jobqueue."""

from __future__ import annotations

import shutil
from typing import Any

from burg_drake.core import ClusterError, MissingDependencyError
from burg_drake.evaluation.cluster.document import Cluster, JobQueue
from burg_drake.evaluation.cluster.node import LOOPBACK

CLASSES = {
    "slurm": "SLURMCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "lsf": "LSFCluster",
    "htcondor": "HTCondorCluster",
    "oar": "OARCluster",
    "moab": "MoabCluster",
}


def start_jobqueue(cluster: Cluster, security: Any) -> Any:
    """Starts a scheduler here and asks the batch system for workers.

    Args:
        cluster: with a `jobqueue`.
        security: of the document's TLS files; None for certificates of passing use.

    Returns:
        The cluster of dask-jobqueue.

    Raises:
        MissingDependencyError: dask-jobqueue is not installed, or what makes certificates.
        ClusterError: it refuses the parameters, or the batch system is not there.
    """
    document = cluster.document
    assert document is not None and document.jobqueue is not None
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
    make = getattr(dask_jobqueue, CLASSES[document.jobqueue.kind])
    submit = str(make.job_cls.submit_command).split()[0]
    if shutil.which(submit) is None:
        raise ClusterError(
            f"this machine has no {submit}, so jobs cannot be submitted to "
            f"{document.jobqueue.kind}; run this where jobs are submitted"
        )
    try:
        started = make(security=security or True, **parameters(document.jobqueue))
        if document.adapt is not None:
            started.adapt(minimum_jobs=document.adapt.minimum, maximum_jobs=document.adapt.maximum)
        else:
            started.scale(jobs=document.scale)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise ClusterError(f"{document.jobqueue.kind} does not start a cluster: {error}") from error
    return started


def parameters(queue: JobQueue) -> dict[str, Any]:
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
