"""The folder of the plans that `reach` makes, and how a later call continues it.

plans.yaml                   what was asked: documents, grasps, settings, versions
journal.jsonl                one line a judged grasp, as it came; times of computation are in it
INSTANCE-GRASP.json or .csv  the timed motion of each grasp that the arm can execute
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from burg_drake.core import (
    InvalidInputError,
    content_hash,
    software_versions,
)
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.files import remove_unfinished, writable_folder
from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.evaluation.candidates import Candidates
from burg_drake.evaluation.records import (
    HASH_DIGITS,
    JOURNAL_FILE,
    Input,
    Journal,
    differences,
    input_difference,
    motion_in,
    motion_text,
    read_journal,
    setting_differences,
    without_motion,
)

PlanFormat = Literal["json", "csv"]
DOCUMENT_FILE = "plans.yaml"
HEADER = "Record of the plans in this folder; written by the program."


@dataclass(frozen=True)
class PlanOutput:
    """Where the plans of `reach` go, and how.

    Attributes:
        folder: gets the timed motion of each grasp that the arm can execute, as
            `INSTANCE-GRASP.json`, see `plans.json_file`: a new or empty one, or that of an
            interrupted call, which the same call goes on with. What is finished is kept, and
            grasps are tried again whose worker process was ended from outside or whose plan is
            missing.
        format: `csv` for tables, with what their columns are beside them; see `plans.csv_file`.
            `load_plan` reads both.
        retry_failed: try all grasps again that an earlier call with this folder could not judge.
    """

    folder: str | Path
    format: PlanFormat = "json"
    retry_failed: bool = False


@dataclass(frozen=True, kw_only=True)
class PlansDocument:
    """A folder of arm motions, one for each grasp (`plans.yaml`).

    Attributes:
        scene: the scene.
        station: the station.
        grasps: number of grasps.
        content: hash of the grasps.
        arm: settings of the search for arm motions, in SI units.
        exact: whether Drake's collision checker confirmed each motion.
        format: format of the motions.
        versions: versions of the software and the machine.
    """

    version: int = 1
    scene: Input
    station: Input
    grasps: int
    content: str
    arm: dict[str, float]
    exact: bool
    format: PlanFormat
    versions: dict[str, str]


@dataclass(frozen=True)
class PlanFolder:
    """A folder for plans.

    Attributes:
        path: its path.
        document: what is asked.
    """

    path: Path
    document: PlansDocument

    def plan(self, id: str) -> Path:
        """The file for the plan of a grasp."""
        return self.path / f"{id}.{self.document.format}"

    @contextmanager
    def opened(self) -> Iterator[Journal]:
        """Makes the folder, or goes on with it; one call at a time can.

        Raises:
            InvalidInputError: it cannot be written, holds something else, or plans of something
                else; or another process is at it.
        """
        self._require_plans()
        writable_folder(self.path)
        with Journal(self.path / JOURNAL_FILE) as journal:
            document = self.path / DOCUMENT_FILE
            if document.exists():
                self._require_same(load_document(document, PlansDocument))
            else:
                save_document(self.document, document, HEADER)
            remove_unfinished(self.path)
            yield journal

    def verdicts(self) -> dict[str, Verdict]:
        """What the journal holds, by grasp id."""
        return read_journal(self.path / JOURNAL_FILE)

    def finished(self, *, retry_failed: bool = False) -> dict[str, Verdict]:
        """Verdicts that stand: the plan of what is reachable is there.

        Args:
            retry_failed: see `Verdict.is_open`.
        """
        return {
            id: verdict
            for id, verdict in self.verdicts().items()
            if not verdict.is_open(retry_failed=retry_failed)
            and (verdict.outcome is not Outcome.REACHABLE or self.plan(id).is_file())
        }

    def _require_plans(self) -> None:
        """Refuses a folder with anything but plans: they are not to be mixed up with others."""
        if not self.path.is_dir() or (self.path / DOCUMENT_FILE).exists():
            return
        held = sorted(item.name for item in self.path.iterdir() if not item.name.startswith("."))
        journal = self.path / JOURNAL_FILE
        begun = held == [JOURNAL_FILE] and journal.is_file() and journal.stat().st_size == 0
        if held and not begun:
            raise InvalidInputError(
                f"folder {self.path} has {held[0]} in it, but no {DOCUMENT_FILE}; plans"
                " need a folder of their own: choose another one, or empty it"
            )

    def _require_same(self, there: PlansDocument) -> None:
        here = self.document
        counts = f"grasps are {there.grasps} there, {here.grasps} here"
        words = {
            "scene": [input_difference("scene", there.scene, here.scene, behind="objects")],
            "station": [input_difference("station", there.station, here.station)],
            "grasps": [
                counts
                if there.grasps != here.grasps
                else ("the number of grasps is the same, but not the grasps")
            ],
            "settings of the arm": setting_differences(
                _other_arm_settings(there), _other_arm_settings(here)
            ),
        }
        found = differences(_identity(there), _identity(here), words)
        if found:
            raise InvalidInputError(
                f"folder {self.path} has plans of another evaluation ({'; '.join(found)}"
                "); choose another one, or delete it"
            )


def plans_document(
    scene: Input,
    station: Input,
    candidates: Candidates,
    arm: dict[str, float],
    *,
    exact: bool,
    format: PlanFormat,
) -> PlansDocument:
    """What a call asks for, with the versions that are installed."""
    return PlansDocument(
        scene=scene,
        station=station,
        grasps=len(candidates),
        content=candidates.content,
        arm=arm,
        exact=exact,
        format=format,
        versions=software_versions(),
    )


def _identity(document: PlansDocument) -> dict[str, str]:
    """What two calls must have in common to work on the same plans, in words, by topic."""
    return {
        "scene": f"content {document.scene.content[:HASH_DIGITS]}",
        "station": f"content {document.station.content[:HASH_DIGITS]}",
        "grasps": f"{document.grasps}, content {document.content[:HASH_DIGITS]}",
        "check": "exact" if document.exact else "screening",
        "settings of the arm": content_hash(_other_arm_settings(document))[:HASH_DIGITS],
        "motion": motion_text(motion_in(document.arm)),
        "format": document.format,
        "burg_drake": document.versions.get("burg_drake", ""),
        "drake": document.versions.get("drake", ""),
    }


def _other_arm_settings(document: PlansDocument) -> dict[str, float]:
    """Settings of the arm that are no topics of their own."""
    return without_motion({k: v for k, v in document.arm.items() if k != "exact"})
