"""Journal of a run, one line of JSON per judged grasp, and the lock of its writer.

A line is written by a single call, so a killed run leaves whole lines and at most one torn line at
the end, which is cut off when the run goes on. The operating system drops a lock when its process
ends.
"""

from __future__ import annotations

import json
import os
import stat
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    InvalidInputError,
    Outcome,
    RecordedFields,
    Verdict,
    missing_locks_error,
    open_regular,
    parse_json,
    try_lock,
)


def _open_locked(path: Path, flags: int = 0) -> int:
    """Opens a file for writing, creates it if necessary, and locks it.

    Raises:
        InvalidInputError: the file cannot be written, another process has locked it, or its file
            system has no locks.
    """
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | flags, 0o666)
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
    try:
        for wait in (0.02, 0.02, 0.02, 0.02, 0.0):  # `is_locked` holds the lock briefly
            if try_lock(file):
                return file
            time.sleep(wait)
    except OSError as error:
        os.close(file)
        raise missing_locks_error(path.parent, error) from error
    os.close(file)
    raise folder_in_use_error(path.parent)


def is_locked(path: Path) -> bool:
    """Whether a process holds the lock of a file; False if the file system has no locks."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return not try_lock(file, shared=True)
    except OSError:
        return False
    finally:
        os.close(file)


@contextmanager
def hold_unchanged(path: Path, *, make: bool = False) -> Iterator[None]:
    """Keeps other processes from writing the folder of a lock file; they may read it.

    Args:
        path: the lock file. Nothing is locked if it does not exist, or on a file system without
            locks, where nothing writes.
        make: create the file if necessary and possible.

    Raises:
        InvalidInputError: another process is writing the folder.
    """
    file = _open_to_read(path, make)
    if file is None:
        yield
        return
    try:
        try:
            shared = try_lock(file, shared=True)
        except OSError:
            shared = True
        if not shared:
            raise folder_in_use_error(path.parent)
        yield
    finally:
        os.close(file)


def _open_to_read(path: Path, make: bool) -> int | None:
    for flags in (os.O_CREAT, 0) if make else (0,):  # the folder may be read-only
        with suppress(OSError):
            return os.open(path, os.O_RDONLY | os.O_NONBLOCK | flags, 0o666)
    return None


def folder_in_use_error(folder: Path) -> InvalidInputError:
    """Error about a folder that another process is writing."""
    return InvalidInputError(
        f"{folder} is being written by another process; wait for it, or choose another folder"
    )


class WriterLock:
    """Lock of a folder for its writer, held on a file in it."""

    def __init__(self, path: Path) -> None:
        """Creates the file if necessary, and locks it.

        Raises:
            InvalidInputError: the file cannot be written, another process has locked it, or its
                file system has no locks.
        """
        self._file = _open_locked(path)

    def __enter__(self) -> WriterLock:
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self._file)


JOURNAL_FILE = "journal.jsonl"
ORIGINAL_FIELDS = frozenset(
    {"outcome", "stage", "blocker", "reason", "margins", "q_grasp", "q_pregrasp", "cpu"}
)
"""Fields that all releases have written; others are empty in lines that lack them."""
MAX_JOURNAL_LINE = 1 << 20
"""Bytes; `encode_verdict` writes lines of a few hundred."""


class Journal:
    """A journal opened for writing; one process at a time can hold it."""

    def __init__(self, path: Path) -> None:
        """Opens or creates the file and cuts off a torn last line.

        Raises:
            InvalidInputError: not writable, another process is writing it, or its file system has
                no locks.
        """
        self._path = path
        self._file = _open_locked(path, os.O_APPEND)
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
        line = encode_verdict(id, verdict)
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
        """Closes the file and releases its lock."""
        os.close(self._file)

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def read_journal(path: Path, begin: int = 0, end: int | None = None) -> dict[str, Verdict]:
    """Reads the last verdict of each grasp, by id; unreadable lines are skipped.

    Args:
        path: path of the journal; a missing file has no verdicts.
        begin, end: range of bytes to read, each at the end of a line; all if not given.

    Raises:
        InvalidInputError: it is not a regular file.
    """
    return {id: verdict for _, id, verdict in journal_lines(path, begin, end)}


def journal_lines(
    path: Path, begin: int = 0, end: int | None = None
) -> Iterator[tuple[int, str, Verdict]]:
    """Reads the verdicts of a journal one at a time, in its order; see `read_journal`.

    Yields:
        The byte at which the line begins, the id of the grasp, and the verdict.
    """
    if not path.exists():
        return
    with open_regular(path) as stream:
        end_of_line = stream.seek(begin)
        for line in iter(lambda: stream.readline(MAX_JOURNAL_LINE), b""):
            line_begin, end_of_line = end_of_line, end_of_line + len(line)
            if not line.endswith(b"\n"):  # torn, or too long: cut off when the run goes on
                continue
            if end is not None and end_of_line > end:
                return
            try:
                id, verdict = decode_verdict(line)
            except (ValueError, KeyError, TypeError, AttributeError):
                continue
            yield line_begin, id, verdict


COMPLETED_RANK = 3  # `JournalIndex.rank` of a trial that came to an end.


@dataclass(frozen=True, eq=False)
class JournalIndex:
    """Position and outcome of the last verdict of each of N grasps, in 11 bytes per grasp.

    Attributes:
        line_begin: (N,) byte of the journal at which the line begins; -1 without a verdict.
        outcome: (N,) index in `Outcome`; -1 without a verdict.
        interrupted, judged_again: (N,) see `Verdict`.
    """

    line_begin: NDArray[np.int64]
    outcome: NDArray[np.int8]
    interrupted: NDArray[np.bool_]
    judged_again: NDArray[np.bool_]

    @property
    def judged(self) -> NDArray[np.bool_]:
        """(N,) whether each grasp has a verdict."""
        return self.outcome >= 0

    @property
    def failed(self) -> NDArray[np.bool_]:
        """(N,) whether each grasp could not be simulated."""
        failed: NDArray[np.bool_] = self.outcome == list(Outcome).index(Outcome.SIMULATION_FAILED)
        return failed

    @property
    def rank(self) -> NDArray[np.int8]:
        """(N,) rank for the choice between verdicts of a grasp; the higher one is taken.

        `COMPLETED_RANK` if the trial came to an end, one less if it failed, two less if its worker
        was killed from outside, 0 without a verdict.
        """
        return np.where(
            self.judged, COMPLETED_RANK - self.failed - (self.failed & self.interrupted), 0
        ).astype(np.int8)

    def select(self, rows: NDArray[np.int64]) -> JournalIndex:
        """Index of the grasps in the given rows."""
        return JournalIndex(*(values[rows] for values in vars(self).values()))

    def replace_rows(self, chosen: NDArray[np.bool_], other: JournalIndex) -> None:
        """Copies the chosen (N,) grasps from another index of the same grasps."""
        for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True):
            mine[chosen] = theirs[chosen]

    def count_outcomes(self, without: NDArray[np.int64]) -> Counter[Outcome]:
        """Number of grasps by outcome, without the given rows."""
        outcome = self.outcome.copy()
        outcome[without] = -1
        counts = np.bincount(outcome[outcome >= 0], minlength=len(Outcome)).tolist()
        return +Counter(dict(zip(Outcome, counts, strict=True)))

    def open(self, *, retry_failed: bool) -> NDArray[np.bool_]:
        """(N,) whether each grasp has no verdict or is to be retried; see `Verdict.is_open`."""
        again = self.interrupted | self.failed if retry_failed else self.interrupted
        return ~self.judged | again


def index_journal(
    path: Path, count: int, rows_of: Callable[[Sequence[str]], NDArray[np.int64]]
) -> JournalIndex:
    """Reads a journal into an index of N grasps.

    Args:
        path: path of the journal; see `read_journal`.
        count: N, number of grasps.
        rows_of: returns the rows of grasps with given ids; negative rows are left out.
    """
    index = JournalIndex(
        np.full(count, -1, dtype=np.int64),
        np.full(count, -1, dtype=np.int8),
        np.zeros(count, dtype=bool),
        np.zeros(count, dtype=bool),
    )
    outcomes = {outcome: k for k, outcome in enumerate(Outcome)}
    lines = journal_lines(path)
    while batch := list(islice(lines, 4096)):
        rows = rows_of([id for _, id, _ in batch]).tolist()
        for row, (line_begin, _, verdict) in zip(rows, batch, strict=True):
            if row >= 0:
                index.line_begin[row], index.outcome[row] = line_begin, outcomes[verdict.outcome]
                index.interrupted[row] = verdict.interrupted
                index.judged_again[row] = bool(verdict.judged_again)
    return index


def read_verdicts(path: Path, line_begins: Sequence[int]) -> list[Verdict]:
    """Reads the verdicts in the lines of a journal that begin at the given bytes."""
    verdicts: list[Verdict] = []
    if not line_begins:
        return verdicts
    with open_regular(path) as stream:
        for line_begin in line_begins:
            stream.seek(line_begin)
            verdicts.append(decode_verdict(stream.readline(MAX_JOURNAL_LINE))[1])
    return verdicts


def encode_verdict(id: str, verdict: Verdict) -> bytes:
    """Encodes a verdict as a journal line; numbers that are not finite become null."""
    record: dict[str, Any] = {"id": id}
    record |= {one.name: one.to_json(getattr(verdict, one.name)) for one in RecordedFields.verdict}
    if verdict.interrupted:
        record["interrupted"] = True
    return json.dumps(record, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def decode_verdict(line: bytes) -> tuple[str, Verdict]:
    """Decodes a journal line into the id of the grasp and its verdict.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: it was not written by `encode_verdict`.
    """
    record: dict[str, Any] = parse_json(line.decode(), "a line")
    known = {
        one.name: one.from_json(record[one.name])
        for one in RecordedFields.verdict
        if one.name in record or one.name in ORIGINAL_FIELDS
    }
    interrupted = record.get("interrupted", False) is True
    return str(record["id"]), Verdict(**known, interrupted=interrupted)
