"""Work on one scene of a run over many: prepared and finished in other processes, judged here."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.core import (
    Outcome,
    Prefetcher,
    Session,
    SimulationError,
    Task,
    Verdict,
    WorkerFuture,
    WorkerPool,
    ensure_writable_folder,
    remove_unfinished,
)
from burg_drake.evaluation.campaign_folder import Campaign, SceneState
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.journal import JOURNAL_FILE, Journal
from burg_drake.evaluation.part_store import PART_ROWS, PartWriter
from burg_drake.evaluation.run_document import WorkSession, add_session, begin_session
from burg_drake.evaluation.run_folder import (
    REPORT_FILE,
    RUN_FILE,
    Run,
    load_run,
    require_run_folder,
    save_run,
)
from burg_drake.evaluation.run_preparation import (
    RunRequest,
    finish_run,
    open_rows,
    open_run,
    require_sound,
)
from burg_drake.evaluation.run_summary import run_shortfall_notes
from burg_drake.evaluation.settings import TableFormat
from burg_drake.scene import Scene, as_scene


class SceneJudging:
    """A scene that is being judged.

    Attributes:
        name: in the run.
        left: grasps that had no verdict when it was opened.
        mine: how many grasps are judged here.
        known: how many of them had one.
    """

    def __init__(self, name: str, folder: Path, request: RunRequest, workers: int) -> None:
        """Opens the run.

        Raises:
            InvalidInputError: another process is writing it.
        """
        self.name = name
        self._run = load_run(folder)
        self._journal: Journal | None = Journal(folder / JOURNAL_FILE)
        run, index = self._run, self._run.index
        left = open_rows(run, retry_failed=request.retry_failed)
        self.left: Sequence[Candidate] = run.candidates.at(left)
        self.mine = len(run.mine)
        self.known = self.mine - len(left)
        self._before = int(index.judged.sum())
        failed = np.setdiff1d(np.flatnonzero(index.failed), left).tolist()
        ids = run.candidates.id
        self._failed = {ids[row]: bool(index.interrupted[row]) for row in failed}
        self._judged = 0
        self._workers = workers
        self._count = len(self._run.candidates)
        self._missing = "; ".join(run_shortfall_notes(self._run))
        self._run = Run(folder, self._run.document)

    @property
    def is_done(self) -> bool:
        """Whether nothing is left."""
        return self._judged == len(self.left)

    def begin(self) -> None:
        """Writes into the run's document that it is worked on."""
        self._session = begin_session(self._workers, self._before)
        self._begun = time.monotonic()
        self._save(self._session)

    def add_verdict(self, id: str, verdict: Verdict) -> None:
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
            self._save(self._session.finish(self._judged, self._begun))

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
        save_run(Run(self._run.path, add_session(self._run.document, session)))


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


@dataclass(frozen=True, eq=False)
class PrepareTask:
    """A scene whose run is to be begun, or gone on with.

    Attributes:
        name: of the scene in the run.
        folder: of its run.
        scene: as loaded, or its file.
    """

    name: str
    folder: Path
    scene: Scene | Path


@dataclass(frozen=True)
class FinishTask:
    """A scene that is judged, or so far that its rows go to a part.

    Attributes:
        name: of the scene in the run.
        judged: whether all that is judged here is; then table and report are written, too.
    """

    name: str
    judged: bool = True


@dataclass(frozen=True, eq=False)
class Preparer:
    """Prepares scenes.

    Attributes:
        request: what is asked.
    """

    request: RunRequest

    def __call__(self, work: PrepareTask) -> Scene | None:
        """Makes the folder of a scene's run; returns the scene, or None if there are no grasps.

        Raises:
            BurgError: it cannot be judged.
        """
        try:
            return self._prepare(work)
        except SystemExit as error:  # DRAKE_DEMAND ends this way
            raise SimulationError(f"SystemExit: {error}") from error

    def _prepare(self, work: PrepareTask) -> Scene | None:
        scene = as_scene(work.scene)
        request = self.request.narrow_to_scene(scene)
        if request is None:
            return None
        require_run_folder(work.folder)
        if not (work.folder / RUN_FILE).exists():
            require_sound(scene, request.station, request.mode, request.engine)
        given = request.given_candidates(scene)
        remove_unfinished(ensure_writable_folder(work.folder))
        with Journal(work.folder / JOURNAL_FILE):
            open_run(work.folder, scene, request, given)
        return scene


@dataclass(frozen=True)
class SceneOutputs:
    """What is kept of the scenes.

    Attributes:
        campaign: the run over many scenes.
        table: format of the tables.
        reports: whether each scene gets a report.
    """

    campaign: Campaign
    table: TableFormat
    reports: bool


class SceneResultsWriter:
    """Writes what comes of scenes: tables, reports, parts."""

    def __init__(self, outputs: SceneOutputs) -> None:
        self._outputs = outputs
        self._writer: PartWriter | None = None

    def __call__(self, work: FinishTask | None) -> None:
        """Writes what a scene is for, or closes the parts if None.

        Raises:
            BurgError: a file cannot be written.
        """
        if work is None:
            if self.writer.scenes_behind():
                self.writer.catch_up()
            self.writer.close()
            return
        run = load_run(self._outputs.campaign.folder(work.name))
        if work.judged:
            run = finish_run(run, self._outputs.table, report=self._outputs.reports)
        self.writer.add_rows(work.name, run)

    @property
    def writer(self) -> PartWriter:
        """Opened when it is needed, as it looks at all parts."""
        if self._writer is None:
            self._writer = PartWriter(self._outputs.campaign)
        return self._writer


def preparer_count(workers: int) -> int:
    """How many processes prepare scenes. A cluster may have no workers yet."""
    # one for 16 workers, as sampling takes about a thirtieth of the time of the trials
    return max(1, -(-workers // 16))


class SceneProcesses:
    """What is done about scenes but judging; a context that ends its processes."""

    def __init__(self, preparer: Preparer, outputs: SceneOutputs, workers: int) -> None:
        """Starts nothing yet.

        Args:
            preparer: prepares scenes.
            outputs: what is kept of them.
            workers: that judge.
        """
        self._pools: list[WorkerPool] = []
        self._preparer, self._preparers = preparer, self._pool(preparer_count(workers))
        self._finisher = self._pool(1)
        self._finishing: deque[tuple[FinishTask | None, WorkerFuture[None]]] = deque()
        self._session = Session("finish", partial(SceneResultsWriter, outputs))
        self._here = SceneResultsWriter(outputs)
        self._used = False
        self._failed: list[FinishTask | None] = []

    def prepare(self, work: Iterable[PrepareTask]) -> None:
        """Says which scenes are to be prepared, in order."""
        session = Session("prepare", partial(Preparer, self._preparer.request))
        self._ahead: Prefetcher[PrepareTask, Scene | None] = Prefetcher(
            self._preparers,
            iter(work),
            lambda item: Task(Preparer.__call__, (item,), session=session),
        )

    def ready(self) -> bool:
        """Whether `prepared` returns at once."""
        return self._ahead.ready()

    def prepared(self) -> tuple[PrepareTask, Scene | BaseException | None] | None:
        """The next scene whose run has been begun, or why it cannot be; without grasps its result
        is None. None when there are no more scenes."""
        return self._ahead.take()

    def finish(self, name: str) -> None:
        """Has table, report and rows of a judged scene written."""
        self._give(FinishTask(name))

    def write_rows(self, name: str) -> None:
        """Has rows of a scene written that is being judged."""
        self._give(FinishTask(name, judged=False))

    def close(self) -> None:
        """Waits until all is written.

        Raises:
            BurgError: something cannot be written.
        """
        if self._used:
            self._submit(None)
            self._collect_finished(wait=True)
        for work in self._failed or (() if self._used else (None,)):
            self._here(work)  # where it fails again it is an error
        if self._failed:
            self._here(None)

    def __enter__(self) -> SceneProcesses:
        return self

    def __exit__(self, *error: object) -> None:
        for pool in self._pools:
            pool.kill_workers()

    def _pool(self, workers: int) -> WorkerPool:
        self._pools.append(WorkerPool(workers, retries=0, own_group=True))
        return self._pools[-1]

    def _give(self, work: FinishTask) -> None:
        self._used = True
        self._submit(work)
        self._collect_finished(wait=False)

    def _submit(self, work: FinishTask | None) -> None:
        task = Task(SceneResultsWriter.__call__, (work,), session=self._session)
        self._finishing.append((work, self._finisher.submit_task(task)))

    def _collect_finished(self, wait: bool) -> None:
        """Notes what could not be written, of what is finished, or of all when that is."""
        while self._finishing and (wait or self._finishing[0][1].done()):
            work, future = self._finishing.popleft()
            if future.exception() is not None:
                self._failed.append(work)
