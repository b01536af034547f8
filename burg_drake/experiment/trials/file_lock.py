"""Writers of a trials file, and of what lies beside it, take turns by a lock on a file."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

from burg_drake.core import InvalidInputError
from burg_drake.core.files import try_lock, without_locks

LOCK_TIMEOUT = 30.0
"""Time to wait for other writers, each of which takes some hundredths of a second [s]."""
TURN = 0.01
"""Time between two attempts to get the lock [s]."""


@contextlib.contextmanager
def exclusive(sheet_path: Path) -> Iterator[None]:
    """One writer at a time; the end of its process, however it comes, releases the lock.

    Args:
        sheet_path: the trials file.

    Raises:
        InvalidInputError: the lock cannot be made, or another process keeps it.
    """
    real = Path(os.path.realpath(sheet_path))  # all links to a file share its lock
    path = real.with_name(f".{real.name}.lock")
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
    try:
        _wait_for(file, sheet_path)
        yield
    finally:
        os.close(file)


def _wait_for(file: int, sheet_path: Path) -> None:
    until = time.monotonic() + LOCK_TIMEOUT
    while True:
        try:
            if try_lock(file):
                return
        except OSError as error:
            raise without_locks(sheet_path, error) from error
        if time.monotonic() > until:
            raise InvalidInputError(
                f"{sheet_path} has been locked by another process for {LOCK_TIMEOUT:g} s; nothing"
                " was recorded"
            )
        time.sleep(TURN)
