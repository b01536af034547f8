"""Dask scheduler and workers as processes of this machine, which end with their driver.

Unlike `distributed.LocalCluster` they do not import the main module of the caller, so scripts and
notebooks need no special guard.
"""

from __future__ import annotations

import asyncio
import logging
import os
import subprocess
from multiprocessing.connection import Connection
from typing import Any

from burg_drake.core import ClusterError, exit_cause, start_worker

LOOPBACK = "127.0.0.1"
NO_DASHBOARD = {"dashboard": False, "dashboard_address": f"{LOOPBACK}:0"}
"""Without these options Dask serves its state over HTTP to everybody."""


def main(handle: int) -> None:
    """Runs a scheduler or worker until it is ended.

    Args:
        handle: file descriptor of the pipe to the parent. The parent sends the scheduler's address,
            or an empty text to start the scheduler, and receives the address of the new process.
    """
    from distributed import Scheduler, Worker

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    connection = Connection(handle)
    scheduler = connection.recv()

    async def run() -> None:
        server: Any
        if scheduler:
            server = Worker(scheduler, nthreads=1, memory_limit=0, host=LOOPBACK, **NO_DASHBOARD)
        else:
            server = Scheduler(host=LOOPBACK, port=0, **NO_DASHBOARD)
        async with server:
            connection.send(server.address)
            await server.finished()

    try:
        asyncio.run(run())
    finally:
        os._exit(0)


Node = tuple[subprocess.Popen[bytes], Connection]


class LocalNodes:
    """A scheduler and workers on this machine.

    Attributes:
        address: address of the scheduler.
        scheduler: process of the scheduler.
        workers: processes of the workers.
    """

    def __init__(self, count: int) -> None:
        """Starts the processes.

        Args:
            count: number of workers.

        Raises:
            ClusterError: a process does not start.
        """
        self._nodes: list[Node] = []
        try:
            node = _start_node("")
            self._nodes.append(node)
            self.scheduler, self.address = node[0], _receive_address(node)
            self._nodes += [_start_node(self.address) for _ in range(count)]
            for node in self._nodes[1:]:
                _receive_address(node)
        except BaseException:
            self.close()
            raise

    @property
    def workers(self) -> list[subprocess.Popen[bytes]]:
        """Processes of the workers."""
        return [process for process, _ in self._nodes[1:]]

    def restart_workers(self) -> None:
        """Replaces workers that have ended."""
        if self.scheduler.poll() is not None:
            return
        for k, (process, connection) in enumerate(self._nodes[1:], 1):
            if process.poll() is not None:
                connection.close()
                self._nodes[k] = _start_node(self.address)

    def close(self) -> None:
        """Ends all processes."""
        for process, _ in reversed(self._nodes):
            process.kill()
        for process, connection in self._nodes:
            process.wait()
            connection.close()


def _start_node(scheduler: str) -> Node:
    process, connection = start_worker("burg_drake.evaluation.cluster.node")
    connection.send(scheduler)
    return process, connection


def _receive_address(node: Node) -> str:
    start_timeout = 60.0  # Seconds until a process must have started.
    process, connection = node
    try:
        if connection.poll(start_timeout):
            address: str = connection.recv()
            return address
        why = f"it does not answer within {start_timeout:.0f} s"
    except (EOFError, OSError):
        why = exit_cause(process)
    raise ClusterError(f"a process of the local cluster does not start: {why}")
