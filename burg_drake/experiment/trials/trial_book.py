"""A trials file that several programs, and people with an editor, write to.

Programs take turns by a lock on a file beside it. When `TrialBook.record` returns, the entry is on
the disk, in the trials file and in its journal.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from burg_drake.core import InvalidInputError, atomic_write, list_names, quote_value, read_text
from burg_drake.experiment.trials.journal import (
    EMPTY_ENTRY,
    Entry,
    How,
    MissingValues,
    append_entry,
    check_entry,
    contains_value,
    damaged_lines,
    entered_values,
    journal_path,
    lock_trials_file,
    merge_robot_report,
    missing_values,
    read_entries,
    replace_entered_values,
    sync_folder,
)
from burg_drake.experiment.trials.sheet_text import SheetText
from burg_drake.experiment.trials.trial_sheet import RealTrial, TrialSheet


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
