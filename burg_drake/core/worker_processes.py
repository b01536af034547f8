"""Starting and ending worker processes: fresh interpreters that communicate over a pipe.

Where a faster memory allocator is installed (Linux only), it is preloaded into the workers:
evaluation allocates many small blocks.
"""

from __future__ import annotations

import functools
import itertools
import logging
import os
import platform
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing.connection import Connection, Pipe
from pathlib import Path

from burg_drake.core.errors import InvalidInputError


class AllocatorSettings:
    """Paths of allocators, and the environment variables that choose and preload one."""

    variable = "BURG_DRAKE_ALLOCATOR"  # Path of a library, or `none`.
    preload_variable = "LD_PRELOAD"
    wheel_library = "cmeel.prefix/lib/libmimalloc.so"  # From the package cmeel-mimalloc.
    # From Linux distributions, best first (`benchmarks/allocators.py`).
    system_libraries = (
        "libtcmalloc_minimal.so.4",
        "libjemalloc.so.2",
        "libmimalloc.so.3",
        "libmimalloc.so.2",
    )


ALLOCATOR_PROBE = """\
import ctypes

class Symbol(ctypes.Structure):
    _fields_ = [("file", ctypes.c_char_p), ("_1", ctypes.c_void_p),
                ("_2", ctypes.c_char_p), ("_3", ctypes.c_void_p)]

program, symbol = ctypes.CDLL(None), Symbol()
blocks = [bytearray(1 << k) for k in range(22)]
found = program.dladdr(program.malloc_usable_size, ctypes.byref(symbol))
print(found and symbol.file.decode())
"""
"""Prints the file that malloc comes from; the program itself if not position-independent."""

_log = logging.getLogger("burg_drake")


def worker_preload(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Environment variables to add for a worker, to preload an allocator; empty except on Linux.

    The variable `BURG_DRAKE_ALLOCATOR` has the path of a library, or `none`. Libraries that the
    user preloads come first, and if they include an allocator, nothing is added.

    Args:
        environment: environment of this process, in which libraries are also tested.
    """
    given = environment.get(AllocatorSettings.variable, "").strip()
    if sys.platform != "linux" or given.lower() == "none" or _address_space_is_limited():
        return {}
    before = environment.get(AllocatorSettings.preload_variable, "")
    for path in [Path(os.path.expanduser(given)).absolute()] if given else installed_allocators():
        preload = f"{before}:{path}" if before else str(path)
        tried = tuple(sorted({**environment, AllocatorSettings.preload_variable: preload}.items()))
        if path.is_file() and _replaces_malloc(path, path.stat().st_mtime_ns, tried):
            _log.debug("workers start with the allocator %s", path)
            return {AllocatorSettings.preload_variable: preload}
    if given:
        _warn_unusable(given)
    return {}


def restore_preload(before: str | None) -> None:
    """Restores `LD_PRELOAD` in a worker, for its child processes.

    Args:
        before: the parent's `LD_PRELOAD`, if any.
    """
    if before is None:
        os.environ.pop(AllocatorSettings.preload_variable, None)
    else:
        os.environ[AllocatorSettings.preload_variable] = before


def installed_allocators(
    folders: Sequence[str] | None = None, system: Sequence[str] | None = None
) -> Iterator[Path]:
    """Candidate allocator libraries, best first.

    Args:
        folders: folders of Python packages; those of Python if None.
        system: folders of system libraries; the usual ones if None.
    """
    for folder in sys.path if folders is None else folders:
        path = Path(folder, AllocatorSettings.wheel_library)
        if path.is_absolute() and path.is_file():
            yield path
    places = _system_folders() if system is None else system
    for name, place in itertools.product(AllocatorSettings.system_libraries, places):
        if (path := Path(place, name)).is_file():
            yield path


def _system_folders() -> list[str]:
    """Folders of libraries: of this environment (conda), of Debian and its derivatives, of
    others."""
    debian = f"/usr/lib/{platform.machine()}-linux-gnu"
    return [f"{sys.prefix}/lib", "/usr/local/lib", debian, "/usr/lib64", "/usr/lib"]


def _address_space_is_limited() -> bool:
    """Whether the address space of this process is limited (`ulimit -v`); allocators reserve far
    more than they use."""
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


@functools.lru_cache(maxsize=16)
def _replaces_malloc(path: Path, changed: int, environment: tuple[tuple[str, str], ...]) -> bool:
    """Whether a process that preloads a library works, uses its malloc, and reports no error.

    Args:
        path: the library.
        changed: modification time [ns]; a changed library is tested again.
        environment: environment of the process, with the library in `LD_PRELOAD`.
    """
    try:
        tried = subprocess.run(
            [sys.executable, "-I", "-S", "-c", ALLOCATOR_PROBE],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=dict(environment),
            timeout=10.0,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    output = os.fsdecode(tried.stdout).strip()
    if tried.returncode == 0 and not tried.stderr and output == str(path):
        return True
    _log.debug("the allocator %s cannot be used: %s", path, os.fsdecode(tried.stderr) or output)
    return False


@functools.cache
def _warn_unusable(given: str) -> None:
    """Logs once per process that a library cannot be used."""
    path = os.path.abspath(os.path.expanduser(given))
    why = "is not an allocator that can be preloaded on this system"
    if not os.path.exists(path):
        why = "cannot be found"
    elif any(separator in path for separator in " :"):
        why = "has a space or a colon in its path and so cannot be preloaded"
    _log.warning("%s: %s %s; workers run without it", AllocatorSettings.variable, given, why)


SINGLE_THREAD_ENVIRONMENT = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM")
} | {"LP_NUM_THREADS": "0"}
"""One thread per worker, so that sums keep their order. LP_NUM_THREADS is for Mesa."""


def default_workers() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def worker_count(workers: int | None) -> int:
    """The given number of workers; the number of processors if None.

    Raises:
        InvalidInputError: it is below 1.
    """
    count = default_workers() if workers is None else workers
    if count < 1:
        raise InvalidInputError(f"workers is {count}; give 1 or more")
    return count


def start_worker(module: str, *arguments: bool) -> tuple[subprocess.Popen[bytes], Connection]:
    """Starts a process with our import path.

    A keyboard interrupt reaches the whole process group. Workers start with it blocked, so that
    only the parent handles it. They end when their parent does, even while they work and do not
    read their pipe, as a killed parent cannot end them. They use a faster allocator if there is
    one, see `worker_preload`; their child processes do not.

    Args:
        module: module with a function `main(handle: int)`, called with the file descriptor of its
            end of the pipe.
        arguments: further arguments of that function.

    Returns:
        The process and our end of the pipe.
    """
    ours, theirs = Pipe()
    program = (
        f"import sys; sys.path[:] = {sys.path!r};"
        f" from {__name__} import end_with_parent; end_with_parent({os.getpid()});"
        f" from {restore_preload.__module__} import restore_preload;"
        f" restore_preload({os.environ.get(AllocatorSettings.preload_variable)!r});"
        f" from {module} import main;"
        f" main{(theirs.fileno(), *arguments)!r}"
    )
    environment = {**os.environ, **SINGLE_THREAD_ENVIRONMENT, **worker_preload()}
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
    """Ends this process as soon as its parent is not the process `parent` any more."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()


def exit_cause(process: subprocess.Popen[bytes], reason: str = "") -> str:
    """Cause of a worker process's end, as half a sentence; waits for its end.

    Args:
        process: the worker.
        reason: the worker's own explanation.
    """
    code = process.wait()
    if code < 0:
        name = signal.Signals(-code).name
        outside = " from outside" if was_ended_from_outside(process) else ""
        return f"the worker process was killed{outside} by {name}"
    return f"the worker process ended: {reason or f'exit code {code}'}"


def was_ended_from_outside(process: subprocess.Popen[bytes]) -> bool:
    """Whether lack of memory, a batch system or a user ended a worker; waits for its end.

    Other signals, such as SIGSEGV, would recur.
    """
    return -process.wait() in (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
