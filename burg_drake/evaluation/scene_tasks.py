"""Work on single scenes of a run over many: preparing, recording verdicts, writing results."""

from __future__ import annotations

import time
from collections import Counter, deque
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
    default_workers,
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
from burg_drake.station import Engine


class SceneJudging:
    """A scene that is being judged.

    Attributes:
        name: name of the scene in the run.
        left: grasps that had to be judged when the scene was opened.
        assigned_count: number of grasps assigned to this run (or shard).
        known_count: number of assigned grasps that need not be judged.
    """

    def __init__(self, name: str, folder: Path, request: RunRequest, workers: int) -> None:
        """Opens the run of the scene.

        Raises:
            InvalidInputError: another process is writing it.
        """
        self.name = name
        self._run = load_run(folder)
        self._journal: Journal | None = Journal(folder / JOURNAL_FILE)
        run, index = self._run, self._run.index
        left = open_rows(run, retry_failed=request.retry_failed)
        self.left: Sequence[Candidate] = run.candidates.at(left)
        self.assigned_count = len(run.assigned_ids)
        self.known_count = self.assigned_count - len(left)
        self._judged_before = int(index.judged.sum())
        failed = np.setdiff1d(np.flatnonzero(index.failed), left).tolist()
        ids = run.candidates.id
        self._failed = {ids[row]: bool(index.interrupted[row]) for row in failed}
        self._judged: Counter[str] = Counter()
        self._workers, self._device = workers, request.device_text()
        self._candidate_count = len(self._run.candidates)
        self._shortfall_notes = "; ".join(run_shortfall_notes(self._run))
        self._run = Run(folder, self._run.document)

    @property
    def is_done(self) -> bool:
        """Whether all grasps are judged."""
        return self._judged.total() == len(self.left)

    def begin(self) -> None:
        """Records in the run's document that a session begins."""
        self._session = begin_session(self._workers, self._judged_before, self._device)
        self._begun = time.monotonic()
        self._save(self._session)

    def add_verdict(self, id: str, verdict: Verdict) -> None:
        """Writes a verdict to the journal."""
        assert self._journal is not None
        self._journal.append(id, verdict)
        self._judged[verdict.device] += 1
        if verdict.outcome is Outcome.SIMULATION_FAILED:
            self._failed[id] = verdict.interrupted

    def is_part_due(self) -> bool:
        """Whether enough grasps were judged since the last part to write another."""
        return self._judged.total() % PART_ROWS == 0

    def close(self) -> None:
        """Records the finished session in the run's document, and closes the journal."""
        if self._journal is None:
            return
        self._journal.close()
        self._journal = None
        if self.left:
            self._save(self._session.finish(self._judged, self._begun))

    def state(self, state: Literal["open", "done"]) -> SceneState:
        """Progress to record for the scene; closes the journal if `done`."""
        document = self._run.document
        if state == "done":
            self.close()
        journal = self._run.path / JOURNAL_FILE
        return SceneState(
            scene=self.name,
            state=state,
            run=document.hash,
            grasps=self._candidate_count,
            mine=self.assigned_count,
            sampling=document.grasps.cpu,
            size=journal.stat().st_size if state == "done" else 0,
            failed=len(self._failed) if state == "done" else 0,
            interrupted=sum(self._failed.values()) if state == "done" else 0,
            missing=self._shortfall_notes,
        )

    def _save(self, session: WorkSession) -> None:
        save_run(Run(self._run.path, add_session(self._run.document, session)))


def is_finished(folder: Path, size: int, table: str, *, report: bool) -> bool:
    """Whether a run's journal has this size, and table and (if wanted) report are up to date."""
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
    """A scene whose run is to be begun or continued.

    Attributes:
        name: name of the scene in the run.
        folder: folder of its run.
        scene: the loaded scene, or its file.
    """

    name: str
    folder: Path
    scene: Scene | Path


@dataclass(frozen=True)
class FinishTask:
    """A scene whose new rows are to be written to a part.

    Attributes:
        name: name of the scene in the run.
        judged: whether all assigned grasps are judged; then table and report are written, too.
    """

    name: str
    judged: bool = True


@dataclass(frozen=True, eq=False)
class Preparer:
    """Prepares the runs of scenes.

    Attributes:
        request: the request for all scenes.
    """

    request: RunRequest

    def __call__(self, work: PrepareTask) -> Scene | None:
        """Creates or reopens the run of a scene; returns the scene, or None without grasps.

        Raises:
            BurgError: the scene cannot be judged.
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
            require_sound(scene, request)
        given = request.given_candidates(scene)
        remove_unfinished(ensure_writable_folder(work.folder))
        with Journal(work.folder / JOURNAL_FILE):
            open_run(work.folder, scene, request, given)
        return scene


@dataclass(frozen=True)
class SceneOutputs:
    """Outputs to write for each scene.

    Attributes:
        campaign: the run over many scenes.
        table: format of the tables.
        reports: whether each scene gets a report.
    """

    campaign: Campaign
    table: TableFormat
    reports: bool


class SceneResultsWriter:
    """Writes tables, reports and parts of scenes."""

    def __init__(self, outputs: SceneOutputs) -> None:
        self._outputs = outputs
        self._writer: PartWriter | None = None

    def __call__(self, work: FinishTask | None) -> None:
        """Writes the outputs of a scene, or closes the parts if None.

        Raises:
            BurgError: a file cannot be written.
        """
        if work is None:
            self.writer.add_new_rows()
            self.writer.close()
            return
        run = load_run(self._outputs.campaign.folder(work.name))
        if work.judged:
            run = finish_run(run, self._outputs.table, report=self._outputs.reports)
        self.writer.add_rows(work.name, run)

    @property
    def writer(self) -> PartWriter:
        """Writer of the parts, opened on first use as it reads all parts."""
        if self._writer is None:
            self._writer = PartWriter(self._outputs.campaign)
        return self._writer


def preparer_count(workers: int, engine: Engine) -> int:
    """Number of processes that prepare scenes for so many workers that judge."""
    # One for 16 workers, as sampling takes about a thirtieth of the time of the trials; but longer
    # than trials on a card. At least one, as a cluster may have no workers yet; no more than this
    # machine has processors, as a cluster may have many.
    return max(1, min(default_workers(), -(-workers // (2 if engine.parallel else 16))))


def prepare_ahead(
    pool: WorkerPool, request: RunRequest, work: Iterable[PrepareTask]
) -> Prefetcher[PrepareTask, Scene | None]:
    """Prepares runs of scenes ahead of their use, in the given order; see `Preparer`."""
    session = Session("prepare", partial(Preparer, request))
    return Prefetcher(pool, work, lambda item: Task(Preparer.__call__, (item,), session=session))


class SceneProcesses:
    """Processes that prepare scenes and write their outputs; a context that ends them."""

    def __init__(self, request: RunRequest, outputs: SceneOutputs, workers: int) -> None:
        """Sets up the pools; processes start when there is work.

        Args:
            request: the request for all scenes.
            outputs: outputs to write for each scene.
            workers: number of workers that judge.
        """
        self._pools: list[WorkerPool] = []
        count = preparer_count(workers, request.engine)
        self._request, self._preparers = request, self._add_pool(count)
        self._finisher = self._add_pool(1)
        self._finishing: deque[tuple[FinishTask | None, WorkerFuture[None]]] = deque()
        self._session = Session("finish", partial(SceneResultsWriter, outputs))
        self._local_writer = SceneResultsWriter(outputs)
        self._used = False
        self._failed: list[FinishTask | None] = []

    def prepare(self, work: Iterable[PrepareTask]) -> None:
        """Starts preparing scenes, in the given order."""
        self._prefetcher = prepare_ahead(self._preparers, self._request, work)

    def ready(self) -> bool:
        """Whether `next_prepared` returns at once."""
        return self._prefetcher.ready()

    def next_prepared(self) -> tuple[PrepareTask, Scene | BaseException | None] | None:
        """Waits for the next prepared scene; None if there are no more.

        Returns:
            The task, and the scene, an error if it cannot be judged, or None without grasps.
        """
        return self._prefetcher.take()

    def finish(self, name: str) -> None:
        """Starts writing table, report and rows of a judged scene."""
        self._add_task(FinishTask(name))

    def write_rows(self, name: str) -> None:
        """Starts writing the new rows of a scene that is being judged."""
        self._add_task(FinishTask(name, judged=False))

    def close(self) -> None:
        """Waits until all outputs are written.

        Raises:
            BurgError: an output cannot be written.
        """
        if not self._used:
            self._local_writer(None)
            return
        self._submit(None)
        self._collect_finished(wait=True)
        if self._failed:
            for work in (*self._failed, None):
                self._local_writer(work)  # raises if it fails again

    def __enter__(self) -> SceneProcesses:
        return self

    def __exit__(self, *error: object) -> None:
        for pool in self._pools:
            pool.kill_workers()

    def _add_pool(self, workers: int) -> WorkerPool:
        self._pools.append(WorkerPool(workers, retries=0, own_group=True))
        return self._pools[-1]

    def _add_task(self, work: FinishTask) -> None:
        self._used = True
        self._submit(work)
        self._collect_finished(wait=False)

    def _submit(self, work: FinishTask | None) -> None:
        task = Task(SceneResultsWriter.__call__, (work,), session=self._session)
        self._finishing.append((work, self._finisher.submit_task(task)))

    def _collect_finished(self, wait: bool) -> None:
        """Collects failures of finished writing tasks; of all tasks if `wait`."""
        while self._finishing and (wait or self._finishing[0][1].done()):
            work, future = self._finishing.popleft()
            if future.exception() is not None:
                self._failed.append(work)
