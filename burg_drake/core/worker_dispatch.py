"""The dispatcher thread of a pool: gives tasks to workers, receives results, handles crashes."""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import pickle
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any

from burg_drake.core.errors import TaskCancelled, WorkerDied
from burg_drake.core.worker import (
    TIME_LIMIT_SIGNALS,
    InterruptTask,
    OpenSession,
    ProgressMessage,
    Session,
    SessionOpened,
    Task,
    TaskCall,
    TaskCalls,
    TaskDone,
    TimeLimit,
    WorkerEnding,
    WorkerFuture,
    WorkerMessage,
)
from burg_drake.core.worker_processes import exit_cause, start_worker, was_ended_from_outside


@dataclass(eq=False)
class PendingTask:
    """A task without a result yet.

    Attributes:
        number: number of the task.
        task: the task.
        future: its future.
        tries: number of workers that it may still end.
        started: whether its future is marked as running.
        cancelled: whether it was cancelled after it was started.
        work: function and arguments, pickled when it is first sent.
    """

    number: int
    task: Task[Any]
    future: WorkerFuture[Any]
    tries: int
    started: bool = False
    cancelled: bool = False
    work: bytes | None = None

    def call(self) -> TaskCall:
        """The message to a worker.

        Raises:
            Exception: the task cannot be pickled."""
        task = self.task
        if self.work is None:
            self.work = pickle.dumps((task.function, task.args, dict(task.kwargs)))
        return TaskCall(self.number, self.work, task.session_key, task.limit)


Batch = deque[PendingTask]
"""Tasks of one session that are sent to a worker together."""
MAX_SESSIONS = 2
"""Sessions that a worker keeps; more would take too much memory."""


@dataclass(eq=False)
class Worker:
    """A worker of a pool; its process is started when there is work, and restarted after it has
    died.

    Attributes:
        number: number of the worker in its pool.
        own_group: whether the process leads a process group, so that its child processes end with
            it.
        process, connection: the process and our end of the pipe, if it is started.
        sessions: keys of the built sessions; most recently used last.
        opening: session that it is building.
        tasks: its running task and its waiting tasks.
        retry_task: a task that ended the previous process, to be retried alone.
        own_batches: work for this worker only.
        reason: reason that the process gave for ending.
        is_fresh: whether the process has not received any work yet.
    """

    number: int
    own_group: bool
    process: subprocess.Popen[bytes] | None = None
    connection: Connection | None = None
    sessions: dict[str, None] = field(default_factory=dict)
    opening: Session | None = None
    tasks: Batch = field(default_factory=deque)
    retry_task: PendingTask | None = None
    own_batches: deque[Batch] = field(default_factory=deque)
    reason: str = ""
    is_fresh: bool = True

    @property
    def busy(self) -> bool:
        """Whether the worker has work."""
        return bool(self.tasks)

    def assigned_tasks(self) -> list[PendingTask]:
        """Tasks of this worker, in order of execution."""
        retried = [] if self.retry_task is None else [self.retry_task]
        return [*self.tasks, *retried, *itertools.chain.from_iterable(self.own_batches)]

    def start(self) -> None:
        """Starts the process if there is none.

        Raises:
            OSError: the process cannot be started."""
        if self.process is None:
            self.process, self.connection = start_worker("burg_drake.core.worker", self.own_group)

    def send_tasks(self, batch: Batch, calls: tuple[TaskCall, ...]) -> bool:
        """Sends tasks to the started and idle process.

        Returns:
            False if the process has died while it was idle, so not because of the tasks.
        """
        assert self.connection is not None
        session, opening = batch[0].task.session, None
        if session is not None:
            if session.key in self.sessions:
                self.sessions[session.key] = self.sessions.pop(session.key)
            else:
                self.opening, opening = session, self._open_session(session)
        self.tasks = batch
        try:
            self.connection.send(TaskCalls(calls, opening))
        except OSError:
            return self.is_fresh  # if it has died, the end of its pipe tells the pool
        finally:
            self.is_fresh = False
        return True

    def _open_session(self, session: Session) -> OpenSession:
        """The message that builds a session; drops the least recently used ones."""
        drop = tuple(self.sessions)[: max(0, len(self.sessions) + 1 - MAX_SESSIONS)]
        for key in drop:
            del self.sessions[key]
        return OpenSession(session.key, session.pickled, drop, session.limit)

    def send(self, message: object) -> None:
        """Sends a message to the process."""
        assert self.connection is not None
        with contextlib.suppress(OSError):  # it has died; the end of its pipe tells the pool
            self.connection.send(message)

    def kill(self) -> None:
        """Ends the process and, if it leads a group, its child processes."""
        process = self.process  # the pool's thread may forget it meanwhile
        if process is None or process.poll() is not None:
            return
        if self.own_group:
            with contextlib.suppress(ProcessLookupError):  # it does not lead a group yet
                os.killpg(process.pid, signal.SIGKILL)
        process.kill()

    def exit_error(self) -> tuple[WorkerDied, bool]:
        """The cause of the process's end, and whether a time limit ended it; waits for the end."""
        assert self.process is not None
        timed_out = -self.process.wait() in TIME_LIMIT_SIGNALS
        cause = exit_cause(self.process, self.reason)
        limit = (
            self.opening.limit if self.opening else self.tasks[0].task.limit if self.tasks else None
        )
        if timed_out and limit is not None:
            cause = _time_limit_message(limit, -self.process.wait())
        return WorkerDied(cause, was_ended_from_outside(self.process)), timed_out

    def clear_process(self) -> Batch:
        """Clears the state of the ended process; returns its unfinished tasks."""
        assert self.process is not None and self.connection is not None
        self.process.wait()
        self.connection.close()
        self.process = self.connection = self.opening = None
        self.sessions.clear()
        self.reason, self.is_fresh = "", True
        tasks, self.tasks = self.tasks, deque()
        return tasks


def _time_limit_message(limit: TimeLimit, number: int) -> str:
    if number == signal.SIGALRM:
        return f"took longer than {limit.wall:g} s"
    return f"took longer than {limit.cpu:g} s of CPU time"


_log = logging.getLogger("burg_drake")


class WorkerTraceback(Exception):
    """Cause of an error from a worker: its traceback there."""


class Dispatcher:
    """Pending work and the workers that do it.

    Names with an underscore are used only in its thread.

    Attributes:
        workers: the workers.
    """

    def __init__(self, workers: list[Worker]) -> None:
        self.workers = workers
        self._shared: deque[Batch] = deque()
        self._lock = threading.Lock()
        self._requests: deque[Callable[[], None]] = deque()
        self._wake_receiver, self._wake_sender = Pipe(duplex=False)
        self._signalled = self._closed = self._killed = self._ended = False
        self._thread = threading.Thread(target=self._run, name="worker-pool", daemon=True)
        self._thread.start()

    def add_batch(self, batch: Batch, worker: int | None) -> None:
        """Adds work, for one worker or, if None, for any."""
        with self._lock:
            if self._ended:
                raise RuntimeError("cannot schedule new futures: the pool has ended")
            if worker is None:
                self._shared.append(batch)
            else:
                self.workers[worker].own_batches.append(batch)
        self._wake()

    def end_task(self, future: object, force: bool) -> None:
        """Ends a running task; see `WorkerFuture.interrupt` and `terminate`."""
        with self._lock:
            self._requests.append(lambda: self._end_task(future, force))
        self._wake()

    def cancel_waiting(self) -> None:
        """Cancels work that no worker has."""
        with self._lock:
            batches = [
                *self._shared,
                *(batch for worker in self.workers for batch in worker.own_batches),
            ]
        for task in itertools.chain.from_iterable(batches):
            task.future.cancel()

    def close(self) -> None:
        """Ends the processes when all work is done."""
        self._closed = True
        self._wake()

    def kill(self) -> None:
        """Ends the processes at once."""
        self._killed = True
        for worker in self.workers:
            worker.kill()
        self._wake()

    def join(self, timeout: float | None = None) -> None:
        """Waits until the dispatcher has ended; does nothing in its own thread."""
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout)

    def _wake(self) -> None:
        with self._lock:
            if self._signalled:
                return
            self._signalled = True
            with suppress(OSError):  # the thread has ended
                self._wake_sender.send_bytes(b"!")

    def _run(self) -> None:
        try:
            while not self._killed:
                self._assign_tasks()
                if self._closed and not self._has_work():
                    break
                self._listen()
        finally:
            self._shut_down()

    def _listen(self) -> None:
        by_connection = {w.connection: w for w in self.workers if w.connection is not None}
        for ready in wait([self._wake_receiver, *by_connection]):
            if ready is not self._wake_receiver:
                self._receive(by_connection[ready])  # type: ignore[index]
                continue
            with self._lock:
                self._wake_receiver.recv_bytes()
                self._signalled = False
                requests, self._requests = self._requests, deque()
            for request in requests:
                request()

    def _has_work(self) -> bool:
        with self._lock:
            return bool(self._shared) or any(worker.assigned_tasks() for worker in self.workers)

    def _assign_tasks(self) -> None:
        """Gives work to idle workers: first their own, then the oldest."""
        for take in (self._next_own_batch, self._next_shared_batch):
            for worker in sorted(self.workers, key=lambda worker: worker.process is None):
                while not worker.busy and (batch := take(worker)):
                    self._send_batch(worker, batch)

    def _next_own_batch(self, worker: Worker) -> Batch | None:
        if worker.retry_task is not None:
            task, worker.retry_task = worker.retry_task, None
            return deque([task])
        with self._lock:
            return worker.own_batches.popleft() if worker.own_batches else None

    def _next_shared_batch(self, worker: Worker) -> Batch | None:
        with self._lock:
            return self._shared.popleft() if self._shared else None

    def _send_batch(self, worker: Worker, batch: Batch) -> None:
        calls = [(task, call) for task in batch if (call := _begin_task(task)) is not None]
        if not calls:
            return
        tasks: Batch = deque(task for task, _ in calls)
        try:
            worker.start()
            while not worker.send_tasks(tasks, tuple(call for _, call in calls)):
                worker.kill()
                worker.clear_process()
                worker.start()
        except OSError as error:
            for task in tasks:
                task.future.set_exception(error)

    def _receive(self, worker: Worker) -> None:
        assert worker.connection is not None
        try:
            data = worker.connection.recv_bytes()
        except (EOFError, OSError):
            self._handle_worker_death(worker)
            return
        try:
            message: WorkerMessage = pickle.loads(data)
        except Exception as error:  # a result whose class has changed
            if worker.tasks:
                worker.tasks.popleft().future.set_exception(error)
            return
        task = worker.tasks[0] if worker.tasks else None
        if isinstance(message, WorkerEnding):
            worker.reason = message.reason
        elif isinstance(message, SessionOpened):
            self._handle_opened_session(worker, message)
        elif task is None or task.number != message.number:
            pass
        elif isinstance(message, ProgressMessage):
            _report_task_progress(task, message.message)
        else:
            _set_task_result(worker.tasks.popleft(), message)

    def _handle_opened_session(self, worker: Worker, message: SessionOpened) -> None:
        session, worker.opening = worker.opening, None
        assert session is not None
        if message.error is None:
            session.failed_builds = 0
            worker.sessions[session.key] = None
            return
        session.error = _with_worker_traceback(message.error, message.traceback_text)
        tasks, worker.tasks = worker.tasks, deque()
        for task in tasks:
            task.future.set_exception(session.error)

    def _handle_worker_death(self, worker: Worker) -> None:
        """Handles a worker's end: its running task is retried alone, its other work is kept."""
        if self._killed:  # cleaned up at the end
            return
        (error, timed_out), session = worker.exit_error(), worker.opening
        tasks = worker.clear_process()
        cancelled = bool(tasks) and tasks[0].cancelled
        if session is not None and not cancelled:
            session.failed_builds += 1
            if session.failed_builds >= session.attempts:
                session.error = error
        running = tasks.popleft() if tasks and (session is None or cancelled) else None
        if tasks:
            worker.own_batches.appendleft(tasks)
        if running is None:
            return
        if running.cancelled:
            running.future.set_exception(TaskCancelled("this task was cancelled"))
        elif running.tries > 1 and not timed_out:
            running.tries -= 1
            worker.retry_task = running
        else:
            running.future.set_exception(error)

    def _end_task(self, future: object, force: bool) -> None:
        for worker in self.workers:
            for task in worker.assigned_tasks():
                if task.future is not future:
                    continue
                task.cancelled = True
                if not (worker.tasks and task is worker.tasks[0]):
                    continue  # not started
                if force:
                    worker.kill()
                else:
                    worker.send(InterruptTask(task.number))

    def _shut_down(self) -> None:
        """Lets idle workers exit, ends the others, and cancels the remaining work."""
        remaining: list[PendingTask] = []
        for worker in self.workers:
            if worker.process is not None and not (worker.busy or self._killed):
                worker.send(None)
            else:
                worker.kill()
            remaining += worker.assigned_tasks()
            worker.tasks, worker.retry_task, worker.own_batches = deque(), None, deque()
        for worker in self.workers:
            if worker.process is not None:
                with suppress(subprocess.TimeoutExpired):
                    worker.process.wait(5.0)
                worker.kill()
                worker.clear_process()
        with self._lock:
            remaining += itertools.chain.from_iterable(self._shared)
            self._shared.clear()
            self._ended = True
            self._wake_receiver.close()
            self._wake_sender.close()
        for task in remaining:
            if task.started or task.future.set_running_or_notify_cancel():
                task.future.set_exception(TaskCancelled("the worker processes were stopped"))


def _begin_task(task: PendingTask) -> Any:
    """Marks a task as started; returns its message to a worker, or None if the task is cancelled or
    cannot be sent, as its future then tells."""
    if not task.started and not task.future.set_running_or_notify_cancel():
        return None
    task.started = True
    session = task.task.session
    if task.cancelled:
        task.future.set_exception(TaskCancelled("this task was cancelled"))
    elif session is not None and session.error is not None:
        task.future.set_exception(session.error)
    else:
        try:
            return task.call()
        except Exception as error:  # it cannot be pickled
            task.future.set_exception(error)
    return None


def _report_task_progress(task: PendingTask, message: Any) -> None:
    if task.task.on_progress is not None and not task.cancelled:
        try:
            task.task.on_progress(message)
        except Exception:
            _log.exception("the callback for the progress of a task failed")


def _set_task_result(task: PendingTask, message: TaskDone) -> None:
    if message.error is None:
        task.future.set_result(message.result)
    else:
        task.future.set_exception(_with_worker_traceback(message.error, message.traceback_text))


def _with_worker_traceback(error: BaseException, traceback_text: str) -> BaseException:
    error.__cause__ = WorkerTraceback(f"in a worker process:\n{traceback_text}")
    return error
