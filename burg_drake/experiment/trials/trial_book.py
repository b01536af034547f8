"""A trials file that several programs, and people with an editor, write to, and its journal.

Programs take turns by a lock on a file beside it. When `TrialBook.record` returns, the entry is on
the disk, in the trials file and in its journal.

The journal `trials.entries.jsonl` lies beside `trials.yaml`, and its lines never change: an editor
that saves an old version of the trials file loses nothing. Each line is on the disk before the
trials file changes.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, get_args

from burg_drake.core import (
    InvalidInputError,
    Reader,
    RealOutcome,
    UnknownNameError,
    atomic_write,
    dump_document,
    list_names,
    missing_locks_error,
    open_regular,
    parse_json,
    parse_yaml_node,
    plain_data,
    quote_value,
    read_text,
    suggest_names,
    try_lock,
)
from burg_drake.experiment.trials.sheet_text import SheetText
from burg_drake.experiment.trials.trial_sheet import RealTrial, RobotReport, TrialSheet


class TrialChanged(InvalidInputError):
    """A trial is not what it was taken for.

    Attributes:
        trial: as it is.
    """

    def __init__(self, message: str, trial: RealTrial) -> None:
        super().__init__(message)
        self.trial = trial


class TrialBook:
    """A trials file on disk.

    Example::

        book = burg.trials.TrialBook("trials.yaml")
        print(book.trial("next").grasp)
        book.record("next", outcome="lifted", operator="Ada")

    Attributes:
        path: the file.
    """

    def __init__(self, path: str | Path) -> None:
        """Reads the file once, to find out whether it can be.

        Raises:
            DocumentError: it cannot be read, or does not fit the schema.
        """
        self.path = Path(path)
        self._known: SheetText | None = None
        self.sheet()

    def sheet(self) -> TrialSheet:
        """What the file holds now; see `load_trials`."""
        return self._read().sheet

    def trial(self, number: int | Literal["next"]) -> RealTrial:
        """The trial of a number, or the first one without an outcome.

        Raises:
            InvalidInputError: there is none.
        """
        return self._find_trial(self.sheet(), number)

    def entries(self) -> list[Entry]:
        """All that was ever recorded, in order."""
        return read_entries(journal_path(self.path))

    def damage(self) -> str:
        """A message about damaged lines of the journal; empty if there are none."""
        journal = journal_path(self.path)
        lines = damaged_lines(journal)
        if not lines:
            return ""
        entries, them = ("entry", "line") if len(lines) == 1 else ("entries", "lines")
        return (
            f"{journal}:{list_names([str(line) for line in lines])}: damaged {entries}, skipped;"
            f" compare {self.path.name} with your notes, then delete the {them}"
        )

    def missing_values(self) -> list[MissingValues]:
        """Entries that the file lacks; see `journal.missing_values`."""
        return missing_values(self.sheet(), self.entries())

    def record(
        self,
        number: int | Literal["next"],
        *,
        correct: bool = False,
        again: bool = False,
        expected: RealTrial | None = None,
        **entry: Any,
    ) -> RealTrial:
        """Enters what is known of a trial; all else in the file stays as it is, byte for byte.

        The same entry twice is one. The journal keeps what is replaced.

        Args:
            number: of the trial; `next` for the first one without an outcome.
            correct: the entry replaces what contradicts it.
            again: the trial was carried out once more: the entry replaces all that there is.
            expected: only if the trial still is this one, and nobody has changed it meanwhile.
            entry: fields of `RealTrial`: `outcome`, `time` (now, if there is an outcome and nothing
                else is said), `operator`, `note`, `photo`, `placement`, `robot`, a `RobotReport`
                or its fields that are known.

        Returns:
            The trial as it is on the disk.

        Raises:
            UnknownNameError: there is no such field.
            TrialChanged: it is not as expected.
            InvalidInputError: there is no such trial, or no such outcome; the trial has another
                entry already; or the file cannot be written.
        """
        given = check_entry(entry)

        def change(trial: RealTrial) -> RealTrial:
            if expected is not None and trial != expected:
                raise TrialChanged(
                    f"{self.path}: trial {trial.number} was changed by someone else", trial
                )
            self.require_open(trial, given, correct=correct, again=again)
            base = replace(trial, **EMPTY_ENTRY) if again else trial
            new = replace(base, **merge_robot_report(base, given))
            if new.outcome is not None and "time" not in given:
                same = not again and new.outcome is trial.outcome and trial.time
                new = replace(new, time=trial.time if same else _current_time())
            return new

        how: How = "again" if again else "corrected" if correct else "recorded"
        return self._record_change(number, change, how)

    def restore(self, numbers: Sequence[int] | None = None) -> list[RealTrial]:
        """Enters again what the file lacks; what was edited by hand stays.

        Args:
            numbers: of trials; all if None.

        Returns:
            The trials that were changed.
        """
        return [
            self._record_change(lost.number, self._restore_values, "restored")
            for lost in self.missing_values()
            if lost.values and (numbers is None or lost.number in numbers)
        ]

    def keep(self, numbers: Sequence[int] | None = None) -> list[RealTrial]:
        """Notes that the file is right where it differs from what was recorded.

        Args:
            numbers: of trials; all if None.

        Returns:
            These trials.
        """
        return [
            self._record_change(found.number, lambda trial: trial, "kept")
            for found in self.missing_values()
            if numbers is None or found.number in numbers
        ]

    def _restore_values(self, trial: RealTrial) -> RealTrial:
        """With the last entry's value of each field that has an older one; under the lock."""
        lost = [found.values for found in self.missing_values() if found.number == trial.number]
        return replace_entered_values(trial, lost[0]) if lost else trial

    def require_open(
        self,
        trial: RealTrial,
        entry: Mapping[str, Any],
        *,
        correct: bool = False,
        again: bool = False,
    ) -> None:
        """Refuses an entry that contradicts one that is there, unless it is to replace it.

        Args:
            trial: as it is.
            entry, correct, again: as for `record`.

        Raises:
            UnknownNameError: there is no such field.
            InvalidInputError: it contradicts, or cannot be read.
        """
        given = merge_robot_report(trial, check_entry(entry))
        if correct or again:
            return
        for name, value in given.items():
            present = getattr(trial, name)
            if present != EMPTY_ENTRY[name] and not contains_value(value, present):
                shown = f" {quote_value(str(present))}" if isinstance(present, str) else ""
                raise InvalidInputError(
                    f"{self.path}: trial {trial.number} already has {name}{shown}; say"
                    " whether this corrects it, or whether the trial was done again"
                ).about("correct", "again")

    def _record_change(
        self, number: int | Literal["next"], change: Callable[[RealTrial], RealTrial], how: How
    ) -> RealTrial:
        with lock_trials_file(self.path):
            while True:
                before = self._read()
                old = self._find_trial(before.sheet, number)
                new = change(old)
                if new == old and how != "kept":
                    return old
                after = before.with_trial(new)
                if read_text(self.path) == before.text:  # no editor has written it meanwhile
                    break
            now = _current_time()
            names = (old.number, old.grasp, old.content, now, how)
            append_entry(
                journal_path(self.path), Entry(*names, entered_values(old), entered_values(new))
            )
            if new != old:
                atomic_write(self.path, after.text.encode())
                sync_folder(Path(os.path.realpath(self.path)).parent)
                self._known = after
        return new

    def _find_trial(self, sheet: TrialSheet, number: int | Literal["next"]) -> RealTrial:
        if number != "next":
            try:
                return sheet.trial(number)
            except InvalidInputError as error:
                raise InvalidInputError(f"{self.path}: {error}") from error
        if sheet.next is None:
            raise InvalidInputError(f"{self.path}: all trials have an outcome; none is left")
        return sheet.next

    def _read(self) -> SheetText:
        """What the file holds now; only what has changed since the last call is parsed."""
        text, known = read_text(self.path), self._known
        known = SheetText.read(text, str(self.path)) if known is None else known.read_changed(text)
        self._known = known
        return known


def _current_time() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")


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
