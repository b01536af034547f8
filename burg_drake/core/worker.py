"""Messages between a pool and its worker processes, and the main loop of a worker.

A worker builds a session once, and then calls the functions of tasks. A process that exceeds a time
limit is ended by the system. Worker processes import this module only, so it stays light.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from burg_drake.core.errors import SimulationError, TaskCancelled, one_line

TIME_LIMIT_SIGNALS = (signal.SIGPROF, signal.SIGALRM)
"""Signals that end a process at its limit of CPU time or wall time."""


@dataclass(frozen=True)
class TimeLimit:
    """Time limit of a task, or of building a session; without imports.

    Attributes:
        cpu: CPU time [s], which does not depend on the load of the machine.
        wall: wall time [s], which also ends work that waits forever.
    """

    cpu: float
    wall: float


@contextmanager
def time_limit(limit: TimeLimit | None) -> Iterator[None]:
    """Ends this process by one of `TIME_LIMIT_SIGNALS` if it does not leave the block in time.

    The system ends it, even while native code blocks the interpreter, or after the parent has
    ended. Without a limit nothing is done.
    """
    if limit is None:
        yield
        return
    signal.setitimer(signal.ITIMER_PROF, limit.cpu)
    signal.setitimer(signal.ITIMER_REAL, limit.wall)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def restore_time_limit_signals() -> None:
    """Restores the default handling of the signals, which a parent may have ignored."""
    for number in TIME_LIMIT_SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TIME_LIMIT_SIGNALS)


Result = TypeVar("Result")


@dataclass(eq=False)
class Session:
    """An object that a worker builds once and passes to every task of the session.

    Attributes:
        key: name of the object; a worker that has it does not build it again, even for another
            session with this key.
        build: builds the object; pickled by reference, hence an instance of an importable class or
            an importable function.
        limit: time limit of building; none if None.
        attempts: number of consecutive workers that may die while they build it before the session
            fails.
        error: why it cannot be built; its tasks then fail.
        failed_builds: number of consecutive workers that died while they built it.
        pickled: the pickled `build`.
    """

    key: str
    build: Callable[[], Any]
    limit: TimeLimit | None = None
    attempts: int = 2
    error: BaseException | None = field(default=None, init=False)
    failed_builds: int = field(default=0, init=False)
    pickled: bytes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.pickled = pickle.dumps(self.build)


@dataclass(frozen=True, eq=False)
class Task(Generic[Result]):
    """A call of a function in a worker.

    Attributes:
        function: importable function; with a session, its first argument is the session's object.
        args: positional arguments.
        kwargs: keyword arguments.
        session: session of the task, if any.
        limit: time limit; none if None.
        on_progress: called with each message of `report_progress`, in a thread of the pool.
        retries: number of retries if its worker dies; the pool's if None.
    """

    function: Callable[..., Result]
    args: tuple[Any, ...] = ()
    kwargs: Mapping[str, Any] = field(default_factory=dict)
    session: Session | None = None
    limit: TimeLimit | None = None
    on_progress: Callable[[Any], None] | None = None
    retries: int | None = None

    @property
    def session_key(self) -> str | None:
        """Key of its session; None without one."""
        return None if self.session is None else self.session.key


class WorkerFuture(Future[Result]):
    """The future result of a task.

    Raises the task's error, `WorkerDied` if the task ends its workers, and `TaskCancelled` if it
    was cancelled while it ran.
    """

    def __init__(self, end: Callable[[WorkerFuture[Any], bool], None]) -> None:
        """Made by a pool.

        Args:
            end: ends the task at its next progress report, or with its process.
        """
        super().__init__()
        self._end = end

    def interrupt(self) -> None:
        """Cancels the task at its next progress report, unless it is done."""
        if not self.cancel():
            self._end(self, False)

    def terminate(self) -> None:
        """Ends the task at once, with its process, unless it is done."""
        if not self.cancel():
            self._end(self, True)


@dataclass(frozen=True)
class OpenSession:
    """To a worker: build a session's object.

    Attributes:
        key: key of the session.
        build: pickled function that builds it.
        drop: keys of sessions that are no longer needed.
        limit: time limit.
    """

    key: str
    build: bytes
    drop: tuple[str, ...]
    limit: TimeLimit | None


@dataclass(frozen=True)
class TaskCall:
    """A task for a worker.

    Attributes:
        number: number of the task.
        work: function, arguments and keyword arguments, pickled.
        session: key of the session whose object is the first argument, if any.
        limit: time limit.
    """

    number: int
    work: bytes
    session: str | None
    limit: TimeLimit | None


@dataclass(frozen=True)
class TaskCalls:
    """To a worker: tasks to run one after the other.

    Attributes:
        calls: the tasks.
        opening: session to build before, if any; if that fails, the tasks are not run.
    """

    calls: tuple[TaskCall, ...]
    opening: OpenSession | None = None


@dataclass(frozen=True)
class InterruptTask:
    """To a worker: a task is cancelled."""

    number: int


@dataclass(frozen=True)
class SessionOpened:
    """From a worker: a session is built, or cannot be built by any worker.

    Attributes:
        error: why it cannot be built.
        traceback_text: the error's traceback.
    """

    error: BaseException | None = None
    traceback_text: str = ""


@dataclass(frozen=True)
class ProgressMessage:
    """From a worker: a progress message of its task."""

    number: int
    message: Any


@dataclass(frozen=True)
class TaskDone:
    """From a worker: a task has a result, or has raised an error.

    Attributes:
        number: number of the task.
        result: its return value.
        error: its error.
        traceback_text: the error's traceback.
    """

    number: int
    result: Any
    error: BaseException | None = None
    traceback_text: str = ""


@dataclass(frozen=True)
class WorkerEnding:
    """From a worker: it is about to end.

    Attributes:
        reason: the reason.
    """

    reason: str


WorkerMessage = SessionOpened | ProgressMessage | TaskDone | WorkerEnding


def main(handle: int, own_group: bool = False) -> None:
    """Runs a worker until the parent closes the pipe.

    Args:
        handle: file descriptor of this end of the pipe.
        own_group: whether it leads a process group, so that its child processes end with it.
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
        pass  # the parent is gone
    except (SystemExit, KeyboardInterrupt) as error:  # DRAKE_DEMAND ends this way
        connection.send(WorkerEnding(one_line(error)))
    # Destructors of large diagrams take time and nothing is left to be written.
    os._exit(0)


def report_progress(message: Any) -> None:
    """Reports progress of the current task; does nothing outside a worker.

    Args:
        message: picklable argument for `Task.on_progress`.

    Raises:
        TaskCancelled: the task was cancelled.
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
            if isinstance(message, InterruptTask):
                continue  # too late: the task has ended
            if message.opening is None or self._build_session(message.opening):
                for call in message.calls:
                    self._run_task(call)

    def report(self, message: Any) -> None:
        while self._connection.poll():
            received = self._connection.recv()
            if isinstance(received, InterruptTask) and received.number == self._number:
                raise TaskCancelled("this task was cancelled")
        self._connection.send(ProgressMessage(self._number, message))

    def _build_session(self, opening: OpenSession) -> bool:
        for key in opening.drop:
            self._sessions.pop(key, None)
        try:
            build: Callable[[], Any] = pickle.loads(opening.build)
            with time_limit(opening.limit):  # imports do not count
                self._sessions[opening.key] = build()
        except Exception as error:
            self._send(SessionOpened(*_picklable_error(error)))
            return False
        self._send(SessionOpened())
        return True

    def _run_task(self, call: TaskCall) -> None:
        self._number = call.number
        try:
            function, args, kwargs = pickle.loads(call.work)
            if call.session is not None:
                args = (self._sessions[call.session], *args)
            with time_limit(call.limit):
                result = function(*args, **kwargs)
        except Exception as error:
            self._send(TaskDone(call.number, None, *_picklable_error(error)))
            return
        try:
            self._send(TaskDone(call.number, result))
        except (EOFError, OSError):
            raise
        except Exception as error:  # a result that cannot be pickled is not sent at all
            self._send(TaskDone(call.number, None, *_picklable_error(error)))

    def _send(self, message: WorkerMessage) -> None:
        self._connection.send(message)


_loop: _WorkerLoop | None = None


def _picklable_error(error: Exception) -> tuple[Exception, str]:
    """A picklable form of an error, and its traceback."""
    text = "".join(traceback.format_exception(error))
    try:
        sent: Exception = pickle.loads(pickle.dumps(error))
    except Exception:  # its class cannot be found, or needs other arguments
        sent = SimulationError(one_line(error))
    return sent, text
