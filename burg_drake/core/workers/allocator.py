"""A faster memory allocator for worker processes, where the machine has one.

Trials ask for memory all the time, of which nothing depends on its addresses: with another malloc
they have the same bits in less time. A library that replaces it has to be there when a process
starts (`LD_PRELOAD`), so workers are started with it; this process stays as it is.

What the linker cannot load it complains about in every process, and an allocator that does not suit
the machine ends them. So a library is tried in a process of its own before it is used, by each
process that starts workers, as the next machine that sees the same folders may lack what it needs;
that takes 20 ms.
"""

from __future__ import annotations

import functools
import itertools
import logging
import os
import platform
import resource
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

VARIABLE = "BURG_DRAKE_ALLOCATOR"
OFF = "none"
PRELOAD = "LD_PRELOAD"
WHEEL_LIBRARY = "cmeel.prefix/lib/libmimalloc.so"
"""In a folder of packages: what the package cmeel-mimalloc installs."""
SYSTEM_LIBRARIES = (
    "libtcmalloc_minimal.so.4",
    "libjemalloc.so.2",
    "libmimalloc.so.3",
    "libmimalloc.so.2",
)
"""Of distributions, the best first (`benchmarks/allocators.py`)."""
PATIENCE = 10.0
"""Time that a library has to show that it works [s]."""
KEPT = 16
"""Trials whose results are kept, the latest ones."""
SEPARATORS = " :"
"""Between the libraries of `LD_PRELOAD`; there is no way to quote them."""
IDENTITY = slice(4, 6)
MACHINE = slice(16, 20)
"""Where the header of an ELF file has its word size and byte order, and its type and machine."""
SHARED = 3
"""Type of a shared library."""
PROBE = """\
import ctypes

class Symbol(ctypes.Structure):
    _fields_ = [("file", ctypes.c_char_p), ("_1", ctypes.c_void_p),
                ("_2", ctypes.c_char_p), ("_3", ctypes.c_void_p)]

program, symbol = ctypes.CDLL(None), Symbol()
blocks = [bytearray(1 << k) for k in range(22)]
found = program.dladdr(program.malloc_usable_size, ctypes.byref(symbol))
print(found and symbol.file.decode())
"""
"""Says which file the process has its memory from. A program that is not position-independent, as
Debian's Python, gives itself as the file of functions that it calls, such as malloc."""

_log = logging.getLogger("burg_drake")


def worker_preload(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """What is to be added to the environment in which a worker starts; nothing but on Linux.

    The variable `BURG_DRAKE_ALLOCATOR` has the path of a library, or `none`. What the user preloads
    comes first and stays, and if that brings an allocator, nothing is added.

    Args:
        environment: that of this process; in it libraries are tried, too.
    """
    given = environment.get(VARIABLE, "").strip()
    if sys.platform != "linux" or given.lower() == OFF or _address_space_is_limited():
        return {}
    before = environment.get(PRELOAD, "")
    for path in [Path(os.path.expanduser(given)).absolute()] if given else installed_allocators():
        preload = f"{before}:{path}" if before else str(path)
        tried = tuple(sorted({**environment, PRELOAD: preload}.items()))
        if _can_be_preloaded(path) and _replaces_malloc(path, _changed(path), tried):
            _log.debug("workers start with the allocator %s", path)
            return {PRELOAD: preload}
    if given:
        _warn(given)
    return {}


def restore_preload(before: str | None) -> None:
    """Called by a worker: what it starts is preloaded with what its parent was.

    Args:
        before: the parent's `LD_PRELOAD`, if any.
    """
    if before is None:
        os.environ.pop(PRELOAD, None)
    else:
        os.environ[PRELOAD] = before


def installed_allocators(
    folders: Sequence[str] | None = None, system: Sequence[str] | None = None
) -> Iterator[Path]:
    """Libraries that may do, the one to be tried first first.

    Args:
        folders: where packages are looked for; where Python does if None.
        system: where libraries of the system are; the usual places if None.
    """
    for folder in sys.path if folders is None else folders:
        path = Path(folder, WHEEL_LIBRARY)
        if path.is_absolute() and path.is_file():
            yield path
    places = _system_folders() if system is None else system
    for name, place in itertools.product(SYSTEM_LIBRARIES, places):
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


def _can_be_preloaded(path: Path) -> bool:
    """Whether a file is a shared library for this interpreter, and can be named to the linker."""
    if not path.is_absolute() or any(separator in str(path) for separator in SEPARATORS):
        return False
    ours, found = _elf_header(Path("/proc/self/exe")), _elf_header(path)
    if ours is None or found is None or int.from_bytes(found[MACHINE][:2], sys.byteorder) != SHARED:
        return False
    return (found[IDENTITY], found[MACHINE][2:]) == (ours[IDENTITY], ours[MACHINE][2:])


def _elf_header(path: Path) -> bytes | None:
    """The beginning of an ELF file; None if it is none."""
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            header = file.read(MACHINE.stop)
    except OSError:
        return None
    return header if header[:4] == b"\x7fELF" and len(header) == MACHINE.stop else None


def _changed(path: Path) -> int:
    """When a file was changed [ns]."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


@functools.lru_cache(maxsize=KEPT)
def _replaces_malloc(path: Path, changed: int, environment: tuple[tuple[str, str], ...]) -> bool:
    """Whether a process that is started with it works, has its malloc, and complains of nothing.

    Args:
        path: the library.
        changed: when [ns]; another one is tried again.
        environment: of the process, with the library in `LD_PRELOAD`.
    """
    try:
        tried = subprocess.run(
            [sys.executable, "-I", "-S", "-c", PROBE],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=dict(environment),
            timeout=PATIENCE,
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
def _warn(given: str) -> None:
    """One line a process."""
    path = os.path.abspath(os.path.expanduser(given))
    why = "is not an allocator that can be preloaded on this system"
    if not os.path.exists(path):
        why = "cannot be found"
    elif any(separator in path for separator in SEPARATORS):
        why = "has a space or a colon in its path and so cannot be preloaded"
    _log.warning("%s: %s %s; workers run without it", VARIABLE, given, why)
