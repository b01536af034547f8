"""The text of documents, and how much of it is read: the one place of all bounds.

Whatever a file holds, reading it ends, takes memory in proportion to these bounds at most, and
neither waits for another process nor drains a device.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core.errors import DocumentError

MIB = 1 << 20


@dataclass(frozen=True)
class Limits:
    """What a document may have at most.

    Attributes:
        size: bytes of its text.
        values: scalars, lists and mappings, those behind an alias once for each time it is used.
        depth: of lists and mappings in one another.
    """

    size: int
    values: int
    depth: int = 64


DOCUMENT = Limits(size=16 * MIB, values=1_000_000)
"""Of what people write, and of what this project keeps beside it. Keys are values, too; each takes
0.4 kB while it is read, all of them 0.4 GB. No document of this project is deeper than 10, and
Python's own limits begin at some hundred."""
GRASP_FILE = Limits(size=512 * MIB, values=10_000_000)
"""Of files of grasps, plans and tables, which programs write: 100,000 grasps of Isaac Sim's grasp
editor have 49 MB and 3,000,000 values, as many of GraspGen 36 MB and 2,100,000."""


def read_text(path: str | Path, limits: Limits = DOCUMENT) -> str:
    """The text of a document.

    Raises:
        DocumentError: it cannot be read, is too large, or no text.
    """
    data = read_bytes(path, limits)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise DocumentError(f"cannot read {path}: it is not a text file") from error


def read_bytes(path: str | Path, limits: Limits = DOCUMENT) -> bytes:
    """The content of a regular file; pipes and devices, which may never end, are refused.

    Raises:
        DocumentError: it cannot be read, or is too large.
    """
    require_regular(path)
    try:
        with open(path, "rb", opener=_without_waiting) as stream:
            data = stream.read(limits.size + 1)
    except OSError as error:
        raise DocumentError(f"cannot read {path}: {error.strerror or error}") from error
    if len(data) > limits.size:
        raise DocumentError(
            f"cannot read {path}: it has more than {limits.size // MIB} MiB, too much for such a"
            " file"
        )
    return data


def require_regular(path: str | Path) -> None:
    """Refuses what is no regular file, before anything opens it.

    Raises:
        DocumentError: there is nothing, or a folder, a pipe or a device.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:  # a NUL character is no part of a path
        reason = error.strerror if isinstance(error, OSError) else "it is no path"
        raise DocumentError(f"cannot read {path}: {reason}") from error
    if stat.S_ISDIR(mode):
        raise DocumentError(f"cannot read {path}: it is a folder; expected a file")
    if not stat.S_ISREG(mode):
        raise DocumentError(f"cannot read {path}: it is a pipe or a device; expected a file")


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)
