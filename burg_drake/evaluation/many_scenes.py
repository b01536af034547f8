"""Judges many scenes with the same workers; prepares the next scenes while one is judged."""

from __future__ import annotations

import hashlib
import time
from collections import Counter
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from burg_drake.core import (
    MAX_NAME_BYTES,
    STARTING_PHASE,
    BurgError,
    FileLimits,
    GraspSet,
    InvalidInputError,
    Listener,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    UnknownNameError,
    Verdict,
    content_hash,
    ensure_writable_folder,
    read_bytes,
    remove_unfinished,
    resolve_reference,
    suggest_names,
)
from burg_drake.evaluation.campaign_folder import (
    CAMPAIGN_LOCK_FILE,
    SCENES_FOLDER,
    Campaign,
    SceneState,
    SceneStates,
    is_campaign,
    load_campaign,
    require_campaign_folder,
    save_campaign,
)
from burg_drake.evaluation.candidates import INSTANCE_COLUMN
from burg_drake.evaluation.executor import Executor, Job, JobFailed
from burg_drake.evaluation.grasp_sets.mistake_search import campaign_hints
from burg_drake.evaluation.journal import WriterLock
from burg_drake.evaluation.report.pages import renew_report
from burg_drake.evaluation.run_document import (
    CampaignDocument,
    SceneEntry,
    add_session,
    begin_session,
    input_reference,
)
from burg_drake.evaluation.run_identity import require_same_run, run_hash
from burg_drake.evaluation.run_preparation import (
    RunRequest,
    given_content,
    given_correction,
    require_scenes_judged,
)
from burg_drake.evaluation.scene_tasks import (
    PrepareTask,
    SceneJudging,
    SceneOutputs,
    SceneProcesses,
    is_finished,
)
from burg_drake.evaluation.table_parts import require_arrow
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Scene, SceneLike, load_scene


@dataclass(frozen=True, eq=False)
class SceneList:
    """Scenes that a call was given.

    Attributes:
        entries: one entry per scene, in order.
        given: loaded scene or its file, by the name of the entry.
        libraries: hash of all objects of each library, by folder.
    """

    entries: tuple[SceneEntry, ...]
    given: Mapping[str, Scene | Path]
    libraries: dict[str, str]


def read_scenes(
    references: Sequence[SceneLike], known: CampaignDocument | None = None
) -> SceneList:
    """Reads and checks all scenes before any is judged.

    Args:
        references: loaded scenes, or references for `load_scene`.
        known: document of an earlier run; scene files that have not changed since are not read
            again.

    Raises:
        InvalidInputError: there are no scenes, two are the same, or some cannot be read; the
            message names them.
    """
    max_problems = 5  # Scenes that cannot be read are named up to this number.
    if not references:
        raise InvalidInputError("no scenes are given; give one or more")
    reader = _SceneReader(known)
    entries: list[SceneEntry] = []
    given: list[Scene | Path] = []
    problems: list[str] = []
    for reference in references:
        try:
            scene = (
                reference
                if isinstance(reference, Scene)
                else resolve_reference(reference, "scenes")
            )
            entries.append(reader.read_entry(scene))
            given.append(scene)
        except BurgError as error:
            problems.append(str(error))
    if problems:
        more = f"; and {len(problems) - max_problems} more" if len(problems) > max_problems else ""
        raise InvalidInputError(
            f"{len(problems)} of {len(references)} scenes cannot be read:"
            f" {'; '.join(problems[:max_problems])}{more}"
            if len(references) > 1
            else problems[0]
        )
    _refuse_repeated(entries)
    named = _rename_distinctly(entries)
    names = [entry.name for entry in named]
    return SceneList(tuple(named), dict(zip(names, given, strict=True)), reader.hashes)


def require_used_names(entries: Iterable[SceneEntry], request: RunRequest) -> None:
    """Refuses names and grasps that belong to none of the scenes.

    Raises:
        UnknownNameError: an object or instance is in no scene.
    """
    entries = list(entries)
    known = {n for entry in entries for pair in entry.instances.items() for n in pair}
    grasps = request.grasps
    wanted = {"only": list(request.only)}
    if isinstance(grasps, GraspSet):
        by = grasps.columns.get(INSTANCE_COLUMN, grasps.object)
        wanted["grasps"] = [name for name in dict.fromkeys(by.tolist()) if name]
    elif isinstance(grasps, Mapping):
        wanted["grasps"] = list(grasps)
    for what, names in wanted.items():
        for name in names:
            if name not in known:
                raise UnknownNameError(
                    f"{what}: none of {len(entries)} scenes has {name!r};"
                    f" {suggest_names(name, known)}"
                )


class _SceneReader:
    """Reads scenes; loads each library only once."""

    def __init__(self, known: CampaignDocument | None) -> None:
        self._known = {} if known is None else {(e.path, e.file): e for e in known.scenes}
        self._known_libraries = {} if known is None else known.libraries
        self._libraries: dict[tuple[str, Path | None], ObjectLibrary] = {}
        self.hashes: dict[str, str] = {}

    def read_entry(self, scene: Scene | Path) -> SceneEntry:
        """Entry of a scene, under its own name."""
        if isinstance(scene, Scene):
            return self._make_entry(scene, "")
        path = input_reference(scene, "scenes")
        file = hashlib.sha256(read_bytes(scene, FileLimits.document.size)).hexdigest()
        known = self._known.get((path, file))
        if known is not None and self._is_unchanged(known.library):
            return known
        return self._make_entry(load_scene(scene, library=self.library), file)

    def library(self, reference: str, base: Path | None) -> ObjectLibrary:
        """A library, loaded once."""
        if (reference, base) not in self._libraries:
            self._libraries[reference, base] = load_library(reference, base)
        return self._libraries[reference, base]

    def _make_entry(self, scene: Scene, file: str) -> SceneEntry:
        root = str(scene.library.root.resolve())
        if root not in self.hashes:
            self.hashes[root] = content_hash(scene.library.content)
        return SceneEntry(
            name=scene.name,
            path=input_reference(scene.path, "scenes"),
            content=scene.content,
            file=file,
            library=root,
            instances={name: i.object for name, i in scene.instances.items()},
        )

    def _is_unchanged(self, root: str) -> bool:
        if root not in self.hashes:
            try:
                self.hashes[root] = content_hash(self.library(root, None).content)
            except BurgError:
                return False
        return self._known_libraries.get(root) == self.hashes[root]


def _refuse_repeated(entries: Sequence[SceneEntry]) -> None:
    """Refuses a scene that is given twice, as its grasps would count twice."""
    seen: dict[str, SceneEntry] = {}
    for entry in entries:
        first = seen.setdefault(entry.content, entry)
        if first is not entry:
            raise InvalidInputError(
                f"{first.path} and {entry.path} are the same scene; give it once"
                if first.path != entry.path
                else f"{entry.path} is given twice; give it once"
            )


def _rename_distinctly(entries: Sequence[SceneEntry]) -> list[SceneEntry]:
    """Makes the names of entries unique, ignoring case; the second scene of a name gets `_2`."""
    counts = Counter(entry.name.casefold() for entry in entries)
    taken = {name for name, count in counts.items() if count == 1}
    found = []
    for entry in entries:
        name, number = entry.name, 1
        while counts[entry.name.casefold()] > 1 and name.casefold() in taken:
            number += 1
            name = f"{entry.name[: MAX_NAME_BYTES - 8]}_{number}"
        taken.add(name.casefold())
        found.append(replace(entry, name=name))
    return found


def evaluate_scenes(
    references: Sequence[SceneLike],
    request: RunRequest,
    folder: Path,
    executor: Executor,
    progress: bool | Listener,
) -> Campaign:
    """Judges grasps of many scenes; see `evaluate`.

    Args:
        references: the scenes.
        request: the request for each scene.
        folder: folder of the run.
        executor: judges the grasps.
        progress: see `evaluate`.
    """
    require_arrow("a run over many scenes")
    require_campaign_folder(folder)
    before = load_campaign(folder) if is_campaign(folder) else None
    scenes = read_scenes(references, None if before is None else before.document)
    require_used_names(scenes.entries, request)
    document = campaign_document(scenes, request)
    if before is not None:
        require_same_run(folder, before.document, document)
    ensure_writable_folder(folder)
    with Reporter(progress) as reporter, WriterLock(folder / CAMPAIGN_LOCK_FILE):
        remove_unfinished(folder)
        if is_campaign(folder):  # read again, now that no other process can write it
            there = load_campaign(folder).document
            require_same_run(folder, there, document)
            document = replace(
                there, table=document.table, scenes=document.scenes, libraries=document.libraries
            )
        campaign = Campaign(folder, document)
        if before is None or document != before.document:
            save_campaign(campaign)
        call = _CampaignCall(campaign, scenes, request, executor, reporter)
        campaign = call.run()
        if call.judged:
            document = replace(campaign.document, hints=campaign_hints(campaign))
            campaign = save_campaign(replace(campaign, document=document))
        renew_report(campaign)
        require_scenes_judged(campaign)
        return campaign


def campaign_document(scenes: SceneList, request: RunRequest) -> CampaignDocument:
    """Document of a new run over many scenes."""
    arm = request.station.document.arm if request.mode != "hand" else None
    document = CampaignDocument(
        **request.document_fields(),
        grasps=replace(
            request.describe_all_grasps(),
            content=given_content(request.grasps),
            correction=given_correction(request.grasps),
        ),
        joints=0 if arm is None else len(arm.home),
        scenes=scenes.entries,
        libraries=scenes.libraries,
    )
    return replace(document, hash=run_hash(document))


@dataclass
class _CampaignCall:
    """One call of `evaluate` on many scenes."""

    campaign: Campaign
    scenes: SceneList
    request: RunRequest
    executor: Executor
    reporter: Reporter

    def __post_init__(self) -> None:
        self.folder = self.campaign.path
        self.scene_states = SceneStates(self.folder)
        self.judging: dict[str, SceneJudging] = {}
        # a shard of the grasps of each scene, not a shard of the scenes
        self.scene_request = replace(self.request, shard=self.campaign.document.shard_of_grasps)
        self.judged: Counter[str] = Counter()  # By `Verdict.device`.
        asked = self.request.settings.scene_reports
        self.reports = self.campaign.document.writes_scene_reports if asked is None else asked

    def run(self) -> Campaign:
        """Judges all unfinished scenes; returns the updated run."""
        left = [name for name in self.campaign.names if not self._is_done(name)]
        campaign = Campaign(self.folder, self.campaign.document)
        outputs = SceneOutputs(campaign, self.request.settings.table, self.reports)
        with SceneProcesses(self.scene_request, outputs, self.executor.workers) as processes:
            if left:
                self._judge_scenes(left, processes)
            processes.close()
        return load_campaign(self.folder)

    def _judge_scenes(self, left: list[str], processes: SceneProcesses) -> None:
        document = self.campaign.document
        self.expected = self.campaign.expected_by_scene
        done = sum(n for name, n in self.expected.items() if name not in left)
        known = self._known_outcomes()
        event = Progress(STARTING_PHASE, done, sum(self.expected.values()), outcomes=known)
        self.meter = ProgressMeter(self.reporter.show, event, "judging")
        device = self.request.device_text()
        session = begin_session(self.executor.workers, known.total(), device)
        save_campaign(Campaign(self.folder, add_session(document, session)))
        begun = time.monotonic()
        try:
            jobs = cast(Iterable[Job], self._jobs(left, processes))  # also yields None, see `judge`
            with closing(self.executor.judge(jobs, self._note_failed_job)) as answers:
                for job, candidate, verdict in answers:
                    self._take_verdict(job, candidate.id, verdict, processes)
        finally:
            for judging in list(self.judging.values()):
                judging.close()
            session = session.finish(self.judged, begun)
            save_campaign(Campaign(self.folder, add_session(document, session)))

    def _jobs(
        self, left: list[str], processes: SceneProcesses
    ) -> Generator[Job | None, None, None]:
        """Yields the jobs of prepared scenes.

        Yields None while the next scene is not ready and workers have others to judge.
        """
        processes.prepare(
            PrepareTask(name, self.campaign.folder(name), self.scenes.given[name]) for name in left
        )
        while True:
            if self.judging and not processes.ready():
                yield None
                continue
            prepared = processes.next_prepared()
            if prepared is None:
                return
            job = self._begin_scene(*prepared, processes)
            if job is not None:
                yield job

    def _begin_scene(
        self, item: PrepareTask, scene: Scene | BaseException | None, processes: SceneProcesses
    ) -> Job | None:
        """Records that a scene is prepared; returns its job, or None if no grasps are open."""
        if scene is None:
            self.scene_states.note(SceneState(scene=item.name, state="empty"))
            self._set_expected(item.name, 0)
            return None
        if isinstance(scene, BaseException):
            self._note_failure(item.name, scene)
            return None
        judging = SceneJudging(item.name, item.folder, self.scene_request, self.executor.workers)
        self.scene_states.note(judging.state("open"))
        if not judging.left:
            self._finish_scene(judging, processes)
            return None
        judging.begin()
        self._set_expected(item.name, judging.assigned_count)
        self.judging[item.name] = judging
        if judging.known_count:
            self.meter.skip(judging.known_count, note=self._progress_note())
        return Job(item.name, self.request.judge_factory(scene), judging.left)

    def _take_verdict(self, job: Job, id: str, verdict: Verdict, processes: SceneProcesses) -> None:
        judging = self.judging[job.key]
        judging.add_verdict(id, verdict)
        self.judged[verdict.device] += 1
        self.meter.step(outcome=verdict.outcome, note=self._progress_note())
        if judging.is_done:
            del self.judging[job.key]
            self._finish_scene(judging, processes)
        elif judging.is_part_due():
            processes.write_rows(job.key)

    def _note_failed_job(self, failed: JobFailed) -> None:
        """Records a scene whose job failed, such as one whose judge cannot be built."""
        self.judging.pop(failed.job.key).close()
        self._note_failure(failed.job.key, failed.error)

    def _finish_scene(self, judging: SceneJudging, processes: SceneProcesses) -> None:
        self.scene_states.note(judging.state("done"))
        processes.finish(judging.name)

    def _note_failure(self, name: str, error: BaseException) -> None:
        why = str(error) if isinstance(error, BurgError) else f"{type(error).__name__}: {error}"
        self.scene_states.note(SceneState(scene=name, state="failed", why=why))
        self._set_expected(name, 0)

    def _known_outcomes(self) -> Counter[Outcome]:
        """Number of grasps that were judged before, by outcome."""
        if not (self.folder / SCENES_FOLDER).exists():
            return Counter()
        codes, texts = self.campaign.rows(["outcome"]).codes("outcome")
        counts = np.bincount(codes, minlength=len(texts)).tolist()
        return Counter({Outcome(text): n for text, n in zip(texts, counts, strict=True)})

    def _set_expected(self, name: str, grasps: int) -> None:
        self.expected[name] = grasps
        self.meter.expect(sum(self.expected.values()))

    def _progress_note(self) -> str:
        done = sum(s.state != "open" for s in self.scene_states.states.values())
        return f"{done:,} of {len(self.campaign.names):,} scenes"

    def _is_done(self, name: str) -> bool:
        """Whether a scene is finished, from its recorded state and its files."""
        state = self.scene_states.states.get(name)
        if state is None or state.state != "done" or state.interrupted:
            return False
        if self.request.retry_failed and state.failed:
            return False
        folder = self.campaign.folder(name)
        return is_finished(folder, state.size, self.request.settings.table, report=self.reports)
