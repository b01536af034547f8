"""Which bytes of which journal the rows of a part are made of, and whether that still holds.

Parts of a table are made from journals, which only ever grow. A segment says how far a part stands,
with hashes of what it has seen: a journal that was replaced, cut or edited is noticed, and then the
journal counts. As long as a journal has the date and size that it had when its last segment was
made, its last bytes are compared; otherwise, as after an edit, a copy, or when it has grown, all
bytes of all its segments are. So who edits a journal while a process writes it, or gives it its old
date back, does so unnoticed.
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
"""Bytes at the end of a segment that are compared each time."""
CHUNK = 1 << 20


@dataclass(frozen=True)
class JournalSegment:
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


def segment_of(scene: str, journal: Path, begin: int, end: int, rows: int) -> JournalSegment:
    """The segment of bytes that rows have just been made of."""
    with open_regular(journal) as stream:
        status = os.fstat(stream.fileno())
        modified = status.st_mtime_ns if status.st_size == end else 0
        whole = _hash(stream, begin, end)
        last = _hash(stream, max(begin, end - TAIL), end)
    return JournalSegment(scene, begin, end, rows, whole, last, modified)


def chain(segments: Sequence[JournalSegment], journal: Path) -> list[JournalSegment]:
    """Segments that follow on each other from the beginning of a journal, as far as they hold."""
    try:
        with open_regular(journal) as stream:
            return _chain(segments, stream)
    except (ValueError, OSError):
        return []


def _chain(segments: Sequence[JournalSegment], stream: BinaryIO) -> list[JournalSegment]:
    status = os.fstat(stream.fileno())
    size, modified = status.st_size, status.st_mtime_ns
    untouched = any(s.end == size and s.modified == modified for s in segments)
    found: list[JournalSegment] = []
    place = 0
    while True:
        following = [s for s in segments if s.begin == place and place < s.end <= size]
        following = [s for s in following if _holds(s, stream, untouched=untouched)]
        if not following:
            return found
        found.append(max(following, key=lambda s: s.end))
        place = found[-1].end


def _holds(segment: JournalSegment, stream: BinaryIO, *, untouched: bool) -> bool:
    """Whether a journal still has the bytes that a segment is made of."""
    if untouched:
        return _hash(stream, max(segment.begin, segment.end - TAIL), segment.end) == segment.last
    return _hash(stream, segment.begin, segment.end) == segment.whole


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
