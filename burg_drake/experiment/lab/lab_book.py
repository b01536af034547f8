"""Access of the lab page to the trials file, with entries from several browsers.

An entry names the state of the trial that it replaces. It is written if the trial is still in that
state. An entry that is already in the file or its journal counts as written, so a browser may send
it repeatedly. Any other entry is refused with an error, as another browser changed the trial first.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from burg_drake.core import BurgError, InvalidInputError, RealOutcome, content_hash, outcome_label
from burg_drake.experiment.lab.tried_grasps import (
    MAIN_OUTCOMES,
    TriedRuns,
    approach_text,
    closing_text,
    point_text,
)
from burg_drake.experiment.trials.trial_book import TrialBook, TrialChanged, entered_values
from burg_drake.experiment.trials.trial_sheet import ObjectPlace, RealTrial, RobotReport, TrialSheet

OPERATOR_FIELDS = ("outcome", "time", "operator", "note", "robot")
"""Fields entered by people; photo and placement come from the camera."""


@dataclass(frozen=True, kw_only=True)
class LabEntry:
    """An entry made on the page.

    Attributes:
        number: number of the trial.
        replaces: state of the trial when the entry was made, see `trial_state_hash`.
        outcome: outcome; None removes the outcome that is there.
        time: time of the click, ISO 8601 with time zone.
        operator, note: the operator and remarks.
        width_mm: final distance between the pads [mm].
    """

    number: int
    replaces: str
    outcome: RealOutcome | None
    time: str = ""
    operator: str = ""
    note: str = ""
    width_mm: float | None = None


class LabBook:
    """Reads and writes a trials file; every method may be called from any thread.

    Args:
        runs: runs of the file.
        show_simulated: whether the page may show simulated outcomes.
    """

    def __init__(self, runs: TriedRuns, *, show_simulated: bool = False) -> None:
        self.runs, self.show_simulated = runs, show_simulated
        self.book = TrialBook(runs.path)
        self.plan_hash = hash_plan(runs.sheet)
        self._lock = threading.Lock()
        self._cached: tuple[object, TrialSheet, str] | None = None

    def sheet(self) -> TrialSheet:
        """Present contents of the file.

        Raises:
            DocumentError: the file cannot be read, perhaps only now while somebody edits it.
            InvalidInputError: the file holds other trials by now.
        """
        return self.sheet_and_version()[0]

    def enter(self, entry: LabEntry) -> RealTrial:
        """Writes an entry to the disk.

        Returns:
            The trial with the entry.

        Raises:
            TrialChanged: the trial is not in the state `entry.replaces`, and neither the file nor
                its journal has the entry.
            BurgError: there is no such trial, or the file cannot be read or written.
        """
        with self._lock:
            trial = self.sheet().trial(entry.number)
            while True:
                values = _changed_fields(entry, trial)
                if self._is_written(entry, values, trial):
                    return trial
                if trial_state_hash(trial) != entry.replaces:
                    raise _conflict(trial)
                empty = all(getattr(trial, name) in ("", None) for name in OPERATOR_FIELDS)
                try:
                    return self.book.record(
                        entry.number, correct=not empty, expected=trial, **values
                    )
                except TrialChanged as changed:  # by another program, since it was read
                    trial = changed.trial

    def record_photo(self, number: int, photo: str, placement: dict[str, ObjectPlace]) -> RealTrial:
        """Enters photo and placement from before a trial, even if the trial was carried out
        meanwhile; keeps its other entries.

        Raises:
            BurgError: as for `enter`.
        """
        with self._lock:
            return self.book.record(number, correct=True, photo=photo, placement=placement)

    def require_open(self, number: int) -> RealTrial:
        """Returns a trial without an outcome, which may still get a photo.

        Raises:
            InvalidInputError: the trial has an outcome or does not exist.
        """
        trial = self.sheet().trial(number)
        if trial.outcome is not None:
            raise InvalidInputError(
                f"trial {number} already has an outcome; photo and placement were not saved"
            )
        return trial

    def _is_written(self, entry: LabEntry, values: dict[str, Any], trial: RealTrial) -> bool:
        """Whether the entry is in the file, or was in the file before a later entry."""
        if all(getattr(trial, name) == value for name, value in values.items()):
            return True
        if trial_state_hash(trial) == entry.replaces or entry.outcome is None:
            return False
        wanted = entered_values(replace(trial, **values))
        return any(
            past.is_of(trial)
            and all(past.after.get(name) == wanted.get(name) for name in OPERATOR_FIELDS)
            for past in self.book.entries()
        )

    def sheet_and_version(self) -> tuple[TrialSheet, str]:
        """Contents of the file, and a version text that changes with it; raises as `sheet` does."""
        path = Path(self.runs.path)
        try:
            status = path.stat()
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror}") from error
        key = (status.st_mtime_ns, status.st_size, status.st_ino)
        cached = self._cached
        if cached is None or cached[0] != key:
            sheet = self.book.sheet()
            if hash_plan(sheet) != self.plan_hash:
                raise InvalidInputError(f"{path} now holds other trials; start the page again")
            cached = (key, sheet, content_hash(*map(str, key))[:12])
            self._cached = cached
        return cached[1], cached[2]


def _conflict(trial: RealTrial) -> TrialChanged:
    what = "nothing" if trial.outcome is None else outcome_label(trial.outcome)
    who = f" by {trial.operator}" if trial.operator else ""
    message = f"trial {trial.number} was changed by someone else: it now has {what}{who}"
    return TrialChanged(message, trial)


def _changed_fields(entry: LabEntry, trial: RealTrial) -> dict[str, Any]:
    """New values of the fields of a trial that an entry sets."""
    if entry.outcome is None:
        return {"outcome": None, "time": "", "operator": "", "note": entry.note, "robot": None}
    effort = None if trial.robot is None else trial.robot.effort_n
    known = entry.width_mm is not None or effort is not None
    return {
        "outcome": entry.outcome,
        "time": entry.time,
        "operator": entry.operator,
        "note": entry.note,
        "robot": RobotReport(width_mm=entry.width_mm, effort_n=effort) if known else None,
    }


def hash_plan(sheet: TrialSheet) -> str:
    """Short hash of the planned trials, without entries."""
    trials = [f"{t.number} {t.run} {t.grasp} {t.content}" for t in sheet.trials]
    return content_hash(sheet.created, [run.hash for run in sheet.runs.values()], trials)[:12]


def trial_state_hash(trial: RealTrial) -> str:
    """Short hash of the values entered by people for a trial."""
    values = entered_values(trial)
    return content_hash({name: str(values.get(name)) for name in OPERATOR_FIELDS})[:12]


def plan_data(lab: LabBook) -> dict[str, Any]:
    """The unchanging data of the trials for the page."""
    sheet, runs = lab.runs.sheet, lab.runs
    return {
        "plan": lab.plan_hash,
        "file": lab.runs.path.name,
        "outcomes": [
            {"value": outcome.value, "label": label, "meaning": meaning}
            for outcome, (label, meaning) in MAIN_OUTCOMES.items()
        ],
        "others": [
            {"value": outcome.value, "label": outcome_label(outcome)}
            for outcome in RealOutcome
            if outcome not in MAIN_OUTCOMES
        ],
        "trials": [
            {
                "number": trial.number,
                "block": trial.block,
                "scene": runs.of(trial).scene.name,
                "station": runs.of(trial).station.name,
                "instance": trial.instance,
                "object": trial.object,
                "grasp": trial.grasp,
                "approach": approach_text(runs.X_SG(trial)),
                "fingers": closing_text(runs.X_SG(trial)),
                "point": point_text(runs.X_SG(trial)),
                "width": round(1e3 * runs.width(trial), 1),
                "opening": round(1e3 * runs.of(trial).station.hand.opening[1], 2),
                **({"simulated": trial.simulated.value} if lab.show_simulated else {}),
            }
            for trial in sorted(sheet.trials, key=lambda trial: trial.number)
        ],
    }


def entry_data(trial: RealTrial) -> dict[str, Any]:
    """Entered values of a trial for the page."""
    return {
        "number": trial.number,
        "state": trial_state_hash(trial),
        "outcome": trial.outcome and trial.outcome.value,
        "label": outcome_label(trial.outcome) if trial.outcome else "",
        "time": trial.time,
        "operator": trial.operator,
        "note": trial.note,
        "width_mm": trial.robot and trial.robot.width_mm,
        "photo": trial.photo,
        "placement": {name: _placement_data(place) for name, place in trial.placement.items()},
    }


def _placement_data(place: ObjectPlace) -> dict[str, Any]:
    # The trials file has no reasons.
    doubtful = place.status == "uncertain"
    reason = "doubtful; the file in placements/ has the reason" if doubtful else ""
    offset = None if place.offset_mm is None else sum(d * d for d in place.offset_mm) ** 0.5
    return {"status": place.status, "mm": offset, "deg": place.turn_deg, "reason": reason}


def entry_states(lab: LabBook) -> dict[str, Any]:
    """Entries of all trials for the page, or a message if the file cannot be read just now."""
    try:
        sheet, version = lab.sheet_and_version()
    except BurgError as error:
        return {"plan": lab.plan_hash, "problem": str(error)}
    entries = [entry_data(trial) for trial in sheet.trials]
    return {"plan": lab.plan_hash, "version": version, "problem": "", "entries": entries}
