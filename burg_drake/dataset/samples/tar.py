"""Tar archives of plain files, as shards are: written with nothing that changes from day to day,
and read without trust.

A member is a block of 512 bytes that tells its name and size, and its content, filled up to whole
blocks; two empty blocks are the end (POSIX.1-1988, ustar).
"""

from __future__ import annotations

import os
import tarfile
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import InvalidInputError, shown
from burg_drake.core.files import open_regular

BLOCK = 512
TAR_END = bytes(2 * BLOCK)
NAME, SIZE, SUM, KIND, PREFIX = (
    *(slice(0, 100), slice(124, 136), slice(148, 156), slice(156, 157), slice(345, 500)),
)
"""Fields of a header."""
FILES = (b"0", b"\0")
"""Kinds of members that are plain files."""
MOST_MEMBERS = 1_000_000


@dataclass(frozen=True)
class MemberPlace:
    """Where in an archive a member's content is [bytes]."""

    start: int
    size: int


def tar_member(name: str, data: bytes) -> bytes:
    """A member with header; time, owner and mode are always the same."""
    info = tarfile.TarInfo(name)  # by default of 1970, of nobody, readable for all
    info.size = len(data)
    return info.tobuf(tarfile.USTAR_FORMAT) + data + bytes(-len(data) % BLOCK)


def tar_members(path: Path) -> dict[str, MemberPlace]:
    """The members of an archive by name, in their order.

    Raises:
        InvalidInputError: the archive is missing, cut off, damaged, has a member twice, or one that
            is no plain file; the message names archive and member.
    """
    found: dict[str, MemberPlace] = {}
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        at, last = 0, "its beginning"
        while True:
            header = os.pread(stream.fileno(), BLOCK, at)
            if len(header) < BLOCK:
                raise InvalidInputError(f"{path} is truncated after {last}")
            if not any(header):
                return found
            name, place = _parsed(header, at, f"{path}, after {last}")
            if place.start + place.size > size:
                raise InvalidInputError(f"{path} is truncated within {name}")
            if name in found:
                raise InvalidInputError(f"{path} contains {name} twice")
            if len(found) == MOST_MEMBERS:
                raise InvalidInputError(f"{path} has more than {MOST_MEMBERS:,} members")
            found[name], last = place, name
            at = place.start + place.size + -place.size % BLOCK


def read_member(path: Path, place: MemberPlace) -> bytes:
    """The content of a member. The file is opened for each, so that processes share none.

    Raises:
        InvalidInputError: it cannot be read, or ends before.
    """
    with open_regular(path) as stream:
        try:
            data = os.pread(stream.fileno(), place.size, place.start)
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    if len(data) != place.size:
        raise InvalidInputError(f"{path} is truncated")
    return data


def _parsed(header: bytes, at: int, where: str) -> tuple[str, MemberPlace]:
    """Name and place of the member whose header lies at this place."""
    blank = header[: SUM.start] + b" " * 8 + header[SUM.stop :]
    try:
        if sum(blank) != _octal(header[SUM]):
            raise InvalidInputError(f"{where}: the checksum of a header is wrong")
        size = _octal(header[SIZE])
        name = header[NAME].split(b"\0", 1)[0].decode("ascii")
    except ValueError as error:
        if isinstance(error, InvalidInputError):
            raise
        raise InvalidInputError(f"{where}: the header is not that of a tar archive") from error
    if header[KIND] not in FILES or any(header[PREFIX]) or not name:
        raise InvalidInputError(
            f"{where}: {shown(name)!r} is not a regular file with a name of at most 100"
            " characters; only such files may be in a shard"
        )
    return name, MemberPlace(at + BLOCK, size)


def _octal(field: bytes) -> int:
    text = field.split(b"\0", 1)[0].strip()
    if not text.isdigit():  # not a sign, as `int` takes
        raise ValueError("no octal number")
    return int(text, 8)
