"""What a pool and its worker processes exchange, and the main loop of a worker.

A worker builds what a session needs once, and then calls the functions of tasks. A process that
exceeds a time limit is ended by the system. Worker processes import this module only, so it stays
light.
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
    """What a task, or the building of a session, may take; imports before it do not count.

    Attributes:
        cpu: CPU time [s]; on a busy machine work takes longer, but not more CPU time.
        wall: wall time [s]; ends what waits for ever.
    """

    cpu: float
    wall: float


@contextmanager
def time_limit(limit: TimeLimit | None) -> Iterator[None]:
    """Ends this process by one of `TIME_LIMIT_SIGNALS` if it does not leave the block in time.

    The system does so, also where native code does not let the interpreter run, and where nobody
    else is left to do it. Without a limit nothing is done.
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
    """Undoes what a parent may have set: its children inherit which signals are ignored."""
    for number in TIME_LIMIT_SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TIME_LIMIT_SIGNALS)


Result = TypeVar("Result")


@dataclass(eq=False)
class Session:
    """What a worker builds once and hands to every task of the session.

    Attributes:
        key: names what is built; a worker that has it does not build it again, also for another
            session with this key.
        build: builds it; pickled by reference, hence an instance of an importable class or an
            importable function.
        limit: what building may take; any time if None.
        attempts: so many workers in a row that die while they build it end the session.
        error: why it cannot be built; its tasks fail then.
        failed_builds: workers in a row that died while they built it.
        pickled: `build`.
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
        function: importable; with a session, what that has built is its first argument.
        args: its arguments.
        kwargs: likewise.
        session: what has to be built before, if anything.
        limit: what it may take; any time if None.
        on_progress: called with each message of `report_progress`, in a thread of the pool.
        retries: how often it is tried again when its worker dies; as the pool says if None.
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
        """Key of its session, if it has one."""
        return None if self.session is None else self.session.key


class WorkerFuture(Future[Result]):
    """What will become of a task.

    Raises what the task raises, `WorkerDied` if it ends its workers, and `TaskCancelled` if nobody
    waited for it any more while it ran.
    """

    def __init__(self, end: Callable[[WorkerFuture[Any], bool], None]) -> None:
        """Made by a pool.

        Args:
            end: ends it: as it reports progress, or with its process.
        """
        super().__init__()
        self._end = end

    def interrupt(self) -> None:
        """Nobody waits for it any more: it ends when it next reports progress. Nothing if done."""
        if not self.cancel():
            self._end(self, False)

    def terminate(self) -> None:
        """Ends it at once, with the process that runs it. Nothing if done."""
        if not self.cancel():
            self._end(self, True)


@dataclass(frozen=True)
class OpenSession:
    """To a worker: build what a session needs.

    Attributes:
        key: names it from then on.
        build: builds it, pickled.
        drop: keys of what is not needed any more.
        limit: what it may take.
    """

    key: str
    build: bytes
    drop: tuple[str, ...]
    limit: TimeLimit | None


@dataclass(frozen=True)
class TaskCall:
    """A task for a worker.

    Attributes:
        number: of the task.
        work: function, arguments and keyword arguments, pickled.
        session: key of what is the first argument, if any.
        limit: what it may take.
    """

    number: int
    work: bytes
    session: str | None
    limit: TimeLimit | None


@dataclass(frozen=True)
class TaskCalls:
    """To a worker: tasks to do one after the other.

    Attributes:
        calls: the tasks.
        opening: what to build before, if anything; if it cannot be built, they are not done.
    """

    calls: tuple[TaskCall, ...]
    opening: OpenSession | None = None


@dataclass(frozen=True)
class InterruptTask:
    """To a worker: nobody waits for a task any more."""

    number: int


@dataclass(frozen=True)
class SessionOpened:
    """From a worker: a session is built, or cannot be, which no other worker could either.

    Attributes:
        error: why it cannot be built.
        where: the error's traceback.
    """

    error: BaseException | None = None
    where: str = ""


@dataclass(frozen=True)
class ProgressMessage:
    """From a worker: what its task reports."""

    number: int
    message: Any


@dataclass(frozen=True)
class TaskDone:
    """From a worker: a task has a result, or has raised an error.

    Attributes:
        number: of the task.
        result: what it returned.
        error: what it raised.
        where: the error's traceback.
    """

    number: int
    result: Any
    error: BaseException | None = None
    where: str = ""


@dataclass(frozen=True)
class WorkerEnding:
    """From a worker: it is about to end.

    Attributes:
        reason: why.
    """

    reason: str


WorkerMessage = SessionOpened | ProgressMessage | TaskDone | WorkerEnding


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
        connection.send(WorkerEnding(one_line(error)))
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
            if isinstance(message, InterruptTask):
                continue  # it came too late
            if message.opening is None or self._open(message.opening):
                for call in message.calls:
                    self._do(call)

    def report(self, message: Any) -> None:
        while self._connection.poll():
            received = self._connection.recv()
            if isinstance(received, InterruptTask) and received.number == self._number:
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
            self._send(SessionOpened(*_picklable_error(error)))
            return False
        self._send(SessionOpened())
        return True

    def _do(self, call: TaskCall) -> None:
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
        except Exception as error:  # what cannot be pickled is not sent at all
            self._send(TaskDone(call.number, None, *_picklable_error(error)))

    def _send(self, message: WorkerMessage) -> None:
        self._connection.send(message)


_loop: _WorkerLoop | None = None


def _picklable_error(error: Exception) -> tuple[Exception, str]:
    """An error that can be sent, and where it was raised."""
    where = "".join(traceback.format_exception(error))
    try:
        sent: Exception = pickle.loads(pickle.dumps(error))
    except Exception:  # its class cannot be found, or wants other arguments
        sent = SimulationError(one_line(error))
    return sent, where
