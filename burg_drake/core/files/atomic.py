"""Reading nothing but files, and writing them whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from burg_drake.core.errors import InvalidInputError, shown

UNFINISHED = re.compile(r"\..+\.[0-9a-f]{16}")
"""Names of what `atomic_write` has not renamed yet."""


def open_regular(path: str | Path) -> BinaryIO:
    """Opens a file for reading bytes; a folder, device or pipe is refused, as it may never end.

    Raises:
        InvalidInputError: it is not there, cannot be read, or is not a file.
    """
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISREG(mode):
            return open(path, "rb", opener=_open_at_once)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not a valid path"  # with NUL
        raise InvalidInputError(f"cannot read {shown(str(path), 500)}: {why}") from error
    if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
        raise InvalidInputError(f"cannot read {path}: it is a pipe; save it to a file first")
    kind = "a folder" if stat.S_ISDIR(mode) else "a device"
    raise InvalidInputError(f"cannot read {path}: it is {kind}; expected a file")


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)  # should it have become a pipe meanwhile


def atomic_write(path: str | Path, content: str | bytes) -> None:
    """Writes `content` beside `path` and renames it into place; parent folders are made.

    A file that is replaced keeps its permissions, and a link to it stays one.

    Args:
        path: file to write or replace.
        content: text (stored as UTF-8) or bytes.

    Raises:
        InvalidInputError: the place cannot be written to.
    """
    atomic_write_all({Path(path): content})


def atomic_write_all(contents: Mapping[Path, str | bytes]) -> None:
    """Writes several files, and renames them into place only when all of them are on the disk; see
    `atomic_write`.

    Args:
        contents: text (stored as UTF-8) or bytes by file.

    Raises:
        InvalidInputError: one of the places cannot be written to; then none is replaced, unless it
            is the renaming that fails.
    """
    written: dict[Path, Path] = {}
    path = Path()
    try:
        for path, content in contents.items():
            _require_regular_file(path)
            target = Path(os.path.realpath(path))
            target.parent.mkdir(parents=True, exist_ok=True)
            temporary = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
            with temporary.open("xb") as stream:  # with the permissions that the umask leaves
                written[target] = temporary
                keep_mode(target, stream.fileno())
                stream.write(content.encode() if isinstance(content, str) else content)
                stream.flush()
                os.fsync(stream.fileno())
        for path, temporary in written.items():
            os.replace(temporary, path)
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place"
        ) from error
    finally:
        for temporary in written.values():
            temporary.unlink(missing_ok=True)


def keep_mode(path: Path, file: int) -> None:
    """Gives an open file the permissions of the one that it is to replace, if there is one."""
    with contextlib.suppress(FileNotFoundError):
        os.fchmod(file, stat.S_IMODE(path.stat().st_mode))


def remove_unfinished(folder: Path) -> None:
    """Removes what `atomic_write` leaves in a folder when its process is killed."""
    for path in folder.iterdir():
        if UNFINISHED.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


def writable_folder(path: str | Path) -> Path:
    """Makes `path` a folder that can be written to, before any work is spent on its contents.

    Raises:
        InvalidInputError: `path` is a file, or nothing can be written there.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        why = "it is a file" if path.is_file() else error.strerror or error
        raise InvalidInputError(
            f"cannot write to folder {path}: {why}; choose a writable place"
        ) from error
    return path


def require_writable(path: str | Path) -> None:
    """Finds out whether a file can be written, before any work is spent on it; makes none.

    Raises:
        InvalidInputError: `path` is a folder or a device, or nothing can be written where it is to
            be.
    """
    path = Path(path)
    try:
        _require_regular_file(path)
        with tempfile.TemporaryFile(dir=next(p for p in path.absolute().parents if p.exists())):
            pass
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place"
        ) from error


def _require_regular_file(path: Path) -> None:
    """Refuses what is there and is not a file: a folder, or a device that a file would replace."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "it is a folder, not a file")
    if path.exists() and not path.is_file():
        raise FileExistsError(errno.EEXIST, "it is a pipe or a device, not a file")
