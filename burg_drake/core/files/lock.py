"""The lock of a file by which processes keep out of each other's way.

The system drops it when the file is closed, or the process ends, however that comes about. What a
lock stands for, and who waits how long for it, is said where it is used.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from burg_drake.core.errors import InvalidInputError


def try_lock(file: int, *, shared: bool = False) -> bool:
    """Locks an open file, if no other process has it.

    Args:
        file: descriptor.
        shared: others may share it; else it is for this process alone.

    Raises:
        OSError: its file system has no locks.
    """
    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def without_locks(path: Path, error: OSError) -> InvalidInputError:
    """The error about a file or folder on a file system that has no locks.

    Args:
        path: the file or folder.
        error: of `try_lock`.
    """
    return InvalidInputError(
        f"{path} is on a file system without file locks ({error.strerror}), where two"
        " programs could overwrite each other's data; choose a folder on another file"
        " system"
    )


class FolderLock:
    """A folder that one process at a time writes, locked itself: no file is left in it."""

    def __init__(self, folder: Path) -> None:
        """Locks a folder that is there.

        Raises:
            InvalidInputError: another process is writing it, it cannot be opened, or its file
                system has no locks.
        """
        try:
            file = os.open(folder, os.O_RDONLY)
        except OSError as error:
            raise InvalidInputError(f"cannot open {folder}: {error.strerror}") from error
        try:
            if try_lock(file):
                self._file: int | None = file
                return
        except OSError as error:
            os.close(file)
            raise without_locks(folder, error).about("folder") from error
        os.close(file)
        raise InvalidInputError(
            f"{folder} is being written by another process; wait for it, or choose another folder"
        ).about("folder")

    def release(self) -> None:
        """Lets others write; a second time does nothing."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
