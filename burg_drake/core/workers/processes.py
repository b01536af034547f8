"""Worker processes: fresh interpreters that talk over a pipe.

Unlike multiprocessing's they never import the user's main module, so that scripts and notebooks
need no special guard; and they are never forked, which Drake does not survive.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from multiprocessing.connection import Connection, Pipe

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.workers.allocator import PRELOAD, restore_preload, worker_preload

FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a process from outside: the system when memory runs out, a batch system, a user.
All others (SIGSEGV, SIGABRT) are of its own making, and would come again."""
LOOK = 1.0
"""Between two looks of a worker whether its parent is there [s]."""
ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM")
} | {"LP_NUM_THREADS": "0"}
"""Environment of a worker: parallelism is in the processes, and sums keep their order. The last is
of Mesa's renderer without a GPU: 0 are threads besides the one that calls it."""


def default_workers() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def worker_count(workers: int | None) -> int:
    """A number of workers that was asked for; as many as there are processors if None.

    Raises:
        InvalidInputError: it is below 1.
    """
    count = default_workers() if workers is None else workers
    if count < 1:
        raise InvalidInputError(f"workers is {count}; give 1 or more")
    return count


def start_worker(module: str, *arguments: bool) -> tuple[subprocess.Popen[bytes], Connection]:
    """Starts a process with our import path.

    An interrupt from the keyboard reaches the whole group of processes. Workers start with it
    blocked: the parent alone decides what it means. They end when their parent does, also while
    they are at work and do not look at their pipe: a parent that is killed cannot end them.

    They have a faster allocator where there is one (`allocator`); what they start does not.

    Args:
        module: has a function `main(handle: int)`, called with the file descriptor of its end of
            the pipe.
        arguments: of that function, after the first.

    Returns:
        The process and our end of the pipe.
    """
    ours, theirs = Pipe()
    program = (
        f"import sys; sys.path[:] = {sys.path!r};"
        f" from {__name__} import end_with_parent; end_with_parent({os.getpid()});"
        f" from {restore_preload.__module__} import restore_preload;"
        f" restore_preload({os.environ.get(PRELOAD)!r});"
        f" from {module} import main;"
        f" main{(theirs.fileno(), *arguments)!r}"
    )
    environment = {**os.environ, **ONE_THREAD, **worker_preload()}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        process = subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            env=environment,
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    theirs.close()
    return process, ours


def end_with_parent(parent: int) -> None:
    """Has this process end as soon as its parent, a process identifier, is another one."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()


def exit_cause(process: subprocess.Popen[bytes], reason: str = "") -> str:
    """Why a worker process ended, in half a sentence; waits for its end.

    Args:
        process: the worker.
        reason: what it has said itself about that.
    """
    code = process.wait()
    if code < 0:
        name = signal.Signals(-code).name
        outside = " from outside" if was_ended_from_outside(process) else ""
        return f"the worker process was killed{outside} by {name}"
    return f"the worker process ended: {reason or f'exit code {code}'}"


def was_ended_from_outside(process: subprocess.Popen[bytes]) -> bool:
    """Whether a worker process was ended by one of `FROM_OUTSIDE`; waits for its end."""
    return -process.wait() in FROM_OUTSIDE
