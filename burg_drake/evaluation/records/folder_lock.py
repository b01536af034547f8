"""Who writes a folder: one process at a time, told by a lock that the system drops when it ends.

Several can share it to read what must not change meanwhile.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from burg_drake.core import InvalidInputError
from burg_drake.core.files import try_lock, without_locks

LOCK_ATTEMPTS = 5
LOCK_RETRY_INTERVAL = 0.02
"""Seconds between attempts: who checks whether a folder is being written holds it for a moment."""


def lock(file: int, path: Path) -> None:
    """Locks an open file, whose path is for messages; closes it if that fails.

    Raises:
        InvalidInputError: another process has it, or its file system has no locks.
    """
    try:
        for k in range(LOCK_ATTEMPTS):
            if try_lock(file):
                return
            time.sleep(LOCK_RETRY_INTERVAL if k + 1 < LOCK_ATTEMPTS else 0.0)
    except OSError as error:
        os.close(file)
        raise without_locks(path.parent, error) from error
    os.close(file)
    raise being_written(path.parent)


def is_locked(path: Path) -> bool:
    """Whether a process holds the lock of a file; none does where the file system has no locks."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return not try_lock(file, shared=True)
    except OSError:
        return False
    finally:
        os.close(file)


@contextmanager
def unchanged(path: Path, *, make: bool = False) -> Iterator[None]:
    """Keeps others from writing the folder that a file stands for; they may read it.

    Args:
        path: the file. Where there is none nothing is locked; nor on a file system without locks,
            where nothing writes.
        make: make it if need be and possible.

    Raises:
        InvalidInputError: another process is writing it.
    """
    try:
        file = _open_to_share(path, os.O_CREAT if make else 0)
    except OSError:
        yield
        return
    try:
        try:
            shared = try_lock(file, shared=True)
        except OSError:
            shared = True
        if not shared:
            raise being_written(path.parent)
        yield
    finally:
        os.close(file)


def _open_to_share(path: Path, make: int) -> int:
    try:
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK | make, 0o666)
    except OSError:  # in a folder that cannot be written, for example
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK)


def being_written(folder: Path) -> InvalidInputError:
    """The error about a folder that another process has."""
    return InvalidInputError(
        f"{folder} is being written by another process; wait for it, or choose another folder"
    )


class Lock:
    """A file that stands for its folder, locked."""

    def __init__(self, path: Path) -> None:
        """Makes the file if need be, and locks it.

        Raises:
            InvalidInputError: it cannot be written, another process has it, or its file system has
                no locks.
        """
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
        lock(self._file, path)

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self._file)
