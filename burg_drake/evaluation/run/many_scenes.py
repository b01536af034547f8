"""Judges many scenes with the same workers: while one is judged, the next ones are prepared.

Each scene is a run in a folder of its own, as `evaluate` of that scene alone makes it. A scene that
cannot be judged is told of at the end, and the others go on.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Generator, Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from burg_drake.core import (
    JUDGING,
    BurgError,
    software_versions,
)
from burg_drake.core.files import remove_unfinished, writable_folder
from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.core.terminal import STARTING, Listener, Progress, ProgressMeter, Reporter
from burg_drake.evaluation.grasp_sets import campaign_hints
from burg_drake.evaluation.records import (
    CampaignDocument,
    Ledger,
    Lock,
    SceneState,
    begun_now,
    campaign_hash,
    input_of,
    require_same_campaign,
)
from burg_drake.evaluation.report import renew_report
from burg_drake.evaluation.run.completeness import require_scenes_judged
from burg_drake.evaluation.run.request import (
    Request,
    command,
    given_content,
    given_correction,
)
from burg_drake.evaluation.run.scene_judging import SceneJudging, is_finished
from burg_drake.evaluation.run.scene_list import Scenes, read_scenes, require_used
from burg_drake.evaluation.run.scene_processes import SceneProcesses
from burg_drake.evaluation.run.scene_tasks import Prepare, Preparer, SceneOutputs
from burg_drake.evaluation.stages import StationJudgeFactory
from burg_drake.evaluation.store import (
    LOCK_FILE,
    SCENES_FOLDER,
    Campaign,
    is_campaign,
    load_campaign,
    require_arrow,
    require_campaign_folder,
    save_campaign,
)
from burg_drake.evaluation.workers import Executor, Job, JobFailed
from burg_drake.scene.document import Scene, SceneLike


def evaluate_scenes(
    references: Sequence[SceneLike],
    request: Request,
    folder: Path,
    executor: Executor,
    progress: bool | Listener,
) -> Campaign:
    """Judges grasps of many scenes; see `evaluate`.

    Args:
        references: the scenes.
        request: what is asked about each.
        folder: of the run.
        executor: who judges.
        progress: see `evaluate`.
    """
    require_arrow("a run over many scenes")
    require_campaign_folder(folder)
    before = load_campaign(folder) if is_campaign(folder) else None
    scenes = read_scenes(references, None if before is None else before.document)
    require_used(scenes.entries, request)
    document = _document(scenes, request)
    if before is not None:
        require_same_campaign(folder, before.document, document)
    writable_folder(folder)
    with Reporter(progress) as reporter, Lock(folder / LOCK_FILE):
        remove_unfinished(folder)
        if is_campaign(folder):  # as it is now that nobody else has it
            there = load_campaign(folder).document
            require_same_campaign(folder, there, document)
            document = replace(
                there, table=document.table, scenes=document.scenes, libraries=document.libraries
            )
        campaign = Campaign(folder, document)
        if before is None or document != before.document:
            save_campaign(campaign)
        call = _Call(campaign, scenes, request, executor, reporter)
        judged = call.run()
        if call.judged:
            hints = campaign_hints(judged)
            judged = save_campaign(replace(judged, document=replace(judged.document, hints=hints)))
        renew_report(judged)
        require_scenes_judged(judged)
        return judged


def _document(scenes: Scenes, request: Request) -> CampaignDocument:
    arm = request.station.document.arm if request.mode != "hand" else None
    document = CampaignDocument(
        command=command(),
        station=input_of(request.station, "stations"),
        grasps=replace(
            request.requested_of_all(),
            content=given_content(request.grasps),
            correction=given_correction(request.grasps),
        ),
        engine=request.engine,
        trial=request.trial,
        mode=request.mode,
        arm=request.arm,
        seed=request.settings.seed,
        shard="" if request.shard is None else str(request.shard),
        table=request.settings.table,
        joints=0 if arm is None else len(arm.home),
        scenes=scenes.entries,
        libraries=scenes.libraries,
        versions=software_versions({**JUDGING, **request.engine.packages}),
    )
    return replace(document, hash=campaign_hash(document))


@dataclass
class _Call:
    """One call of `evaluate` on many scenes."""

    campaign: Campaign
    scenes: Scenes
    request: Request
    executor: Executor
    reporter: Reporter

    def __post_init__(self) -> None:
        self.folder = self.campaign.path
        self.ledger = Ledger(self.folder)
        self.judging: dict[str, SceneJudging] = {}
        # a scene whose grasps are shared out knows its share
        self.each = replace(self.request, shard=self.campaign.document.shard_of_grasps)
        self.judged = 0
        asked = self.request.settings.scene_reports
        self.reports = self.campaign.document.has_few_scenes if asked is None else asked

    def run(self) -> Campaign:
        """Judges what is left."""
        left = [name for name in self.campaign.names if not self._is_done(name)]
        keeping = SceneOutputs(
            self.folder,
            tuple(self.campaign.places),
            self.campaign.document.instances,
            self.request.settings.table,
            self.reports,
        )
        with ExitStack() as stack:
            processes = stack.enter_context(
                SceneProcesses(Preparer(self.each), keeping, self.executor.workers)
            )
            if left:
                self._judge(left, processes)
            processes.close()
        return load_campaign(self.folder)

    def _judge(self, left: list[str], processes: SceneProcesses) -> None:
        document = self.campaign.document
        self.expected = self.campaign.expected_by_scene
        there = sum(n for name, n in self.expected.items() if name not in left)
        found = self._found()
        event = Progress(STARTING, there, sum(self.expected.values()), outcomes=found)
        self.pace = ProgressMeter(self.reporter.show, event, "judging")
        session = begun_now(self.executor.workers, found.total())
        sessions = document.stretches
        save_campaign(
            replace(self.campaign, document=replace(document, stretches=(*sessions, session)))
        )
        begun = time.monotonic()
        try:
            jobs = cast(Iterable[Job], self._jobs(left, processes))  # None only where it is polled
            with closing(self.executor.judge(jobs, self._give_up)) as answers:
                for job, candidate, verdict in answers:
                    self._take(job, candidate.id, verdict, processes)
        finally:
            for judging in list(self.judging.values()):
                judging.close()
            seconds = round(time.monotonic() - begun, 3)
            session = replace(session, judged=self.judged, seconds=seconds)
            save_campaign(
                replace(self.campaign, document=replace(document, stretches=(*sessions, session)))
            )

    def _jobs(
        self, left: list[str], processes: SceneProcesses
    ) -> Generator[Job | None, None, None]:
        """Scenes that are prepared, one after the other; None while workers have others to judge
        and the next one is not ready."""
        processes.prepare(
            Prepare(name, self.campaign.folder(name), self.scenes.given[name]) for name in left
        )
        while True:
            if self.judging and not processes.ready():
                yield None
                continue
            prepared = processes.prepared()
            if prepared is None:
                return
            job = self._begin(*prepared, processes)
            if job is not None:
                yield job

    def _begin(
        self, item: Prepare, scene: Scene | BaseException | None, processes: SceneProcesses
    ) -> Job | None:
        """What is to be judged of a scene that is prepared, if anything."""
        if scene is None:
            self.ledger.note(SceneState(scene=item.name, state="empty"))
            self._expect(item.name, 0)
            return None
        if isinstance(scene, BaseException):
            self._fail(item.name, scene)
            return None
        judging = SceneJudging(item.name, item.folder, self.each, self.executor.workers)
        self.ledger.note(judging.state("open"))
        if not judging.left:
            self._finish(judging, processes)
            return None
        judging.begin()
        self._expect(item.name, judging.mine)
        self.judging[item.name] = judging
        if judging.known:
            self.pace.skip(judging.known, note=self._note())
        request = self.request
        factory = StationJudgeFactory(
            scene, request.station, request.engine, request.mode, request.phases
        )
        return Job(item.name, factory, judging.left)

    def _take(self, job: Job, id: str, verdict: Verdict, processes: SceneProcesses) -> None:
        judging = self.judging[job.key]
        judging.take(id, verdict)
        self.judged += 1
        self.pace.step(outcome=verdict.outcome, note=self._note())
        if judging.is_done:
            del self.judging[job.key]
            self._finish(judging, processes)
        elif judging.is_part_due():
            processes.take(job.key)

    def _give_up(self, failed: JobFailed) -> None:
        """A scene whose judge cannot be built, for example."""
        self.judging.pop(failed.job.key).close()
        self._fail(failed.job.key, failed.error)

    def _finish(self, judging: SceneJudging, processes: SceneProcesses) -> None:
        self.ledger.note(judging.state("done"))
        processes.finish(judging.name)

    def _fail(self, name: str, error: BaseException) -> None:
        why = str(error) if isinstance(error, BurgError) else f"{type(error).__name__}: {error}"
        self.ledger.note(SceneState(scene=name, state="failed", why=why))
        self._expect(name, 0)

    def _found(self) -> Counter[Outcome]:
        """Grasps that were judged before, by outcome."""
        if not (self.folder / SCENES_FOLDER).exists():
            return Counter()
        codes, texts = self.campaign.rows(["outcome"]).codes("outcome")
        counts = np.bincount(codes, minlength=len(texts)).tolist()
        return Counter({Outcome(text): n for text, n in zip(texts, counts, strict=True)})

    def _expect(self, name: str, grasps: int) -> None:
        self.expected[name] = grasps
        self.pace.expect(sum(self.expected.values()))

    def _note(self) -> str:
        done = sum(s.state != "open" for s in self.ledger.states.values())
        return f"{done:,} of {len(self.campaign.names):,} scenes"

    def _is_done(self, name: str) -> bool:
        """Whether nothing is left to do about a scene, from a glance at its folder."""
        state = self.ledger.states.get(name)
        if state is None or state.state != "done" or state.interrupted:
            return False
        if self.request.retry_failed and state.failed:
            return False
        folder = self.campaign.folder(name)
        return is_finished(folder, state.size, self.request.settings.table, report=self.reports)
