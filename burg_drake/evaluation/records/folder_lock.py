"""Who writes a folder: one process at a time, told by a lock that the system drops when it ends.

Several can share it to read what must not change meanwhile.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from burg_drake.core import InvalidInputError
from burg_drake.core.files import try_lock

TRIES = 5
PAUSE = 0.02
"""Between two tries [s]: who looks whether a folder is being written holds it for a moment."""


def lock(file: int) -> bool:
    """Locks an open file; whether that went well."""
    for k in range(TRIES):
        with suppress(OSError):
            if try_lock(file):
                return True
        time.sleep(PAUSE if k + 1 < TRIES else 0.0)
    return False


def is_locked(path: Path) -> bool:
    """Whether a process holds the lock of a file."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return not try_lock(file, shared=True)
    except OSError:
        return True
    finally:
        os.close(file)


@contextmanager
def unchanged(path: Path, *, make: bool = False) -> Iterator[None]:
    """Keeps others from writing the folder that a file stands for; they may read it.

    Args:
        path: the file. Where there is none nothing is locked.
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
            shared = False
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
            InvalidInputError: it cannot be written, or another process has it.
        """
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
        if not lock(self._file):
            os.close(self._file)
            raise being_written(path.parent)

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self._file)
