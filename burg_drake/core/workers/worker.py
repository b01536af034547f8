"""The main loop of a worker process: tasks come, and are done with what their sessions built."""

from __future__ import annotations

import logging
import os
import pickle
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from burg_drake.core.errors import SimulationError, TaskCancelled, one_line
from burg_drake.core.workers.limits import restore_time_limit_signals, time_limit
from burg_drake.core.workers.messages import (
    Call,
    Done,
    Ending,
    Interrupt,
    Message,
    OpenSession,
    ProgressMessage,
    SessionOpened,
)


def main(handle: int, own_group: bool = False) -> None:
    """Runs a worker until the parent closes the pipe.

    Args:
        handle: file descriptor of this end of the pipe.
        own_group: whether it leads a group of processes, so that what it starts ends with it.
    """
    global _loop
    if own_group:
        os.setpgid(0, 0)
    # A filter, because importing pydrake sets the logger's level back.
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    restore_time_limit_signals()
    connection = Connection(handle)
    _loop = _WorkerLoop(connection)
    try:
        _loop.run()
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the parent is gone, and nobody is left to tell
    except (SystemExit, KeyboardInterrupt) as error:  # DRAKE_DEMAND ends this way
        connection.send(Ending(one_line(error)))
    # Destructors of large diagrams take time and nothing is left to be written.
    os._exit(0)


def report_progress(message: Any) -> None:
    """Called by a task: tells those who wait for it how far it is; nothing outside of a worker.

    Args:
        message: for `Task.on_progress`; can be pickled.

    Raises:
        TaskCancelled: nobody waits for the task any more.
    """
    if _loop is not None:
        _loop.report(message)


class _WorkerLoop:
    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._sessions: dict[str, Any] = {}
        self._number = -1

    def run(self) -> None:
        while (message := self._connection.recv()) is not None:
            if isinstance(message, Interrupt):
                continue  # it came too late
            if message.opening is None or self._open(message.opening):
                for call in message.calls:
                    self._do(call)

    def report(self, message: Any) -> None:
        while self._connection.poll():
            received = self._connection.recv()
            if isinstance(received, Interrupt) and received.number == self._number:
                raise TaskCancelled("this task was cancelled")
        self._connection.send(ProgressMessage(self._number, message))

    def _open(self, opening: OpenSession) -> bool:
        for key in opening.drop:
            self._sessions.pop(key, None)
        try:
            build: Callable[[], Any] = pickle.loads(opening.build)
            with time_limit(opening.limit):  # imports do not count
                self._sessions[opening.key] = build()
        except Exception as error:
            self._send(SessionOpened(*_portable(error)))
            return False
        self._send(SessionOpened())
        return True

    def _do(self, call: Call) -> None:
        self._number = call.number
        try:
            function, args, kwargs = pickle.loads(call.work)
            if call.session is not None:
                args = (self._sessions[call.session], *args)
            with time_limit(call.limit):
                result = function(*args, **kwargs)
        except Exception as error:
            self._send(Done(call.number, None, *_portable(error)))
            return
        try:
            self._send(Done(call.number, result))
        except (EOFError, OSError):
            raise
        except Exception as error:  # what cannot be pickled is not sent at all
            self._send(Done(call.number, None, *_portable(error)))

    def _send(self, message: Message) -> None:
        self._connection.send(message)


_loop: _WorkerLoop | None = None


def _portable(error: Exception) -> tuple[Exception, str]:
    """An error that can be sent, and where it was raised."""
    where = "".join(traceback.format_exception(error))
    try:
        sent: Exception = pickle.loads(pickle.dumps(error))
    except Exception:  # its class cannot be found, or wants other arguments
        sent = SimulationError(one_line(error))
    return sent, where
