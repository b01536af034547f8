"""Sends the bundle of a job to workers whose machines lack it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from burg_drake.core import BurgError, ClusterError, one_line
from burg_drake.evaluation.cluster.members import LOST, scheduler_errors
from burg_drake.evaluation.cluster.remote import deliver
from burg_drake.evaluation.cluster.sent_job import SentJob

ATTEMPTS = 3
"""So often a worker is sent what it needs to begin."""


def deliver_bundle(client: Any, job: SentJob, addresses: Sequence[str]) -> None:
    """Sends it; a worker that lacks it nonetheless, after some attempts, is told of.

    Args:
        client: of Dask.
        job: has a bundle.
        addresses: of the workers.

    Raises:
        ClusterError: a worker cannot unpack it, or does not keep it; or the scheduler is lost.
    """
    assert job.bundle is not None
    if not addresses:
        return
    for address in addresses:
        job.deliveries[address] += 1
        if job.deliveries[address] > ATTEMPTS:
            raise _delivery_error(job, address, "its files are not there afterwards")
    with scheduler_errors(client):
        errors = client.run(
            deliver, job.bundle.data, job.bundle.name, workers=list(addresses), on_error="return"
        )
    for address, error in errors.items():
        if isinstance(error, LOST) and job.deliveries[address] < ATTEMPTS:
            continue  # a look will tell whether the worker is lost
        if isinstance(error, BaseException):
            why = str(error) if isinstance(error, BurgError) else one_line(error)
            raise _delivery_error(job, address, why)


def _delivery_error(job: SentJob, address: str, why: str) -> ClusterError:
    return ClusterError(f"worker {address} did not receive the scene {job.job.key!r}: {why}")
