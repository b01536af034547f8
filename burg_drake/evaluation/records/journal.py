"""The journal of a run: one line of JSON a judged grasp, appended as it comes.

A line is written by a single call, so that a killed run leaves whole lines and at most one torn
one at the end, which is cut off when the run goes on.
"""

from __future__ import annotations

import json
import math
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from burg_drake.core import InvalidInputError, quoted
from burg_drake.core.documents import parse_json
from burg_drake.core.files import open_regular
from burg_drake.core.grasps import Outcome, Stage
from burg_drake.evaluation.records.folder_lock import being_written, lock
from burg_drake.evaluation.stages import Verdict

JOURNAL_FILE = "journal.jsonl"
LONGEST_LINE = 1 << 20
"""Bytes; what is longer was not written by `encode`, whose lines have some hundred."""


class Journal:
    """A journal opened for writing; one process at a time can hold it."""

    def __init__(self, path: Path) -> None:
        """Opens or creates the file and cuts off a torn last line.

        Raises:
            InvalidInputError: not writable, or another process is writing it.
        """
        self._path = path
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
        if not lock(self._file):
            os.close(self._file)
            raise being_written(path.parent)
        if not stat.S_ISREG(os.fstat(self._file).st_mode):
            os.close(self._file)
            raise InvalidInputError(f"cannot write {path}: it is no file; choose another folder")
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
                raise OSError(0, f"{written} of {len(line)} bytes fitted on the disk")
        except OSError as error:
            raise InvalidInputError(
                f"cannot write {self._path}: {error.strerror}; what is in it is kept, and the same"
                " command goes on from there"
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
    record: dict[str, Any] = {
        "id": id,
        "outcome": verdict.outcome.value,
        "stage": verdict.stage.value,
        "blocker": verdict.blocker,
        "reason": verdict.reason,
        "margins": {k: _finite(v) for k, v in verdict.margins.items()},
        "displacements": {k: _finite(v) for k, v in verdict.displacements.items()},
        "pushed": {k: _finite(v) for k, v in verdict.pushed.items()},
        "touched": verdict.touched,
        "q_grasp": list(verdict.q_grasp),
        "q_pregrasp": list(verdict.q_pregrasp),
        "cpu": {stage.value: round(seconds, 6) for stage, seconds in verdict.cpu.items()},
    }
    if verdict.interrupted:
        record["interrupted"] = True
    return json.dumps(record, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def decode(line: bytes) -> tuple[str, Verdict]:
    """Reads a line.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: it was not written by `encode`.
    """
    record: dict[str, Any] = parse_json(line.decode(), "a line")
    return str(record["id"]), Verdict(
        outcome=Outcome(record["outcome"]),
        stage=Stage(record["stage"]),
        blocker=_text(record["blocker"]),
        reason=_text(record["reason"]),
        margins=_numbers(record["margins"]),
        displacements=_numbers(record.get("displacements", {})),  # older journals have none
        pushed=_numbers(record.get("pushed", {})),
        touched=_text(record.get("touched", "")),
        q_grasp=tuple(map(_number, record["q_grasp"])),
        q_pregrasp=tuple(map(_number, record["q_pregrasp"])),
        cpu={Stage(stage): _number(seconds) for stage, seconds in record["cpu"].items()},
        interrupted=record.get("interrupted", False) is True,
    )


def _numbers(values: dict[str, float | None]) -> dict[str, float]:
    return {name: math.nan if value is None else _number(value) for name, value in values.items()}


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"{quoted(value)} is no number")
    return float(value)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{quoted(value)} is no text")
    return value


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
