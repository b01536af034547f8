"""A scene of many while it is judged: its journal, what is left, and how far it is."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.records import JOURNAL_FILE, Journal, SceneState, WorkSession, begun_now
from burg_drake.evaluation.results import shortfalls
from burg_drake.evaluation.run.preparation import open_grasps
from burg_drake.evaluation.run.request import Request
from burg_drake.evaluation.store import PART_ROWS, REPORT_FILE, Run, load_run, save_run


class SceneJudging:
    """A scene that is being judged.

    Attributes:
        name: in the run.
        left: grasps that had no verdict when it was opened.
        mine: how many grasps are judged here.
        known: how many of them had one.
    """

    def __init__(self, name: str, folder: Path, request: Request, workers: int) -> None:
        """Opens the run.

        Raises:
            InvalidInputError: another process is writing it.
        """
        self.name = name
        self._run = load_run(folder)
        self._journal: Journal | None = Journal(folder / JOURNAL_FILE)
        self.left: Sequence[Candidate] = open_grasps(self._run, retry_failed=request.retry_failed)
        again = {grasp.id for grasp in self.left}
        self.mine = len(self._run.mine)
        self.known = self.mine - len(self.left)
        self._before = len(self._run.verdicts)
        # verdicts are not kept: a thousand runs have a million
        self._failed = {
            id: v.interrupted
            for id, v in self._run.verdicts.items()
            if v.outcome is Outcome.SIMULATION_FAILED and id not in again
        }
        self._judged = 0
        self._workers = workers
        self._count = len(self._run.candidates)
        self._missing = "; ".join(shortfalls(self._run))
        self._run = Run(folder, self._run.document)

    @property
    def is_done(self) -> bool:
        """Whether nothing is left."""
        return self._judged == len(self.left)

    def begin(self) -> None:
        """Writes into the run's document that it is worked on."""
        self._session = begun_now(self._workers, self._before)
        self._begun = time.monotonic()
        self._save(self._session)

    def take(self, id: str, verdict: Verdict) -> None:
        """Keeps a verdict."""
        assert self._journal is not None
        self._journal.append(id, verdict)
        self._judged += 1
        if verdict.outcome is Outcome.SIMULATION_FAILED:
            self._failed[id] = verdict.interrupted

    def is_part_due(self) -> bool:
        """Whether so many were judged again that their rows should go to a part."""
        return self._judged % PART_ROWS == 0

    def close(self) -> None:
        """Writes into the run's document what was done, and closes the journal."""
        if self._journal is None:
            return
        self._journal.close()
        self._journal = None
        if self.left:
            seconds = round(time.monotonic() - self._begun, 3)
            self._save(replace(self._session, judged=self._judged, seconds=seconds))

    def state(self, state: Literal["open", "done"]) -> SceneState:
        """How far it is."""
        document = self._run.document
        if state == "done":
            self.close()
        journal = self._run.path / JOURNAL_FILE
        return SceneState(
            scene=self.name,
            state=state,
            run=document.hash,
            grasps=self._count,
            mine=self.mine,
            sampling=document.grasps.cpu,
            size=journal.stat().st_size if state == "done" else 0,
            failed=len(self._failed) if state == "done" else 0,
            interrupted=sum(self._failed.values()) if state == "done" else 0,
            missing=self._missing,
        )

    def _save(self, session: WorkSession) -> None:
        document = self._run.document
        sessions = (*document.stretches, session)
        save_run(replace(self._run, document=replace(document, stretches=sessions)))


def is_finished(folder: Path, size: int, table: str, *, report: bool) -> bool:
    """Whether a run's journal has this size, and its table is not older, nor its report."""
    names = [f"results.{table}", *([REPORT_FILE] if report else [])]
    try:
        journal = (folder / JOURNAL_FILE).stat()
        others = [(folder / name).stat() for name in names]
    except OSError:
        return False
    newer = all(other.st_mtime_ns >= journal.st_mtime_ns for other in others)
    return journal.st_size == size and newer
