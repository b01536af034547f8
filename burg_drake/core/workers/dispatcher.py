"""The thread of a pool: it hands work to the processes, hears of them, and deals with deaths."""

from __future__ import annotations

import itertools
import logging
import pickle
import subprocess
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Pipe, wait
from typing import Any

from burg_drake.core.errors import TaskCancelled
from burg_drake.core.workers.messages import (
    Done,
    Ending,
    Interrupt,
    Message,
    ProgressMessage,
    SessionOpened,
)
from burg_drake.core.workers.shared_queue import SharedQueue
from burg_drake.core.workers.worker_process import Batch, PendingTask, Worker

GRACE = 5.0
"""Time that an idle worker is given to end by itself [s]."""
_log = logging.getLogger("burg_drake")


class WorkerTraceback(Exception):
    """The cause of an error that comes from a worker: where it was raised there."""


class Dispatcher:
    """Open work and the workers that do it.

    What begins with an underscore belongs to its thread.

    Attributes:
        workers: places for processes.
    """

    def __init__(self, workers: list[Worker]) -> None:
        self.workers = workers
        self._shared = SharedQueue()
        self._lock = threading.Lock()
        self._asked: deque[Callable[[], None]] = deque()
        self._alarm, self._bell = Pipe(duplex=False)
        self._signalled = self._closed = self._killed = self._ended = False
        self._thread = threading.Thread(target=self._run, name="worker-pool", daemon=True)
        self._thread.start()

    def put(self, batch: Batch, worker: int | None) -> None:
        """Adds work, for one worker alone or for any."""
        with self._lock:
            if self._ended:
                raise RuntimeError("cannot schedule new futures: the pool has ended")
            if worker is None:
                self._shared.put(batch)
            else:
                self.workers[worker].own.append(batch)
        self._ring()

    def end_task(self, future: object, force: bool) -> None:
        """Ends a task that runs; see `WorkerFuture.interrupt` and `terminate`."""
        with self._lock:
            self._asked.append(lambda: self._end_task(future, force))
        self._ring()

    def cancel_waiting(self) -> None:
        """Gives up what no worker has."""
        with self._lock:
            batches = [*self._shared, *(batch for worker in self.workers for batch in worker.own)]
        for task in itertools.chain.from_iterable(batches):
            task.future.cancel()

    def close(self) -> None:
        """Ends the processes when all work is done."""
        self._closed = True
        self._ring()

    def kill(self) -> None:
        """Ends the processes at once."""
        self._killed = True
        for worker in self.workers:
            worker.kill()
        self._ring()

    def join(self, timeout: float | None = None) -> None:
        """Waits until all is ended; nothing in the dispatcher's own thread."""
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout)

    def _ring(self) -> None:
        with self._lock:
            if self._signalled:
                return
            self._signalled = True
            with suppress(OSError):  # the thread has ended
                self._bell.send_bytes(b"!")

    def _run(self) -> None:
        try:
            while not self._killed:
                self._hand_out()
                if self._closed and not self._any_left():
                    break
                self._listen()
        finally:
            self._end()

    def _listen(self) -> None:
        by_connection = {w.connection: w for w in self.workers if w.connection is not None}
        for ready in wait([self._alarm, *by_connection]):
            if ready is not self._alarm:
                self._receive(by_connection[ready])  # type: ignore[index]
                continue
            with self._lock:
                self._alarm.recv_bytes()
                self._signalled = False
                asked, self._asked = self._asked, deque()
            for request in asked:
                request()

    def _any_left(self) -> bool:
        with self._lock:
            return bool(self._shared) or any(worker.started() for worker in self.workers)

    def _hand_out(self) -> None:
        """Gives idle workers something to do: first what is theirs, then the oldest work."""
        for take in (self._take_own, self._take_any):
            for worker in sorted(self.workers, key=lambda worker: worker.process is None):
                while not worker.busy and (batch := take(worker)):
                    self._give(worker, batch)

    def _take_own(self, worker: Worker) -> Batch | None:
        if worker.suspect is not None:
            suspect, worker.suspect = worker.suspect, None
            return deque([suspect])
        with self._lock:
            if worker.own:
                return worker.own.popleft()
            return self._shared.take(reversed(worker.sessions))

    def _take_any(self, worker: Worker) -> Batch | None:
        with self._lock:
            return self._shared.take_oldest()

    def _give(self, worker: Worker, batch: Batch) -> None:
        calls = [(task, call) for task in batch if (call := _ready(task)) is not None]
        if not calls:
            return
        tasks: Batch = deque(task for task, _ in calls)
        try:
            worker.start()
            while not worker.give(tasks, tuple(call for _, call in calls)):
                worker.kill()
                worker.forget()
                worker.start()
        except OSError as error:
            for task in tasks:
                task.future.set_exception(error)

    def _receive(self, worker: Worker) -> None:
        assert worker.connection is not None
        try:
            data = worker.connection.recv_bytes()
        except (EOFError, OSError):
            self._died(worker)
            return
        try:
            message: Message = pickle.loads(data)
        except Exception as error:  # a result whose class is not what it was
            if worker.tasks:
                worker.tasks.popleft().future.set_exception(error)
            return
        task = worker.tasks[0] if worker.tasks else None
        if isinstance(message, Ending):
            worker.reason = message.reason
        elif isinstance(message, SessionOpened):
            self._opened(worker, message)
        elif task is None or task.number != message.number:
            pass
        elif isinstance(message, ProgressMessage):
            _progress(task, message.message)
        else:
            _finish(worker.tasks.popleft(), message)

    def _opened(self, worker: Worker, message: SessionOpened) -> None:
        session, worker.opening = worker.opening, None
        assert session is not None
        if message.error is None:
            session.false_starts = 0
            worker.sessions[session.key] = None
            return
        session.error = _with_worker_traceback(message.error, message.where)
        tasks, worker.tasks = worker.tasks, deque()
        for task in tasks:
            task.future.set_exception(session.error)

    def _died(self, worker: Worker) -> None:
        """The task that a worker was at when it died is suspect, the rest of its work is kept."""
        if self._killed:  # it is cleaned up at the end
            return
        (error, overdue), session = worker.exit_error(), worker.opening
        tasks = worker.forget()
        cancelled = bool(tasks) and tasks[0].cancelled
        if session is not None and not cancelled:
            session.false_starts += 1
            if session.false_starts >= session.attempts:
                session.error = error
        suspect = tasks.popleft() if tasks and (session is None or cancelled) else None
        if tasks:
            worker.own.appendleft(tasks)
        if suspect is None:
            return
        if suspect.cancelled:
            suspect.future.set_exception(TaskCancelled("this task was cancelled"))
        elif suspect.tries > 1 and not overdue:
            suspect.tries -= 1
            worker.suspect = suspect
        else:
            suspect.future.set_exception(error)

    def _end_task(self, future: object, force: bool) -> None:
        for worker in self.workers:
            for task in worker.started():
                if task.future is not future:
                    continue
                task.cancelled = True
                if not (worker.tasks and task is worker.tasks[0]):
                    continue  # it is not begun
                if force:
                    worker.kill()
                else:
                    worker.send(Interrupt(task.number))

    def _end(self) -> None:
        """Lets idle workers end by themselves, ends the others, and all work that is left."""
        left: list[PendingTask] = []
        for worker in self.workers:
            if worker.process is not None and not (worker.busy or self._killed):
                worker.send(None)
            else:
                worker.kill()
            left += worker.started()
            worker.tasks, worker.suspect, worker.own = deque(), None, deque()
        for worker in self.workers:
            if worker.process is not None:
                with suppress(subprocess.TimeoutExpired):
                    worker.process.wait(GRACE)
                worker.kill()
                worker.forget()
        with self._lock:
            left += itertools.chain.from_iterable(self._shared.clear())
            self._ended = True
            self._alarm.close()
            self._bell.close()
        for task in left:
            if task.started or task.future.set_running_or_notify_cancel():
                task.future.set_exception(TaskCancelled("the worker processes were stopped"))


def _ready(task: PendingTask) -> Any:
    """What a worker is sent of a task; None if that is not to be done, as its future says then."""
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


def _progress(task: PendingTask, message: Any) -> None:
    if task.task.on_progress is not None and not task.cancelled:
        try:
            task.task.on_progress(message)
        except Exception:
            _log.exception("the callback for the progress of a task failed")


def _finish(task: PendingTask, message: Done) -> None:
    if message.error is None:
        task.future.set_result(message.result)
    else:
        task.future.set_exception(_with_worker_traceback(message.error, message.where))


def _with_worker_traceback(error: BaseException, where: str) -> BaseException:
    error.__cause__ = WorkerTraceback(f"in a worker process:\n{where}")
    return error
