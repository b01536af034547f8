"""The journal of a trials file: what was recorded, in order, whatever became of the file since.

It lies beside the file, `trials.entries.jsonl` beside `trials.yaml`, and nothing in it is ever
changed: an editor that writes the file from an old buffer loses nothing. Each line is on the disk
before the file changes.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from burg_drake.core import InvalidInputError
from burg_drake.core.documents import Reader, dump_document, parse_json, parse_nodes, plain_data
from burg_drake.core.files import open_regular
from burg_drake.experiment.trials.sheet import RealTrial, TrialSheet

How = Literal["recorded", "corrected", "again", "restored", "kept"]
"""`again`: the trial was carried out once more. `restored`: the file lacked it. `kept`: the file is
right as it is."""
FIELDS = ("outcome", "time", "operator", "note", "photo", "placement", "robot")
"""What is entered for a trial; the other fields of `RealTrial` are of its plan."""
LONGEST_LINE = 1 << 24
"""Bytes."""


@dataclass(frozen=True)
class Entry:
    """A line of the journal.

    Attributes:
        number, grasp, content: of the trial.
        at: when it was recorded, ISO 8601.
        how: what was done.
        before, after: values of `FIELDS` in the file, as plain data; those at their default are
            left out.
    """

    number: int
    grasp: str
    content: str
    at: str
    how: How
    before: dict[str, Any]
    after: dict[str, Any]

    def is_of(self, trial: RealTrial) -> bool:
        """Whether it is of this trial, and not of one in a plan that the file had before."""
        own = (trial.number, trial.grasp, trial.content)
        return (self.number, self.grasp, self.content) == own


@dataclass(frozen=True)
class MissingValues:
    """What the file lacks of the entries for a trial.

    Attributes:
        number: of the trial.
        values: what was recorded last, as plain data, by field, where the file has what it had
            before.
        edited: fields that have a value in the file that was never recorded: edited by hand.
    """

    number: int
    values: dict[str, Any]
    edited: tuple[str, ...] = ()


def entered(trial: RealTrial) -> dict[str, Any]:
    """What has been entered for a trial, as plain data."""
    return {name: value for name, value in plain_data(trial).items() if name in FIELDS}


def with_values(trial: RealTrial, values: Mapping[str, Any]) -> RealTrial:
    """A trial with other values, as `entered` has them; None stands for a field's default.

    Raises:
        DocumentError: they are not what `entered` makes.
    """
    plain = plain_data(trial) | dict(values)
    text = dump_document({name: value for name, value in plain.items() if value is not None})
    found: RealTrial = Reader("the journal").read(parse_nodes(text, "the journal"), RealTrial, "")
    return found


def journal_path(path: Path) -> Path:
    """The journal of a trials file: beside the file itself, also where the path is a link to it."""
    real = Path(os.path.realpath(path))
    return real.with_name(f"{real.stem}.entries.jsonl")


def read_entries(path: Path) -> list[Entry]:
    """All lines of a journal, in order, but for damaged ones; see `damaged_lines`.

    Raises:
        InvalidInputError: it cannot be read.
    """
    return [entry for _, entry in _lines(path) if entry is not None]


def damaged_lines(path: Path) -> list[int]:
    """Numbers, from 1, of the lines of a journal that cannot be read: a killed writer's, whose
    entry was never acknowledged, or those that something else has damaged.

    Raises:
        InvalidInputError: it cannot be read at all.
    """
    return [number for number, entry in _lines(path) if entry is None]


def _lines(path: Path) -> Iterator[tuple[int, Entry | None]]:
    """The lines of a journal with their numbers; None for one that cannot be read."""
    if not path.exists():
        return
    with open_regular(path) as stream:
        lines = iter(lambda: stream.readline(LONGEST_LINE), b"")
        for number, line in enumerate(lines, 1):
            try:
                yield number, _read_entry(line.decode())
            except (ValueError, TypeError):
                yield number, None


def _read_entry(line: str) -> Entry:
    """The entry of a line.

    Raises:
        ValueError, TypeError: it is not JSON, or its fields or their types are not those of an
            entry.
    """
    entry = Entry(**parse_json(line, "a line"))
    if type(entry.number) is not int or entry.how not in get_args(How):
        raise TypeError("number or how")
    if not all(isinstance(text, str) for text in (entry.grasp, entry.content, entry.at)):
        raise TypeError("grasp, content or at")
    for values in (entry.before, entry.after):
        if not isinstance(values, dict) or not values.keys() <= set(FIELDS):
            raise TypeError("before or after")
    return entry


def append_entry(path: Path, entry: Entry) -> None:
    """Adds a line; it is on the disk when this returns. The caller holds the lock.

    Raises:
        InvalidInputError: it cannot be written.
    """
    line = json.dumps(dataclasses.asdict(entry), allow_nan=False).encode() + b"\n"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            size = os.fstat(file).st_size
            if size and os.pread(file, 1, size - 1) != b"\n":
                line = b"\n" + line  # a writer was killed within its line
            written = os.write(file, line)
            if written != len(line):
                os.ftruncate(file, size)
                raise OSError(0, f"{written} of {len(line)} bytes fitted on the disk")
            os.fsync(file)
        finally:
            os.close(file)
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; nothing was recorded"
        ) from error
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Waits until names of files in a folder are on the disk."""
    file = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def missing_values(sheet: TrialSheet, entries: Iterable[Entry]) -> list[MissingValues]:
    """What the sheet lacks of what was recorded, trial by trial.

    A field counts as lost if the sheet has a value of it that the journal knows from before the
    last entry, and as edited by hand if it has one that the journal does not know.
    """
    found = []
    entries = list(entries)
    for trial in sheet.trials:
        own = [entry for entry in entries if entry.is_of(trial)]
        if not own:
            continue
        now, last = entered(trial), own[-1].after
        differing = [name for name in FIELDS if now.get(name) != last.get(name)]
        known = [values for entry in own for values in (entry.before, entry.after)]
        missing = [n for n in differing if any(now.get(n) == values.get(n) for values in known)]
        if differing:
            edited = tuple(name for name in differing if name not in missing)
            found.append(
                MissingValues(trial.number, {name: last.get(name) for name in missing}, edited)
            )
    return found
