"""A scheduler and workers of Dask as processes of this machine, which end with their driver.

Unlike `distributed.LocalCluster` they import nobody's main module, so that scripts and notebooks
need no special guard.
"""

from __future__ import annotations

import subprocess
from multiprocessing.connection import Connection

from burg_drake.core import ClusterError
from burg_drake.core.workers import exit_cause, start_worker

START = 60.0
"""Time in which a process has to start [s]."""
Node = tuple[subprocess.Popen[bytes], Connection]


class LocalNodes:
    """The processes.

    Attributes:
        address: of the scheduler.
        scheduler: its process.
        workers: those of the workers.
    """

    def __init__(self, count: int) -> None:
        """Starts them.

        Args:
            count: number of workers.

        Raises:
            ClusterError: one does not start.
        """
        self._nodes: list[Node] = []
        try:
            node = _start("")
            self._nodes.append(node)
            self.scheduler, self.address = node[0], _address(node)
            self._nodes += [_start(self.address) for _ in range(count)]
            for node in self._nodes[1:]:
                _address(node)
        except BaseException:
            self.close()
            raise

    @property
    def workers(self) -> list[subprocess.Popen[bytes]]:
        """Processes of the workers."""
        return [process for process, _ in self._nodes[1:]]

    def restart_workers(self) -> None:
        """Starts a worker in the place of each that has ended."""
        if self.scheduler.poll() is not None:
            return
        for k, (process, connection) in enumerate(self._nodes[1:], 1):
            if process.poll() is not None:
                connection.close()
                self._nodes[k] = _start(self.address)

    def close(self) -> None:
        """Ends all."""
        for process, _ in reversed(self._nodes):
            process.kill()
        for process, connection in self._nodes:
            process.wait()
            connection.close()


def _start(scheduler: str) -> Node:
    process, connection = start_worker("burg_drake.evaluation.cluster.node")
    connection.send(scheduler)
    return process, connection


def _address(node: Node) -> str:
    process, connection = node
    try:
        if connection.poll(START):
            address: str = connection.recv()
            return address
        why = f"it does not answer within {START:.0f} s"
    except (EOFError, OSError):
        why = exit_cause(process)
    raise ClusterError(f"a process of the local cluster does not start: {why}")
