"""A process of a local cluster: the scheduler of Dask, or one worker."""

from __future__ import annotations

import asyncio
import logging
import os
from multiprocessing.connection import Connection
from typing import Any

LOOPBACK = "127.0.0.1"
NO_WEB = {"dashboard": False, "dashboard_address": f"{LOOPBACK}:0"}
"""Dask serves its state over HTTP in any case, by default to everybody."""


def main(handle: int) -> None:
    """Runs it until it is ended.

    Args:
        handle: file descriptor of the pipe to the parent, who sends the scheduler's address, or an
            empty text for the scheduler itself, and gets the address of what has started.
    """
    from distributed import Scheduler, Worker

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    connection = Connection(handle)
    scheduler = connection.recv()

    async def run() -> None:
        server: Any
        if scheduler:
            server = Worker(scheduler, nthreads=1, memory_limit=0, host=LOOPBACK, **NO_WEB)
        else:
            server = Scheduler(host=LOOPBACK, port=0, **NO_WEB)
        async with server:
            connection.send(server.address)
            await server.finished()

    try:
        asyncio.run(run())
    finally:
        os._exit(0)
