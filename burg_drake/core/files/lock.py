"""The lock of a file by which processes keep out of each other's way.

The system drops it when the file is closed, or the process ends, however that comes about. What a
lock stands for, and who waits how long for it, is said where it is used.
"""

from __future__ import annotations

import fcntl


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
