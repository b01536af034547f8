"""Judges real trials again in scenes whose objects stand where they were measured.

The robot moves to the planned grasp, but the object may stand elsewhere. A verdict that is wrong
as planned and right as measured was wrong because of the placement; the remaining disagreement is
physics. Verdicts are appended to a journal under names that follow from all of their inputs. A
repeated call continues where the first one stopped, and judges again only what has changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.core import (
    JUDGING_PACKAGES,
    STARTING_PHASE,
    Listener,
    Progress,
    ProgressMeter,
    Reporter,
    Verdict,
    content_hash,
    ensure_writable_folder,
    one_line,
    remove_unfinished,
    software_versions,
)
from burg_drake.evaluation import (
    JOURNAL_FILE,
    Candidate,
    Executor,
    Job,
    JobFailed,
    Journal,
    LocalExecutor,
    Run,
    StationJudgeFactory,
    origin_of,
    read_journal,
    require_engine_for,
)
from burg_drake.experiment.gap.displaced_scenes import (
    grasps_as_commanded,
    measured_scene,
)
from burg_drake.experiment.gap.rejudged_trials import (
    Rejudged,
    Rejudging,
    skip_reason,
    write_rejudging,
)
from burg_drake.experiment.trials.source_runs import grasp_contents, load_sources
from burg_drake.experiment.trials.trial_sheet import RealTrial, Success, TrialSheet
from burg_drake.scene import Scene
from burg_drake.station import Station

if TYPE_CHECKING:
    from burg_drake.station import SceneCheck


@dataclass(frozen=True, eq=False)
class _RejudgeTask:
    """A trial that is to be judged again; without a judge if its scene cannot be built.

    `judge_content` is a hash of all that decides about the verdicts of the judge, but for the
    versions of the software.
    """

    trial: Rejudged
    factory: StationJudgeFactory | None = None
    judge_content: str = ""


def rejudge(
    sheet: TrialSheet,
    path: str | Path,
    out: str | Path,
    *,
    runs: Mapping[str, Run] | None = None,
    success: Success | None = None,
    executor: Executor | None = None,
    retry_failed: bool = False,
    progress: bool | Listener = True,
) -> Rejudging:
    """Judges every real trial with a measured placement again.

    Each is judged as its run was: mode, engine (or the one that judged the grasp again there),
    motion and settings. The hand goes to the place in
    the world to which the robot was sent. Objects that were not measured stay where they were
    planned. A scene that cannot be makes a trial that is not judged, with the reason.

    Args:
        sheet: the trials.
        path: their file, from whose folder the sheet's paths start.
        out: folder for the answers; made if need be.
        runs: by the sheet's keys, in place of its own; trials of keys that are missing, or whose
            grasp is not in the run, or another one there, are skipped.
        success: what counts; as the sheet says if None.
        executor: who judges; as many processes as there are processors if None.
        retry_failed: ask again what an earlier call could not simulate.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        InvalidInputError: a run is gone, or is another one; its library or station has changed; or
            the folder cannot be written.
        MissingDependencyError: an engine is not installed.
    """
    runs = load_sources(sheet, path) if runs is None else runs
    executor = LocalExecutor.of_this_machine() if executor is None else executor
    skipped = _skip_reasons(sheet, runs)
    tasks = _rejudge_tasks([t for t in sheet.trials if t.number not in skipped], runs)
    folder = ensure_writable_folder(out)
    with Reporter(progress) as reporter, Journal(folder / JOURNAL_FILE) as journal:
        remove_unfinished(folder)
        known = {
            id: verdict
            for id, verdict in read_journal(folder / JOURNAL_FILE).items()
            if not verdict.is_open(retry_failed=retry_failed)
        }
        failed: dict[str, str] = {}
        for id, verdict in _judge_tasks(tasks, known, executor, reporter, failed):
            journal.append(id, verdict)
            known[id] = verdict
    trials = tuple(_with_verdict(one.trial, known, failed) for one in tasks)
    found = Rejudging(
        path=folder, success=success or sheet.selection.success, trials=trials, skipped=skipped
    )
    write_rejudging(found)
    return found


def _skip_reasons(sheet: TrialSheet, runs: Mapping[str, Run]) -> dict[int, str]:
    """Why trials cannot be judged again, by number."""
    tried = [trial.grasp for trial in sheet.trials]
    contents = {key: grasp_contents(run, tried) for key, run in runs.items()}
    found = {}
    for trial in sheet.trials:
        content = contents.get(trial.run, {}).get(trial.grasp)
        if why := skip_reason(trial, runs.get(trial.run), content):
            found[trial.number] = why
    return found


def _rejudge_tasks(trials: Sequence[RealTrial], runs: Mapping[str, Run]) -> list[_RejudgeTask]:
    from burg_drake.station import SceneCheck

    places: dict[str, tuple[Scene, Station, SceneCheck]] = {}
    tasks = []
    for trial in trials:
        run = runs[trial.run]
        if trial.run not in places:
            scene, station = run.scene(), run.station()
            places[trial.run] = scene, station, SceneCheck(station, scene.library)
        tasks.append(_rejudge_task(trial, run, *places[trial.run]))
    return tasks


def _rejudge_task(
    real: RealTrial, run: Run, planned: Scene, station: Station, check: SceneCheck
) -> _RejudgeTask:
    assert real.outcome is not None
    grasp, verdict = run.candidate(real.grasp), run.verdicts.get(real.grasp)
    origin = origin_of(run.document).judged_by("" if verdict is None else verdict.judged_again)
    require_engine_for(origin.engine, origin.mode)
    measured = measured_scene(planned, real.placement, check.issues)
    trial = Rejudged(
        number=real.number,
        run=real.run,
        grasp=real.grasp,
        instance=grasp.instance,
        object=planned.instance(grasp.instance).object,
        real=real.outcome,
        planned=real.simulated if verdict is None else verdict.outcome,
        origin=origin,
        scene=measured.scene,
        notes=measured.notes,
        reason=measured.reason,
    )
    if measured.scene is None:
        return _RejudgeTask(trial)
    settings = origin.settings(f"{run.path}: trial")
    factory = StationJudgeFactory(measured.scene, station, origin.engine, origin.mode, settings)
    X_OG = grasps_as_commanded(planned, measured.scene, grasp.instance, grasp.X_OG)
    judge_content = content_hash(
        *(measured.scene.content, station.content, origin.mode),
        *(asdict(origin.engine), asdict(settings)),
    )
    packages = origin.engine.packages
    versions = software_versions({**JUDGING_PACKAGES, **packages})
    key = content_hash(
        *(real.number, judge_content, grasp.instance, X_OG, grasp.width),
        *(versions[name] for name in ("burg_drake", "drake", *packages)),
    )
    id = f"{real.number}:{key[:12]}"
    candidate = Candidate(id, grasp.instance, X_OG, width=grasp.width)
    return _RejudgeTask(replace(trial, candidate=candidate), factory, judge_content)


def _with_verdict(
    trial: Rejudged, known: Mapping[str, Verdict], failed: Mapping[str, str]
) -> Rejudged:
    if trial.candidate is None:
        return trial
    id = trial.candidate.id
    return replace(trial, verdict=known.get(id), reason=failed.get(id, ""))


def _judge_tasks(
    tasks: Sequence[_RejudgeTask],
    known: Mapping[str, Verdict],
    executor: Executor,
    reporter: Reporter,
    failed: dict[str, str],
) -> Iterator[tuple[str, Verdict]]:
    """Asks what is not known yet, trials of one scene together.

    Args:
        tasks, known, executor, reporter: what is asked, and what need not be.
        failed: gets the reason, by id, for trials of scenes that cannot be built.

    Yields:
        Ids and verdicts.
    """
    jobs: dict[str, Job] = {}
    total = 0
    for one in tasks:
        if one.factory is None or one.trial.candidate is None:
            continue
        total += 1
        if one.trial.candidate.id not in known:
            key = one.judge_content
            held = jobs[key].candidates if key in jobs else ()
            jobs[key] = Job(key, one.factory, (*held, one.trial.candidate))
    if not jobs:
        return
    todo = sum(len(job.candidates) for job in jobs.values())
    begin = Progress(STARTING_PHASE, total - todo, total, unit="trials")
    pace = ProgressMeter(reporter.show, begin, "judging again")

    def note(lost: JobFailed) -> None:
        failed.update({c.id: one_line(lost.error) for c in lost.job.candidates})

    with closing(executor.judge(jobs.values(), note)) as judged:
        for _, candidate, verdict in judged:
            pace.step(outcome=verdict.outcome)
            yield candidate.id, verdict
