"""A trials file, written by several programs and by people with an editor, and its journal.

Programs take turns by a lock on a file beside it. When `TrialBook.record` returns, the entry is on
the disk, in the trials file and in its journal.

The journal `trials.entries.jsonl` lies beside `trials.yaml`, and its lines never change, so nothing
is lost if an editor saves an old version of the trials file. Each line is on the disk before the
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
    """A trial is not in the expected state.

    Attributes:
        trial: the trial in its present state.
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
        """Reads the file once, to report errors early.

        Raises:
            DocumentError: it cannot be read, or does not fit the schema.
        """
        self.path = Path(path)
        self._known: SheetText | None = None
        self.sheet()

    def sheet(self) -> TrialSheet:
        """Present contents of the file; see `load_trials`."""
        return self._read().sheet

    def trial(self, number: int | Literal["next"]) -> RealTrial:
        """The trial with a number, or the first one without an outcome.

        Raises:
            InvalidInputError: there is none.
        """
        return self._find_trial(self.sheet(), number)

    def entries(self) -> list[Entry]:
        """All entries of the journal, in order."""
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
        """Recorded values that the file lacks; see `missing_values`."""
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
        """Records values of a trial; all else in the file stays the same, byte for byte.

        A repeated entry is recorded once. The journal keeps replaced values.

        Args:
            number: number of the trial; `next` for the first one without an outcome.
            correct: the entry replaces contradicting values.
            again: the trial was carried out once more; the entry replaces all values.
            expected: record only if the trial still equals this one.
            entry: fields of `RealTrial`: `outcome`, `time` (now, if there is an outcome and no time
                is given), `operator`, `note`, `photo`, `placement`, `robot` (a `RobotReport`, or a
                mapping of its known fields).

        Returns:
            The trial as written to the disk.

        Raises:
            UnknownNameError: a field does not exist.
            TrialChanged: the trial is not as expected.
            InvalidInputError: the trial or outcome does not exist; the trial has another entry
                already; or the file cannot be written.
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
                new = replace(new, time=trial.time if same else current_time())
            return new

        how: How = "again" if again else "corrected" if correct else "recorded"
        return self._record_change(number, change, how)

    def restore(self, numbers: Sequence[int] | None = None) -> list[RealTrial]:
        """Restores recorded values that the file lacks, except those edited by hand.

        Args:
            numbers: numbers of trials; all if None.

        Returns:
            The changed trials.
        """
        return [
            self._record_change(lost.number, self._restore_values, "restored")
            for lost in self.missing_values()
            if lost.values and (numbers is None or lost.number in numbers)
        ]

    def keep(self, numbers: Sequence[int] | None = None) -> list[RealTrial]:
        """Records that the file is right where it differs from the journal.

        Args:
            numbers: numbers of trials; all if None.

        Returns:
            The trials that differ.
        """
        return [
            self._record_change(found.number, lambda trial: trial, "kept")
            for found in self.missing_values()
            if numbers is None or found.number in numbers
        ]

    def _restore_values(self, trial: RealTrial) -> RealTrial:
        """Replaces older values by the last recorded ones. The caller holds the lock."""
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
        """Refuses an entry that contradicts present values, unless `correct` or `again` is set.

        Args:
            trial: the present trial.
            entry, correct, again: as for `record`.

        Raises:
            UnknownNameError: a field does not exist.
            InvalidInputError: the entry contradicts the trial, or is invalid.
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
                if read_text(self.path) == before.text:  # unless an editor has written it meanwhile
                    break
            entry = Entry(
                number=old.number,
                grasp=old.grasp,
                content=old.content,
                at=current_time(),
                how=how,
                before=entered_values(old),
                after=entered_values(new),
            )
            append_entry(journal_path(self.path), entry)
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
        """Reads the file; parses only changes since the last call."""
        text, known = read_text(self.path), self._known
        known = SheetText.read(text, str(self.path)) if known is None else known.read_changed(text)
        self._known = known
        return known


def current_time() -> str:
    """The present time, ISO 8601 with time zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


TRIALS_LOCK_TIMEOUT = 30.0
"""Seconds; each writer takes some hundredths of a second."""


@contextlib.contextmanager
def lock_trials_file(trials_path: Path) -> Iterator[None]:
    """Context manager that admits one writer at a time. The lock is released when the writer's
    process ends, in whatever way.

    Args:
        trials_path: the trials file.

    Raises:
        InvalidInputError: the lock file cannot be created, or another process keeps the lock.
    """
    real = Path(os.path.realpath(trials_path))  # links to a file share its lock
    path = real.with_name(f".{real.name}.lock")
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
    try:
        _acquire_lock(file, trials_path)
        yield
    finally:
        os.close(file)


def _acquire_lock(file: int, trials_path: Path) -> None:
    until = time.monotonic() + TRIALS_LOCK_TIMEOUT
    while True:
        try:
            if try_lock(file):
                return
        except OSError as error:
            raise missing_locks_error(trials_path, error) from error
        if time.monotonic() > until:
            raise InvalidInputError(
                f"{trials_path} has been locked by another process for {TRIALS_LOCK_TIMEOUT:g} s;"
                " nothing was recorded"
            )
        time.sleep(0.01)


How = Literal["recorded", "corrected", "again", "restored", "kept"]
"""`again`: the trial was carried out once more. `restored`: the file lacked recorded values.
`kept`: the file is right where it differs from the journal."""
EMPTY_ENTRY: dict[str, Any] = {
    "outcome": None,
    **dict.fromkeys(("time", "operator", "note", "photo"), ""),
    "placement": {},
    "robot": None,
}
"""Recorded fields of a trial, with their values without an entry."""
JOURNAL_FIELDS = tuple(EMPTY_ENTRY)
"""Recorded fields of a trial; all others are set when the trial is planned."""


@dataclass(frozen=True)
class Entry:
    """A line of the journal.

    Attributes:
        number, grasp, content: fields of the trial.
        at: time of the record, ISO 8601.
        how: kind of change.
        before, after: values of `JOURNAL_FIELDS` in the file, as plain data, without defaults.
    """

    number: int
    grasp: str
    content: str
    at: str
    how: How
    before: dict[str, Any]
    after: dict[str, Any]

    def is_of(self, trial: RealTrial) -> bool:
        """Whether the entry belongs to this trial, not to one in an earlier plan of the file."""
        key = (trial.number, trial.grasp, trial.content)
        return (self.number, self.grasp, self.content) == key


@dataclass(frozen=True)
class MissingValues:
    """Recorded values of a trial that the file lacks.

    Attributes:
        number: number of the trial.
        values: last recorded values, as plain data, of fields with an older value in the file.
        edited: fields whose value in the file was never recorded: somebody edited them by hand.
    """

    number: int
    values: dict[str, Any]
    edited: tuple[str, ...] = ()


def entered_values(trial: RealTrial) -> dict[str, Any]:
    """Entered values of a trial as plain data."""
    return {name: value for name, value in plain_data(trial).items() if name in JOURNAL_FIELDS}


def replace_entered_values(trial: RealTrial, values: Mapping[str, Any]) -> RealTrial:
    """A copy of a trial with other values in the form of `entered_values`; None stands for the
    default of a field.

    Raises:
        DocumentError: the values do not have the form of `entered_values`.
    """
    plain = plain_data(trial) | dict(values)
    text = dump_document({name: value for name, value in plain.items() if value is not None})
    name = "the journal"
    found: RealTrial = Reader(name).read(parse_yaml_node(text, name), RealTrial, "")
    return found


def journal_path(path: Path) -> Path:
    """The journal of a trials file. It lies beside the file itself, even if the path is a link."""
    real = Path(os.path.realpath(path))
    return real.with_name(f"{real.stem}.entries.jsonl")


def read_entries(path: Path) -> list[Entry]:
    """All undamaged entries of a journal, in order; see `damaged_lines`.

    Raises:
        InvalidInputError: it cannot be read.
    """
    return [entry for _, entry in _read_lines(path) if entry is not None]


def damaged_lines(path: Path) -> list[int]:
    """Numbers, from 1, of the unreadable lines of a journal. A killed writer leaves one, whose
    entry was never acknowledged; other damage is possible.

    Raises:
        InvalidInputError: it cannot be read at all.
    """
    return [number for number, entry in _read_lines(path) if entry is None]


def _read_lines(path: Path) -> Iterator[tuple[int, Entry | None]]:
    """Entries of a journal with their line numbers; None for unreadable lines."""
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
        ValueError, TypeError: the line is not JSON, or its fields or their types are wrong.
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
    """Appends an entry and waits until it is on the disk. The caller holds the lock.

    Raises:
        InvalidInputError: it cannot be written.
    """
    line = json.dumps(dataclasses.asdict(entry), allow_nan=False).encode() + b"\n"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            size = os.fstat(file).st_size
            if size and os.pread(file, 1, size - 1) != b"\n":
                line = b"\n" + line  # the last writer was killed within its line
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
    """Waits until the file names of a folder are on the disk."""
    file = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def missing_values(sheet: TrialSheet, entries: Iterable[Entry]) -> list[MissingValues]:
    """Recorded values that the trials file lacks, by trial.

    A field counts as lost if the file has a value from before the last entry, and as edited by
    hand if the file has a value that is not in the journal.
    """
    found = []
    entries = list(entries)
    for trial in sheet.trials:
        recorded = [entry for entry in entries if entry.is_of(trial)]
        if not recorded:
            continue
        now, last = entered_values(trial), recorded[-1].after
        differing = [name for name in JOURNAL_FIELDS if now.get(name) != last.get(name)]
        known = [values for entry in recorded for values in (entry.before, entry.after)]
        missing = [n for n in differing if any(now.get(n) == values.get(n) for values in known)]
        if differing:
            edited = tuple(name for name in differing if name not in missing)
            values = {name: last.get(name) for name in missing}
            found.append(MissingValues(trial.number, values, edited))
    return found


def parse_real_outcome(name: str) -> RealOutcome:
    """The outcome with a name.

    Raises:
        InvalidInputError: there is none; the message suggests the nearest.
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
    """Completes the robot's report in an entry with the fields already reported for the trial."""
    robot = given.get("robot")
    if not isinstance(robot, Mapping):
        return dict(given)
    return {**given, "robot": replace(trial.robot or RobotReport(), **robot)}


def contains_value(value: Any, present: Any) -> bool:
    """Whether a new value equals the present one, or is a report that repeats its known fields."""
    if isinstance(value, RobotReport) and isinstance(present, RobotReport):
        return all(v in (None, getattr(value, k)) for k, v in vars(present).items())
    return bool(value == present)
