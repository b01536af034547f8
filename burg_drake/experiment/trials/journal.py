"""The journal of a trials file: all entries in the order in which they were recorded.

The journal `trials.entries.jsonl` lies beside `trials.yaml`, and its lines never change: an editor
that saves an old version of the trials file loses nothing. Each line is on the disk before the
trials file changes. This file also has the lock of a trials file, and the checks of new entries.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from burg_drake.core import (
    InvalidInputError,
    Reader,
    RealOutcome,
    UnknownNameError,
    dump_document,
    missing_locks_error,
    open_regular,
    parse_json,
    parse_yaml_node,
    plain_data,
    quote_value,
    suggest_names,
    try_lock,
)
from burg_drake.experiment.trials.trial_sheet import RealTrial, RobotReport, TrialSheet

TRIALS_LOCK_TIMEOUT = 30.0
"""Seconds; each writer takes some hundredths of a second."""


@contextlib.contextmanager
def lock_trials_file(sheet_path: Path) -> Iterator[None]:
    """One writer at a time; the end of its process, however it comes, releases the lock.

    Args:
        sheet_path: the trials file.

    Raises:
        InvalidInputError: the lock cannot be made, or another process keeps it.
    """
    real = Path(os.path.realpath(sheet_path))  # all links to a file share its lock
    path = real.with_name(f".{real.name}.lock")
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
    try:
        _acquire_lock(file, sheet_path)
        yield
    finally:
        os.close(file)


def _acquire_lock(file: int, sheet_path: Path) -> None:
    until = time.monotonic() + TRIALS_LOCK_TIMEOUT
    while True:
        try:
            if try_lock(file):
                return
        except OSError as error:
            raise missing_locks_error(sheet_path, error) from error
        if time.monotonic() > until:
            raise InvalidInputError(
                f"{sheet_path} has been locked by another process for {TRIALS_LOCK_TIMEOUT:g} s;"
                " nothing was recorded"
            )
        time.sleep(0.01)


How = Literal["recorded", "corrected", "again", "restored", "kept"]
"""`again`: the trial was carried out once more. `restored`: the file lacked it. `kept`: the file is
right as it is."""
JOURNAL_FIELDS = ("outcome", "time", "operator", "note", "photo", "placement", "robot")
"""Fields of a trial that are recorded; the others are of its plan."""


@dataclass(frozen=True)
class Entry:
    """A line of the journal.

    Attributes:
        number, grasp, content: of the trial.
        at: when it was recorded, ISO 8601.
        how: what was done.
        before, after: values of `JOURNAL_FIELDS` in the file, as plain data, without those at
            their default.
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


def entered_values(trial: RealTrial) -> dict[str, Any]:
    """What has been entered for a trial, as plain data."""
    return {name: value for name, value in plain_data(trial).items() if name in JOURNAL_FIELDS}


def replace_entered_values(trial: RealTrial, values: Mapping[str, Any]) -> RealTrial:
    """A trial with other values, as `entered_values` has them; None stands for a field's default.

    Raises:
        DocumentError: they are not what `entered_values` makes.
    """
    plain = plain_data(trial) | dict(values)
    text = dump_document({name: value for name, value in plain.items() if value is not None})
    name = "the journal"
    found: RealTrial = Reader(name).read(parse_yaml_node(text, name), RealTrial, "")
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
    return [entry for _, entry in _read_lines(path) if entry is not None]


def damaged_lines(path: Path) -> list[int]:
    """Numbers, from 1, of the lines of a journal that cannot be read: a killed writer's, whose
    entry was never acknowledged, or those that something else has damaged.

    Raises:
        InvalidInputError: it cannot be read at all.
    """
    return [number for number, entry in _read_lines(path) if entry is None]


def _read_lines(path: Path) -> Iterator[tuple[int, Entry | None]]:
    """The lines of a journal with their numbers; None for one that cannot be read."""
    max_line_size = 1 << 24  # bytes
    if not path.exists():
        return
    with open_regular(path) as stream:
        lines = iter(lambda: stream.readline(max_line_size), b"")
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
        if not isinstance(values, dict) or not values.keys() <= set(JOURNAL_FIELDS):
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
        now, last = entered_values(trial), own[-1].after
        differing = [name for name in JOURNAL_FIELDS if now.get(name) != last.get(name)]
        known = [values for entry in own for values in (entry.before, entry.after)]
        missing = [n for n in differing if any(now.get(n) == values.get(n) for values in known)]
        if differing:
            edited = tuple(name for name in differing if name not in missing)
            values = {name: last.get(name) for name in missing}
            found.append(MissingValues(trial.number, values, edited))
    return found


EMPTY_ENTRY: dict[str, Any] = {
    **dict.fromkeys(("time", "operator", "note", "photo"), ""),
    "outcome": None,
    "placement": {},
    "robot": None,
}
"""Fields of a trial without an entry."""


def parse_real_outcome(name: str) -> RealOutcome:
    """The outcome of a name.

    Raises:
        InvalidInputError: there is none; the message names the nearest.
    """
    known = [outcome.value for outcome in RealOutcome]
    if name not in known:
        meant = suggest_names(name, known, ordered=True)
        raise InvalidInputError(f"there is no outcome {quote_value(name)}; {meant}")
    return RealOutcome(name)


def check_entry(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Checks the fields of an entry, parses its outcome, and strips blanks around texts."""
    for name, value in entry.items():
        if name not in EMPTY_ENTRY:
            raise UnknownNameError(
                f"a trial has no entry {quote_value(name)}; {suggest_names(name, JOURNAL_FIELDS)}"
            )
        if isinstance(value, str) and "\0" in value:
            raise InvalidInputError(f"{name} has a NUL character: {quote_value(value)}")
    checked = dict(entry)
    for name in ("operator", "note"):
        if isinstance(entry.get(name), str):
            checked[name] = entry[name].strip()
    if entry.get("outcome") is not None:
        checked["outcome"] = parse_real_outcome(entry["outcome"])
    return checked


def merge_robot_report(trial: RealTrial, given: Mapping[str, Any]) -> dict[str, Any]:
    """Adds the robot's report of a trial to fields of the report in an entry."""
    robot = given.get("robot")
    if not isinstance(robot, Mapping):
        return dict(given)
    return {**given, "robot": replace(trial.robot or RobotReport(), **robot)}


def contains_value(value: Any, present: Any) -> bool:
    """Whether a new value repeats the present one, or all fields that a report has so far."""
    if isinstance(value, RobotReport) and isinstance(present, RobotReport):
        return all(v in (None, getattr(value, k)) for k, v in vars(present).items())
    return bool(value == present)
