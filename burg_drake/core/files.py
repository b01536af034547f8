"""Reading files within bounds, writing them atomically, and locking them.

Reading a file always ends, uses memory in proportion to its `Limits`, and neither waits for another
process nor drains a device. Only `read_pipe` waits for another process to write.

The system releases a lock when the file is closed or its process ends.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import fcntl
import io
import lzma
import os
import re
import secrets
import shutil
import stat
import struct
import tempfile
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core.errors import DocumentError, InvalidInputError, shorten_text

READ_ERRORS = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    lzma.LZMAError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Errors besides OSError that numpy and h5py raise for damaged or foreign files."""


@contextmanager
def suppress_numpy_warnings() -> Iterator[None]:
    """Suppresses numpy's warnings about repaired headers and number overflow."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def report_read_errors(path: str | Path, kind: str) -> Iterator[None]:
    """Converts every error in reading a file to a message of one line that names the file.

    Args:
        path: the file.
        kind: what it should be, such as `a .npy file of numbers`.

    Raises:
        InvalidInputError: replaces errors raised within; one that already names the file is kept.
    """
    try:
        with suppress_numpy_warnings():
            yield
    except InvalidInputError as error:
        if str(path) in str(error):
            raise
        raise InvalidInputError(f"{path}: {error}") from error
    except OSError as error:
        raise InvalidInputError(
            f"cannot read {path}: {error.strerror or short_message(error)}"
        ) from error
    except READ_ERRORS as error:
        raise InvalidInputError(f"{path} is not {kind}: {short_message(error)}") from error


def short_message(error: Exception) -> str:
    """The message of an error as one line of limited length."""
    max_length = 200  # Characters; numpy repeats whole headers.
    text = str(error).partition("\n")[0] or type(error).__name__
    return text if len(text) <= max_length else f"{text[:max_length]}..."


UNFINISHED_FILE = re.compile(r"\..+\.[0-9a-f]{16}")
"""Names of files that `atomic_write` has not renamed yet."""


def open_regular(path: str | Path) -> io.BufferedReader:
    """Opens a file for reading bytes; rejects folders, devices and pipes, which may never end.

    Raises:
        InvalidInputError: it is missing, cannot be read, or is not a file.
    """
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISREG(mode):
            # Non-blocking, in case it has become a pipe meanwhile.
            return open(path, "rb", opener=lambda p, flags: os.open(p, flags | os.O_NONBLOCK))
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not a valid path"  # with NUL
        raise InvalidInputError(f"cannot read {shorten_text(str(path), 500)}: {why}") from error
    if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
        raise InvalidInputError(f"cannot read {path}: it is a pipe; save it to a file first")
    kind = "a folder" if stat.S_ISDIR(mode) else "a device"
    raise InvalidInputError(f"cannot read {path}: it is {kind}; expected a file")


FileContent = str | bytes | Callable[[io.BufferedWriter], object]
"""Text (stored as UTF-8), bytes, or a function that writes bytes to an open file."""


def atomic_write(path: str | Path, content: FileContent) -> None:
    """Writes `content` beside `path` and renames it into place; creates parent folders.

    A replaced file keeps its permissions, and links to it are kept.

    Args:
        path: file to write or replace.
        content: content of the file.

    Raises:
        InvalidInputError: the path cannot be written to.
    """
    atomic_write_all({Path(path): content})


def atomic_write_all(contents: Mapping[Path, FileContent]) -> None:
    """Writes several files, and renames them into place only when all of them are on the disk; see
    `atomic_write`.

    Args:
        contents: content of each file.

    Raises:
        InvalidInputError: one of the paths cannot be written to; then no file is replaced, unless
            renaming fails.
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
                copy_permissions(target, stream.fileno())
                if callable(content):
                    content(stream)
                else:
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


def copy_permissions(path: Path, file: int) -> None:
    """Copies the permissions of the replaced file, if there is one, to an open file."""
    with contextlib.suppress(FileNotFoundError):
        os.fchmod(file, stat.S_IMODE(path.stat().st_mode))


def remove_unfinished(folder: Path) -> None:
    """Removes files that `atomic_write` left in a folder when its process was killed."""
    for path in folder.iterdir():
        if UNFINISHED_FILE.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


def ensure_writable_folder(path: str | Path) -> Path:
    """Creates the folder `path` if missing, and checks in advance that it is writable.

    Raises:
        InvalidInputError: `path` is a file, or the folder is not writable.
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


@contextmanager
def atomic_folder(path: Path, *, replace: bool = False) -> Iterator[Path]:
    """Yields a new folder beside `path` that is renamed to `path` if the block succeeds.

    Args:
        path: folder that does not exist, or is empty; parent folders are created.
        replace: let the new folder replace one that is not empty.

    Raises:
        InvalidInputError: the folder cannot be written; earlier contents stay.
    """
    token = secrets.token_hex(8)
    fresh, old = (path.with_name(f".{path.name}.{token}{end}") for end in ("", ".old"))
    ensure_writable_folder(path.parent)
    try:
        with report_write_errors(path):
            fresh.mkdir()
            yield fresh
            if replace and path.is_dir():
                path.rename(old)
            try:
                fresh.rename(path)
            except OSError:
                if old.exists():
                    old.rename(path)
                raise
            shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


@contextmanager
def report_write_errors(path: Path) -> Iterator[None]:
    """Raises an InvalidInputError that names the path in place of an OSError."""
    try:
        yield
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place"
        ) from error


def require_writable(path: str | Path) -> None:
    """Checks in advance that a file can be written, without creating it.

    Raises:
        InvalidInputError: `path` is a folder or a device, or its folder is not writable.
    """
    path = Path(path)
    with report_write_errors(path):
        _require_regular_file(path)
        with tempfile.TemporaryFile(dir=next(p for p in path.absolute().parents if p.exists())):
            pass


def _require_regular_file(path: Path) -> None:
    """Rejects an existing folder or device at the path of a file."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "it is a folder, not a file")
    if path.exists() and not path.is_file():
        raise FileExistsError(errno.EEXIST, "it is a pipe or a device, not a file")


MIB = 1 << 20  # Bytes in a mebibyte.


@dataclass(frozen=True)
class Limits:
    """Upper limits for a document.

    Attributes:
        size: bytes of its text.
        values: number of scalars, lists and mappings; those behind an alias count at every use.
        depth: nesting depth of lists and mappings.
    """

    size: int
    values: int
    depth: int = 64


class FileLimits:
    """Upper limits for kinds of files, so that reading them always ends."""

    # Files written by people and by this project. Each value takes 0.4 kB of memory.
    document = Limits(size=16 * MIB, values=1_000_000)
    # Grasps and plans. 100,000 grasps take 21 to 37 MB and 2,200,000 values.
    grasp_file = Limits(size=512 * MIB, values=10_000_000)
    # Tables. The results of 100,000 grasps have 130 MB and 6,000,000 cells.
    table = Limits(size=1024 * MIB, values=50_000_000)
    image_bytes = 512 * MIB  # Bytes of an image file.


def read_text(path: str | Path, limits: Limits = FileLimits.document) -> str:
    """Reads the text of a document.

    Raises:
        DocumentError: it cannot be read, is too large, or is not text.
    """
    try:
        return read_bytes(path, limits.size).decode("utf-8")
    except UnicodeDecodeError as error:
        raise DocumentError(f"cannot read {path}: it is not a text file") from error
    except InvalidInputError as error:
        raise DocumentError(str(error)) from error


def read_bytes(path: str | Path, size: int) -> bytes:
    """Reads a regular file; rejects pipes and devices, which may never end.

    Args:
        path: the file.
        size: largest size [bytes].

    Raises:
        InvalidInputError: it cannot be read, or is too large.
    """
    with open_regular(path) as stream:
        try:
            data = stream.read(size + 1)
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    if len(data) > size:
        raise InvalidInputError(
            f"cannot read {path}: it is larger than {size // MIB} MiB; is it the right file?"
        )
    return data


def read_pipe(pipe: int | str, size: int = FileLimits.grasp_file.size) -> bytes:
    """Reads a pipe until its writer closes it.

    Args:
        pipe: its path, or a file descriptor, which stays open.
        size: largest size [bytes].

    Raises:
        InvalidInputError: it cannot be read, or has more data.
    """
    name = "the standard input" if pipe == 0 else str(pipe)
    try:
        with open(pipe, "rb", closefd=isinstance(pipe, str)) as stream:
            data = stream.read(size + 1)
    except OSError as error:
        raise InvalidInputError(f"cannot read {name}: {error.strerror or error}") from error
    if len(data) > size:
        raise InvalidInputError(
            f"cannot read {name}: more than {size // MIB} MiB arrived; save it to a file first"
        )
    return data


def read_rows(path: str | Path, limits: Limits = FileLimits.table) -> list[tuple[int, list[str]]]:
    """Reads the rows of a CSV file without empty ones: last line number and cells of each row.

    Raises:
        DocumentError: it cannot be read, is beyond the limits, or is not CSV, for example as a
            quote is not closed; the message names file and line.
    """
    text = read_text(path, limits).removeprefix("\ufeff")
    if text.count(",") > limits.values:
        raise DocumentError(f"cannot read {path}: more than {limits.values:,} cells")
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        return [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise DocumentError(f"{path}:{reader.line_num}: not valid CSV: {error}") from error


def try_lock(file: int, *, shared: bool = False) -> bool:
    """Locks an open file; returns False if another process has locked it.

    Args:
        file: file descriptor.
        shared: shared lock instead of an exclusive one.

    Raises:
        OSError: its file system has no locks.
    """
    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def missing_locks_error(path: Path, error: OSError) -> InvalidInputError:
    """The error for a file or folder on a file system without locks.

    Args:
        path: the file or folder.
        error: error from `try_lock`.
    """
    return InvalidInputError(
        f"{path} is on a file system without file locks ({error.strerror}), where two"
        " programs could overwrite each other's data; choose a folder on another file"
        " system"
    )


class FolderLock:
    """Lock on a folder, so that one process at a time writes to it; leaves no lock file."""

    def __init__(self, folder: Path) -> None:
        """Locks an existing folder.

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
            raise missing_locks_error(folder, error).about("folder") from error
        os.close(file)
        raise InvalidInputError(
            f"{folder} is being written by another process; wait for it, or choose another folder"
        ).about("folder")

    def release(self) -> None:
        """Releases the lock; a second call does nothing."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()
