"""Which bytes of which journal the rows of a part are made of, and whether that still holds.

Parts of a table are made from journals, which only ever grow. A segment says how far a part stands,
with hashes of what it has seen: a journal that was replaced, cut or edited is noticed, and then the
journal counts.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from burg_drake.core.files import open_regular

TAIL = 4096
"""Bytes at the end of a segment that are compared each time; all of them if the file was touched
since, or copied."""
CHUNK = 1 << 20


@dataclass(frozen=True)
class Segment:
    """Rows of a part that were made of a stretch of a journal.

    Attributes:
        scene: name of the journal's scene in the run; empty in a run of one scene.
        begin, end: bytes of the journal.
        rows: of the part.
        whole, last: hashes of these bytes, and of the last of them.
        modified: date of the journal at that time [ns], if it ended there.
    """

    scene: str
    begin: int
    end: int
    rows: int
    whole: str
    last: str
    modified: int


def segment_of(scene: str, journal: Path, begin: int, end: int, rows: int) -> Segment:
    """The segment of bytes that rows have just been made of."""
    with open_regular(journal) as stream:
        status = os.fstat(stream.fileno())
        modified = status.st_mtime_ns if status.st_size == end else 0
        whole = _hash(stream, begin, end)
        last = _hash(stream, max(begin, end - TAIL), end)
    return Segment(scene, begin, end, rows, whole, last, modified)


def holds(segment: Segment, journal: Path) -> bool:
    """Whether a journal still has the bytes that a segment is made of."""
    try:
        with open_regular(journal) as stream:
            status = os.fstat(stream.fileno())
            if status.st_size < segment.end:
                return False
            if _hash(stream, max(segment.begin, segment.end - TAIL), segment.end) != segment.last:
                return False
            untouched = status.st_mtime_ns == segment.modified or status.st_size > segment.end
            return untouched or _hash(stream, segment.begin, segment.end) == segment.whole
    except (ValueError, OSError):
        return False


def chain(segments: Sequence[Segment], journal: Path) -> list[Segment]:
    """Segments that follow on each other from the beginning of a journal, as far as they hold."""
    found: list[Segment] = []
    place = 0
    while True:
        following = [s for s in segments if s.begin == place and s.end > place]
        following = [s for s in following if holds(s, journal)]
        if not following:
            return found
        found.append(max(following, key=lambda s: s.end))
        place = found[-1].end


def whole_lines(journal: Path) -> int:
    """Bytes of a journal up to its last whole line."""
    if not journal.exists():
        return 0
    with open_regular(journal) as stream:
        end = stream.seek(0, os.SEEK_END)
        while end > 0:
            begin = max(0, end - TAIL)
            stream.seek(begin)
            found = stream.read(end - begin).rfind(b"\n")
            if found >= 0:
                return begin + found + 1
            end = begin
    return 0


def line_end(journal: Path, place: int) -> int:
    """Where the line ends that a byte of a journal is in."""
    with open_regular(journal) as stream:
        stream.seek(place)
        return place + len(stream.readline())


def _hash(stream: BinaryIO, begin: int, end: int) -> str:
    digest = hashlib.blake2b(digest_size=12)
    stream.seek(begin)
    left = end - begin
    while left > 0 and (data := stream.read(min(CHUNK, left))):
        digest.update(data)
        left -= len(data)
    return digest.hexdigest()
