"""A worker as the pool sees it: its process, what that has built, and what it is at."""

from __future__ import annotations

import contextlib
import itertools
import os
import pickle
import signal
import subprocess
from collections import deque
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

from burg_drake.core.errors import WorkerDied
from burg_drake.core.workers.limits import TOO_LONG, TimeLimit
from burg_drake.core.workers.messages import Call, Calls, OpenSession
from burg_drake.core.workers.processes import exit_cause, start_worker, was_ended_from_outside
from burg_drake.core.workers.tasks import Session, Task, WorkerFuture

MODULE = "burg_drake.core.workers.worker"


@dataclass(eq=False)
class PendingTask:
    """A task that has no result yet.

    Attributes:
        number: names it.
        task: what to do.
        future: what will become of it.
        tries: workers that it may still end.
        started: whether its future says that it runs.
        cancelled: whether nobody waits for it any more, although it was started.
        work: function and arguments, pickled when it is first sent.
    """

    number: int
    task: Task[Any]
    future: WorkerFuture[Any]
    tries: int
    started: bool = False
    cancelled: bool = False
    work: bytes | None = None

    def call(self) -> Call:
        """What a worker is sent.

        Raises:
            Exception: it cannot be pickled.
        """
        task = self.task
        if self.work is None:
            self.work = pickle.dumps((task.function, task.args, dict(task.kwargs)))
        return Call(self.number, self.work, task.session_key, task.limit)


Batch = deque[PendingTask]
"""Tasks of one session that go to a worker together."""


@dataclass(eq=False)
class Worker:
    """A place for a process, which is started when there is work, and again when it has died.

    Attributes:
        number: of the worker in its pool.
        kept: sessions that it keeps at most.
        own_group: whether the process leads a group of processes, so that what it starts ends
            with it.
        process, connection: the process and our end of the pipe, if there is one.
        sessions: keys of those that it has built; used last comes last.
        opening: what it builds.
        tasks: what it is at, and has waiting.
        suspect: a task that ended the process before this one, to be tried again alone.
        own: work for this worker alone.
        reason: why the process is about to end, in its words.
        is_fresh: whether the process was given nothing yet.
    """

    number: int
    kept: int
    own_group: bool
    process: subprocess.Popen[bytes] | None = None
    connection: Connection | None = None
    sessions: dict[str, None] = field(default_factory=dict)
    opening: Session | None = None
    tasks: Batch = field(default_factory=deque)
    suspect: PendingTask | None = None
    own: deque[Batch] = field(default_factory=deque)
    reason: str = ""
    is_fresh: bool = True

    @property
    def busy(self) -> bool:
        """Whether it has something to do."""
        return bool(self.tasks)

    def started(self) -> list[PendingTask]:
        """Tasks that were given to this worker, in the order in which it does them."""
        suspect = [] if self.suspect is None else [self.suspect]
        return [*self.tasks, *suspect, *itertools.chain.from_iterable(self.own)]

    def start(self) -> None:
        """Starts the process if there is none.

        Raises:
            OSError: it cannot be started.
        """
        if self.process is None:
            self.process, self.connection = start_worker(MODULE, self.own_group)

    def give(self, batch: Batch, calls: tuple[Call, ...]) -> bool:
        """Sends it tasks; it has to be started and idle.

        Returns:
            False if the process has died while it was idle: the tasks are not to blame.
        """
        assert self.connection is not None
        session, opening = batch[0].task.session, None
        if session is not None:
            if session.key in self.sessions:
                self.sessions[session.key] = self.sessions.pop(session.key)
            else:
                self.opening, opening = session, self._opening(session)
        self.tasks = batch
        try:
            self.connection.send(Calls(calls, opening))
        except OSError:
            return self.is_fresh  # if it is, its pipe's end tells the pool
        finally:
            self.is_fresh = False
        return True

    def _opening(self, session: Session) -> OpenSession:
        drop = tuple(self.sessions)[: max(0, len(self.sessions) + 1 - self.kept)]
        for key in drop:
            del self.sessions[key]
        return OpenSession(session.key, session.pickled, drop, session.limit)

    def send(self, message: object) -> None:
        """Tells it something."""
        assert self.connection is not None
        with contextlib.suppress(OSError):  # it has died; its pipe's end tells the pool
            self.connection.send(message)

    def kill(self) -> None:
        """Ends the process and what it has started."""
        if self.process is None or self.process.poll() is not None:
            return
        if self.own_group:
            with contextlib.suppress(ProcessLookupError):  # it leads none yet
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()

    def exit_error(self) -> tuple[WorkerDied, bool]:
        """Why the process has ended, and whether it took too long; waits for its end."""
        assert self.process is not None
        overdue = -self.process.wait() in TOO_LONG
        cause = exit_cause(self.process, self.reason)
        limit = (
            self.opening.limit if self.opening else self.tasks[0].task.limit if self.tasks else None
        )
        if overdue and limit is not None:
            cause = _too_long(limit, -self.process.wait())
        return WorkerDied(cause, was_ended_from_outside(self.process)), overdue

    def forget(self) -> Batch:
        """Lets go of the process, which has ended; returns what it was at."""
        assert self.process is not None and self.connection is not None
        self.process.wait()
        self.connection.close()
        self.process = self.connection = self.opening = None
        self.sessions.clear()
        self.reason, self.is_fresh = "", True
        tasks, self.tasks = self.tasks, deque()
        return tasks


def _too_long(limit: TimeLimit, number: int) -> str:
    if number == signal.SIGALRM:
        return f"took longer than {limit.wall:g} s"
    return f"took longer than {limit.cpu:g} s of CPU time"
