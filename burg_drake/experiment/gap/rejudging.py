"""Judges real trials again in scenes with objects at their measured poses.

The robot moves to the planned grasp, but the object may stand elsewhere. A verdict that is wrong as
planned and right as measured was wrong because of the placement; the remaining disagreement is
physics. Verdicts are appended to a journal under hashes of all their inputs. A repeated call
continues where the first one stopped, and judges only changed trials again.

rejudged.csv      one row for each trial: planned, as measured, real; rows can be replayed
rejudged.json     the figures
scenes/NNN.yaml   the scene of trial NNN as it was measured
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from burg_drake.core import (
    JUDGING_PACKAGES,
    STARTING_PHASE,
    Listener,
    Outcome,
    Progress,
    ProgressMeter,
    RealOutcome,
    Reporter,
    Verdict,
    atomic_write,
    content_hash,
    ensure_writable_folder,
    one_line,
    remove_unfinished,
    software_versions,
    wilson_interval,
)
from burg_drake.evaluation import (
    HASH_DIGITS,
    JOURNAL_FILE,
    Candidate,
    Columns,
    Executor,
    Job,
    JobFailed,
    Journal,
    LocalExecutor,
    RecordedTrial,
    Run,
    StationJudgeFactory,
    TrialOrigin,
    origin_of,
    read_journal,
    require_engine_for,
    trial_columns,
    write_table,
)
from burg_drake.experiment.comparison.compared_runs import unpredictable_outcomes
from burg_drake.experiment.comparison.confusion_matrix import Paired, compare_paired_counts
from burg_drake.experiment.gap.displaced_scenes import (
    grasps_as_commanded,
    measured_scene,
    save_displaced_scene,
)
from burg_drake.experiment.trials.source_runs import grasp_contents, load_sources
from burg_drake.experiment.trials.trial_sheet import RealTrial, Success, TrialSheet, is_success
from burg_drake.scene import Scene
from burg_drake.station import Station


@dataclass(frozen=True, eq=False)
class _RejudgeTask:
    """A trial to be judged again.

    Attributes:
        trial: the trial.
        factory: builds the judge; None if the scene cannot be built.
        judge_content: hash of all inputs of the judge except the versions of the software.
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

    Mode, engine, motion and settings are those of the trial's run; if another engine judged the
    grasp again in the run, that engine is used. The hand moves to the pose commanded to the robot.
    Objects that were not measured stay as planned. A trial with an impossible scene is not judged,
    and the reason is recorded.

    Args:
        sheet: contents of the trials file.
        path: the trials file, to whose folder paths of runs are relative.
        out: folder for the results; created if necessary.
        runs: runs by key, in place of those in the trials file; trials with a missing key, or with
            a grasp that is missing or different in the run, are skipped.
        success: criterion of success; the criterion in the trials file if None.
        executor: executor; if None as many processes as there are processors.
        retry_failed: repeat simulations that failed in an earlier call.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        InvalidInputError: a run is missing or different; its library or station has changed; or the
            folder cannot be written.
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
    trials = tuple(_with_verdict(task.trial, known, failed) for task in tasks)
    found = Rejudging(
        path=folder, success=success or sheet.selection.success, trials=trials, skipped=skipped
    )
    write_rejudging(found)
    return found


def _skip_reasons(sheet: TrialSheet, runs: Mapping[str, Run]) -> dict[int, str]:
    """Reasons why trials cannot be judged again, by number."""
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

    setups: dict[str, tuple[Scene, Station, SceneCheck]] = {}
    tasks = []
    for trial in trials:
        run = runs[trial.run]
        if trial.run not in setups:
            scene, station = run.scene(), run.station()
            setups[trial.run] = scene, station, SceneCheck(station, scene.library)
        tasks.append(_rejudge_task(trial, run, *setups[trial.run]))
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
    engine = origin.engine.serial
    factory = StationJudgeFactory(measured.scene, station, engine, origin.mode, settings)
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
    """Judges tasks without a known verdict, grouped by scene.

    Args:
        tasks: all tasks.
        known: existing verdicts by id.
        executor: executor of the judgements.
        reporter: reporter of the progress.
        failed: receives reasons by id for trials whose judge cannot be built.

    Yields:
        Ids and verdicts.
    """
    jobs: dict[str, Job] = {}
    total = 0
    for task in tasks:
        if task.factory is None or task.trial.candidate is None:
            continue
        total += 1
        if task.trial.candidate.id not in known:
            key = task.judge_content
            earlier = jobs[key].candidates if key in jobs else ()
            jobs[key] = Job(key, task.factory, (*earlier, task.trial.candidate))
    if not jobs:
        return
    todo = sum(len(job.candidates) for job in jobs.values())
    begin = Progress(STARTING_PHASE, total - todo, total, unit="trials")
    pace = ProgressMeter(reporter.show, begin, "judging again")

    def note_failure(event: JobFailed) -> None:
        failed.update({c.id: one_line(event.error) for c in event.job.candidates})

    with closing(executor.judge(jobs.values(), note_failure)) as judged:
        for _, candidate, verdict in judged:
            pace.step(outcome=verdict.outcome)
            yield candidate.id, verdict


if TYPE_CHECKING:
    from burg_drake.station import SceneCheck


TrialCause = Literal["agreed", "placement", "worsened", "physics", "unpredictable"]
DISAGREEMENT_CAUSES: dict[TrialCause, str] = {
    "agreed": "agreed as planned, and as measured",
    "placement": "disagreed as planned, agree as measured: explained by the placement",
    "worsened": "agreed as planned, disagree as measured: worsened",
    "physics": "disagree either way: left to physics",
    "unpredictable": "failed for reasons that a run of the hand alone cannot predict",
}
"""Meaning of each combination of both verdicts and the real outcome."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Rejudged:
    """A real trial, judged again.

    Attributes:
        number: number of the trial.
        run: key of the trial's run in the trials file.
        grasp, instance, object: id of the grasp, names of instance and object.
        real: outcome on the robot.
        planned: outcome in the run.
        origin: settings of the run's judge.
        candidate: the grasp in the frame of the displaced object; None if there is no scene.
        scene: scene as measured; None if it is impossible.
        notes: deviations from the measurements.
        reason: reason why there is no scene; empty if there is one.
        verdict: the new verdict.
    """

    number: int
    run: str
    grasp: str
    instance: str
    object: str
    real: RealOutcome
    planned: Outcome
    origin: TrialOrigin
    candidate: Candidate | None = None
    scene: Scene | None = None
    notes: tuple[str, ...] = ()
    reason: str = ""
    verdict: Verdict | None = None

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the new verdict; None if the trial could not be judged."""
        failed = self.verdict is None or self.verdict.outcome is Outcome.SIMULATION_FAILED
        return None if failed or self.verdict is None else self.verdict.outcome

    @property
    def failure_reason(self) -> str:
        """Reason why the trial could not be judged; empty if it was."""
        if self.outcome is not None:
            return ""
        return self.reason or (self.verdict.reason if self.verdict else "")

    @cached_property
    def unpredictable(self) -> bool:
        """Whether no verdict of the run's mode could predict the real outcome."""
        approach = self.origin.settings().approach
        return self.real in unpredictable_outcomes(self.origin.mode, approach=approach)

    def is_right(self, success: Success, *, measured: bool) -> bool:
        """Whether the verdict as planned, or as measured, agrees with the robot."""
        verdict = self.outcome if measured else self.planned
        return verdict is not None and is_success(verdict, success) is is_success(
            self.real, success
        )

    def cause(self, success: Success) -> TrialCause | None:
        """Meaning of the two verdicts and the real outcome; None if either verdict is missing."""
        if self.outcome is None or self.planned is Outcome.SIMULATION_FAILED:
            return None
        if self.unpredictable:
            return "unpredictable"
        planned, measured = (self.is_right(success, measured=m) for m in (False, True))
        if planned:
            return "agreed" if measured else "worsened"
        return "placement" if measured else "physics"


@dataclass(frozen=True, eq=False, kw_only=True)
class Rejudging:
    """The trials of a file, judged again.

    Attributes:
        path: folder with the results.
        success: criterion of success.
        trials: trials with an outcome and a placement.
        skipped: reasons why the other trials were not judged again, by number.
    """

    path: Path
    success: Success
    trials: tuple[Rejudged, ...]
    skipped: dict[int, str]

    @cached_property
    def judged(self) -> tuple[Rejudged, ...]:
        """Trials with verdicts as planned and as measured."""
        return tuple(t for t in self.trials if t.cause(self.success) is not None)

    @cached_property
    def causes(self) -> Counter[TrialCause]:
        """Number of trials by cause."""
        found: Counter[TrialCause] = Counter(dict.fromkeys(DISAGREEMENT_CAUSES, 0))
        found.update(c for t in self.judged if (c := t.cause(self.success)) is not None)
        return found

    @cached_property
    def table(self) -> Counter[tuple[bool, bool, bool]]:
        """Number of trials by success as planned, as measured, and in reality."""
        return Counter(
            (
                is_success(t.planned, self.success),
                t.outcome is not None and is_success(t.outcome, self.success),
                is_success(t.real, self.success),
            )
            for t in self.judged
        )

    @cached_property
    def predictable(self) -> tuple[Rejudged, ...]:
        """Judged trials whose outcome a verdict can predict."""
        return tuple(t for t in self.judged if not t.unpredictable)

    def agreement(self, *, measured: bool, every: bool = False) -> tuple[int, float, float]:
        """Number of trials that agree with reality, as planned or as measured, and Wilson's 95 %
        interval of their share.

        Args:
            measured: use the verdicts as measured instead of as planned.
            every: count all trials instead of the predictable ones.
        """
        trials = self.judged if every else self.predictable
        count = sum(trial.is_right(self.success, measured=measured) for trial in trials)
        return count, *wilson_interval(count, len(trials))

    def precision(self, *, measured: bool, every: bool = False) -> tuple[int, int]:
        """Number of predicted successes that succeeded, and number of predicted successes;
        arguments as for `agreement`.
        """
        predicted = [
            trial
            for trial in (self.judged if every else self.predictable)
            if (verdict := trial.outcome if measured else trial.planned) is not None
            and is_success(verdict, self.success)
        ]
        return sum(is_success(trial.real, self.success) for trial in predicted), len(predicted)

    @property
    def explained_disagreements(self) -> tuple[int, int, float, float]:
        """Number of trials that disagree as planned and agree as measured, number that disagree as
        planned, and Wilson's 95 % interval of the share.
        """
        count = self.causes["placement"]
        whole = count + self.causes["physics"]
        return count, whole, *wilson_interval(count, whole)

    @cached_property
    def mcnemar_test(self) -> Paired:
        """McNemar's exact test of agreement with reality: verdicts as measured (first) against
        verdicts as planned.
        """
        causes: tuple[TrialCause, ...] = ("agreed", "placement", "worsened", "physics")
        return compare_paired_counts(*(self.causes[cause] for cause in causes))


def skip_reason(trial: RealTrial, run: Run | None, content: str | None) -> str:
    """Reason why a trial cannot be judged again in a run; empty if it can.

    Args:
        trial: the trial.
        run: run for the trial; None if there is none.
        content: content hash of the run's grasp with this id; None if there is none.
    """
    if trial.outcome is None:
        return "not carried out yet"
    if not trial.outcome.attempted:
        return trial.outcome.value.replace("_", " ")
    if not any(place.status == "measured" and place.X_SO for place in trial.placement.values()):
        return "placement not measured"
    if run is None:
        return "of another scene"
    if content is None:
        return "grasp not in the run"
    return "" if content == trial.content else "another grasp of this id in the run"


def match_runs_to_sources(sheet: TrialSheet, runs: Sequence[Run]) -> dict[str, Run]:
    """Replacement for each run of a trials file: the run itself, or else the run of the same scene
    that has most of the tried grasps.

    Args:
        sheet: contents of the trials file.
        runs: the runs in a folder.
    """
    found = {}
    for key, source in sheet.runs.items():
        same = [run for run in runs if run.document.scene.content == source.scene.content]
        if same:
            tried = {t.grasp: t.content for t in sheet.trials if t.run == key}
            found[key] = max(same, key=partial(_match_rank, hash=source.hash, tried=tried))
    return found


def _match_rank(run: Run, hash: str, tried: Mapping[str, str]) -> tuple[bool, int]:
    return run.document.hash == hash, len(grasp_contents(run, tried).items() & tried.items())


REJUDGED_TABLE_FILE = "rejudged.csv"  # Table of the trials that were judged again.


def rejudged_scene_file(trial: Rejudged, folder: Path) -> Path:
    """Path of the scene file of a trial."""
    return folder / "scenes" / f"{trial.number:03d}.yaml"


def write_rejudging(rejudging: Rejudging) -> None:
    """Writes scenes, table and figures.

    Raises:
        InvalidInputError: a file cannot be written.
    """
    for trial in rejudging.trials:
        if trial.scene is not None:
            save_displaced_scene(trial.scene, rejudged_scene_file(trial, rejudging.path))
    rows = [
        row for trial in rejudging.trials if (row := _trial_columns(trial, rejudging)) is not None
    ]
    if rows:
        write_table(rejudging.path / REJUDGED_TABLE_FILE, concatenate_tables(rows))
    atomic_write(
        rejudging.path / "rejudged.json", json.dumps(rejudging_json(rejudging), indent=1) + "\n"
    )


def _trial_columns(trial: Rejudged, rejudging: Rejudging) -> Columns | None:
    """Table row of one trial; None for a trial without a verdict."""
    if trial.scene is None or trial.candidate is None or trial.verdict is None:
        return None
    origin = replace(
        trial.origin,
        scene=str(rejudged_scene_file(trial, rejudging.path)),
        scene_content=trial.scene.content[:HASH_DIGITS],
        run="",
    )
    one = RecordedTrial(
        id=trial.grasp,
        instance=trial.instance,
        object=trial.object,
        X_OG=trial.candidate.X_OG,
        width=trial.candidate.width,
        friction=trial.candidate.friction,
        verdict=trial.verdict,
    )
    joints = len(trial.verdict.q_grasp)
    columns = trial_columns([one], origin, instances=list(trial.scene.instances), joints=joints)
    values = {
        "trial": trial.number,
        "real": trial.real.value,
        "planned": trial.planned.value,
        "cause": trial.cause(rejudging.success) or "",
        "notes": "; ".join(trial.notes),
    }
    return {name: np.array([value]) for name, value in values.items()} | columns


def concatenate_tables(tables: list[Columns]) -> Columns:
    """Concatenates tables; missing columns are filled with NaN or empty texts."""
    names = dict.fromkeys(name for table in tables for name in table)
    kinds = {n: next(t[n].dtype.kind for t in tables if n in t) for n in names}

    def part(table: Columns, name: str) -> Any:
        if name in table:
            return table[name]
        return np.full(len(table["id"]), "" if kinds[name] == "U" else np.nan)

    return {name: np.concatenate([part(table, name) for table in tables]) for name in names}


def rejudging_json(rejudging: Rejudging) -> dict[str, Any]:
    """The figures as JSON values."""
    count = len(rejudging.predictable)
    return {
        "success": rejudging.success,
        "judged": len(rejudging.judged),
        "unpredictable": rejudging.causes["unpredictable"],
        "agree": {
            name: {"count": right, "of": count, "low": low, "high": high}
            for name, measured in (("planned", False), ("measured", True))
            for right, low, high in [rejudging.agreement(measured=measured)]
        },
        "precision": {
            name: {
                which: dict(zip(("count", "of"), shares, strict=True))
                for which, every in (("all", True), ("predictable", False))
                for shares in [rejudging.precision(measured=measured, every=every)]
            }
            for name, measured in (("planned", False), ("measured", True))
        },
        "causes": {cause: rejudging.causes[cause] for cause in DISAGREEMENT_CAUSES},
        "explained": dict(
            zip(("count", "of", "low", "high"), rejudging.explained_disagreements, strict=True)
        ),
        "mcnemar_p": rejudging.mcnemar_test.p_value,
        "table": [
            {"planned": p, "measured": m, "real": r, "count": n}
            for (p, m, r), n in sorted(rejudging.table.items())
        ],
        "trials": [_trial_json(trial, rejudging) for trial in rejudging.trials],
        "skipped": {str(number): why for number, why in rejudging.skipped.items()},
    }


def _trial_json(trial: Rejudged, rejudging: Rejudging) -> dict[str, Any]:
    return {
        "number": trial.number,
        "run": trial.run,
        "grasp": trial.grasp,
        "object": trial.object,
        "real": trial.real.value,
        "planned": trial.planned.value,
        "measured": None if trial.outcome is None else trial.outcome.value,
        "cause": trial.cause(rejudging.success),
        "why_not": trial.failure_reason,
        "notes": list(trial.notes),
    }
