"""The journal of a run: one line of JSON a judged grasp, appended as it comes.

A line is written by a single call, so that a killed run leaves whole lines and at most one torn
one at the end, which is cut off when the run goes on.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from burg_drake.core import InvalidInputError
from burg_drake.core.documents import parse_json
from burg_drake.core.files import open_regular
from burg_drake.core.grasps import VERDICT_FIELDS, Verdict
from burg_drake.evaluation.records.folder_lock import lock

JOURNAL_FILE = "journal.jsonl"
ORIGINAL = frozenset(
    {"outcome", "stage", "blocker", "reason", "margins", "q_grasp", "q_pregrasp", "cpu"}
)
"""Fields that all releases have written; others are empty in lines that lack them."""
LONGEST_LINE = 1 << 20
"""Bytes; what is longer was not written by `encode`, whose lines have some hundred."""


class Journal:
    """A journal opened for writing; one process at a time can hold it."""

    def __init__(self, path: Path) -> None:
        """Opens or creates the file and cuts off a torn last line.

        Raises:
            InvalidInputError: not writable, another process is writing it, or its file system has
                no locks.
        """
        self._path = path
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
        lock(self._file, path)
        if not stat.S_ISREG(os.fstat(self._file).st_mode):
            os.close(self._file)
            raise InvalidInputError(f"cannot write {path}: it is not a file; choose another folder")
        content = path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole != len(content):  # otherwise the file keeps its date: table and report are newer
            os.ftruncate(self._file, whole)

    def append(self, id: str, verdict: Verdict) -> None:
        """Adds a verdict.

        Raises:
            InvalidInputError: the line cannot be written, for example because the disk is full.
        """
        line = encode(id, verdict)
        try:
            written = os.write(self._file, line)
            if written != len(line):
                raise OSError(
                    0, f"the disk is full: only {written} of {len(line)} bytes were written"
                )
        except OSError as error:
            raise InvalidInputError(
                f"cannot write {self._path}: {error.strerror}; what is in it is kept."
                " Make room and run the same command to continue"
            ) from error

    def close(self) -> None:
        """Closes the file and lets others write it."""
        os.close(self._file)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def read_journal(path: Path, begin: int = 0, end: int | None = None) -> dict[str, Verdict]:
    """The last verdict about each grasp by id; lines that cannot be read count as not judged.

    Args:
        path: of the journal; one that does not exist has none.
        begin, end: bytes to read, if not all; each at the end of a line.

    Raises:
        InvalidInputError: it is a folder, for example.
    """
    return {id: verdict for _, id, verdict in journal_lines(path, begin, end)}


def journal_lines(
    path: Path, begin: int = 0, end: int | None = None
) -> Iterator[tuple[int, str, Verdict]]:
    """The verdicts of a journal, in its order, one at a time; see `read_journal`.

    Yields:
        Where its line begins, the id of the grasp, and the verdict.
    """
    if not path.exists():
        return
    with open_regular(path) as stream:
        place = stream.seek(begin)
        for line in iter(lambda: stream.readline(LONGEST_LINE), b""):
            here, place = place, place + len(line)
            if not line.endswith(b"\n"):  # torn, or too long: cut off when the run goes on
                continue
            if end is not None and place > end:
                return
            try:
                id, verdict = decode(line)
            except (ValueError, KeyError, TypeError, AttributeError):
                continue
            yield here, id, verdict


def encode(id: str, verdict: Verdict) -> bytes:
    """One line for one grasp; numbers that are not finite become null."""
    record: dict[str, Any] = {"id": id}
    record |= {one.name: one.to_json(getattr(verdict, one.name)) for one in VERDICT_FIELDS}
    if verdict.interrupted:
        record["interrupted"] = True
    return json.dumps(record, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def decode(line: bytes) -> tuple[str, Verdict]:
    """Reads a line.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: it was not written by `encode`.
    """
    record: dict[str, Any] = parse_json(line.decode(), "a line")
    known = {
        one.name: one.from_json(record[one.name])
        for one in VERDICT_FIELDS
        if one.name in record or one.name in ORIGINAL
    }
    interrupted = record.get("interrupted", False) is True
    return str(record["id"]), Verdict(**known, interrupted=interrupted)
