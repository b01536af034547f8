"""The text of documents, and how much of it is read: the one place of all bounds.

Whatever a file holds, reading it ends, takes memory in proportion to these bounds at most, and
neither waits for another process nor drains a device. Only `read_pipe` waits for what another
process writes.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core.errors import DocumentError, InvalidInputError
from burg_drake.core.files.atomic import open_regular

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
"""Of files of grasps and plans, which programs write: 100,000 grasps of Isaac Sim's grasp editor
have 37 MB and 2,200,000 values, as many of GraspGen 21 MB and 2,100,000."""
TABLE = Limits(size=1024 * MIB, values=50_000_000)
"""Of tables; the results of 100,000 grasps have 130 MB and 6,000,000 cells."""
IMAGE_SIZE = 512 * MIB
"""Bytes of the file of an image."""


def read_text(path: str | Path, limits: Limits = DOCUMENT) -> str:
    """The text of a document.

    Raises:
        DocumentError: it cannot be read, is too large, or no text.
    """
    try:
        return read_bytes(path, limits.size).decode("utf-8")
    except UnicodeDecodeError as error:
        raise DocumentError(f"cannot read {path}: it is not a text file") from error
    except InvalidInputError as error:
        raise DocumentError(str(error)) from error


def read_bytes(path: str | Path, size: int) -> bytes:
    """The content of a regular file; pipes and devices, which may never end, are refused.

    Args:
        path: the file.
        size: bytes that it may have.

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


def read_pipe(pipe: int | str, size: int = GRASP_FILE.size) -> bytes:
    """All that comes through a pipe, until whoever writes to it ends.

    Args:
        pipe: its path, or the number of a file descriptor, which stays open.
        size: bytes that it may have.

    Raises:
        InvalidInputError: it cannot be read, or more comes.
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


def read_rows(path: str | Path, limits: Limits = TABLE) -> list[tuple[int, list[str]]]:
    """The cells of a CSV file, row by row, each with the line that it ends on; no empty rows.

    Raises:
        DocumentError: it cannot be read, is beyond the limits, or no CSV: a quote is never closed,
            for example; the message names file and line.
    """
    text = read_text(path, limits).removeprefix("\ufeff")
    if text.count(",") > limits.values:
        raise DocumentError(f"cannot read {path}: more than {limits.values:,} cells")
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        return [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise DocumentError(f"{path}:{reader.line_num}: not valid CSV: {error}") from error
