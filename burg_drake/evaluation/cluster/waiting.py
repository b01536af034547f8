"""Waiting for workers, which a batch system may start later or never."""

from __future__ import annotations

import time
import uuid
from typing import Any

from burg_drake.core import ClusterError
from burg_drake.evaluation.cluster.members import scheduler_errors

WORKER_TIMEOUT = 600.0
"""Seconds that a run waits without any worker."""


class Waiting:
    """The time without workers; while it lasts a task waits at the scheduler, from which Dask sees
    that workers are wanted."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._since: float | None = None
        self._call: Any = None

    def end(self) -> None:
        """There are workers, or none is needed any more."""
        self._since = self._call = None

    def go_on(self) -> None:
        """There is no worker.

        Raises:
            ClusterError: for too long, or the scheduler is lost.
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
