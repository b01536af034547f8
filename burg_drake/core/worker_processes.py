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
    """Where allocators are found, and the environment variables that choose and preload one."""

    variable = "BURG_DRAKE_ALLOCATOR"  # Path of a library, or `none`.
    preload_variable = "LD_PRELOAD"
    wheel_library = "cmeel.prefix/lib/libmimalloc.so"  # Of the package cmeel-mimalloc.
    # Of distributions, best first (`benchmarks/allocators.py`).
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
    """What is to be added to the environment in which a worker starts; nothing but on Linux.

    The variable `BURG_DRAKE_ALLOCATOR` has the path of a library, or `none`. What the user preloads
    comes first and stays, and if that brings an allocator, nothing is added.

    Args:
        environment: that of this process; in it libraries are tried, too.
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
    """Called by a worker: what it starts is preloaded with what its parent was.

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
    """Libraries that may do, the one to be tried first first.

    Args:
        folders: where packages are looked for; where Python does if None.
        system: where libraries of the system are; the usual places if None.
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
    """Where libraries are: of this environment (conda), of Debian's kind, of the others."""
    debian = f"/usr/lib/{platform.machine()}-linux-gnu"
    return [f"{sys.prefix}/lib", "/usr/local/lib", debian, "/usr/lib64", "/usr/lib"]


def _address_space_is_limited() -> bool:
    """Whether this process may have so much address space only (`ulimit -v`), of which allocators
    reserve far more than they use."""
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


@functools.lru_cache(maxsize=16)
def _replaces_malloc(path: Path, changed: int, environment: tuple[tuple[str, str], ...]) -> bool:
    """Whether a process that is started with it works, has its malloc, and complains of nothing.

    Args:
        path: the library.
        changed: when [ns]; another one is tried again.
        environment: of the process, with the library in `LD_PRELOAD`.
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
    said = os.fsdecode(tried.stdout).strip()
    if tried.returncode == 0 and not tried.stderr and said == str(path):
        return True
    _log.debug("the allocator %s cannot be used: %s", path, os.fsdecode(tried.stderr) or said)
    return False


@functools.cache
def _warn_unusable(given: str) -> None:
    """One line a process."""
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

    They have a faster allocator where there is one, see `worker_preload`; what they start does not.

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
    """Has this process end as soon as its parent, a process identifier, is another one."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
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
    """Whether memory ran out, or a batch system or a user ended a worker; waits for its end.

    Other signals, such as SIGSEGV, would recur.
    """
    return -process.wait() in (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
