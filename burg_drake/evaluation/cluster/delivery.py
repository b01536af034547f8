"""Sends workers what they need to begin: a run's plugin, and bundles that their machines lack."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

from burg_drake.core import BurgError, ClusterError, one_line
from burg_drake.evaluation.cluster.bundles import Bundle
from burg_drake.evaluation.cluster.members import (
    LOST,
    ClusterWorkers,
    lost_scheduler,
    scheduler_errors,
)
from burg_drake.evaluation.cluster.remote import deliver
from burg_drake.evaluation.cluster.sent_job import SentJob

ATTEMPTS = 3
"""So often a worker is sent what it needs to begin."""
PAUSE = 1.0
"""Between two of these times [s]."""


def register_plugin(client: Any, cluster: ClusterWorkers, plugin: Any) -> None:
    """Has the workers, and those that join later, begin a run. A worker that dies meanwhile is no
    reason to stop.

    Args:
        client: of Dask.
        cluster: the workers; looked at before anything is registered where others would not know
            it.
        plugin: of Dask's workers, with the `name` of the run.

    Raises:
        ClusterError: as `ClusterWorkers.update`.
    """
    for attempt in range(1, ATTEMPTS + 1):
        cluster.update()
        try:
            client.register_plugin(plugin, name=plugin.name)
            return
        except LOST as error:
            if client.status != "running" or attempt == ATTEMPTS:
                raise lost_scheduler(client) from error
            time.sleep(PAUSE)


def end_run(client: Any, name: str, futures: Sequence[Any]) -> None:
    """Gives up what is under way, and ends the children of a run.

    Args:
        client: of Dask.
        name: of the run's plugin.
        futures: of Dask.
    """
    if client.status != "running":
        return
    try:
        client.cancel(list(futures), force=True)
        client.unregister_worker_plugin(name)
    except LOST:
        pass  # the scheduler is lost, and its workers end with it


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
    send_bundle(client, job.bundle, f"the scene {job.job.key!r}", job.deliveries, addresses)


def send_bundle(
    client: Any, bundle: Bundle, what: str, deliveries: Counter[str], addresses: Sequence[str]
) -> None:
    """Sends a bundle; a worker that lacks it nonetheless, after some attempts, is told of.

    Args:
        client: of Dask.
        bundle: with its data.
        what: it is, for people.
        deliveries: how often it was sent, by the worker's address; counted on.
        addresses: of the workers.

    Raises:
        ClusterError: as `deliver_bundle`.
    """
    if not addresses:
        return

    def refusal(address: str, why: str) -> ClusterError:
        return ClusterError(f"worker {address} did not receive {what}: {why}")

    for address in addresses:
        deliveries[address] += 1
        if deliveries[address] > ATTEMPTS:
            raise refusal(address, "its files are not there afterwards")
    with scheduler_errors(client):
        errors = client.run(
            deliver, bundle.data, bundle.name, workers=list(addresses), on_error="return"
        )
    for address, error in errors.items():
        if isinstance(error, LOST) and deliveries[address] < ATTEMPTS:
            continue  # a look will tell whether the worker is lost
        if isinstance(error, BaseException):
            why = str(error) if isinstance(error, BurgError) else one_line(error)
            raise refusal(address, why)
