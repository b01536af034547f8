"""Judges contested grasps of a run again with another engine, whose verdicts replace the old."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TypeVar, overload

from burg_drake.core import (
    STARTING_PHASE,
    InvalidInputError,
    Listener,
    Mode,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    UnknownNameError,
    Verdict,
    list_names,
    software_versions,
    suggest_names,
)
from burg_drake.evaluation.campaign_folder import (
    CAMPAIGN_LOCK_FILE,
    Campaign,
    SceneStates,
    load_campaign,
    open_results,
    save_campaign,
)
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.executor import Executor, Job, LocalExecutor
from burg_drake.evaluation.journal import JOURNAL_FILE, Journal, WriterLock
from burg_drake.evaluation.judge import (
    StationJudgeFactory,
    require_device,
    require_engine_for,
    require_scene_for,
)
from burg_drake.evaluation.part_store import keep_parts, update_parts
from burg_drake.evaluation.report.pages import renew_report
from burg_drake.evaluation.run_document import (
    OneRunDocument,
    WorkSession,
    add_session,
    begin_session,
    origin_of,
)
from burg_drake.evaluation.run_folder import REPORT_FILE, Run, load_run, save_run
from burg_drake.evaluation.run_preparation import finish_run
from burg_drake.evaluation.run_summary import summarize
from burg_drake.evaluation.scene_tasks import is_finished
from burg_drake.evaluation.trial_origin import protocol_of
from burg_drake.station import ENGINES, Engine

OneRun = TypeVar("OneRun", Run, Campaign)


@overload
def judge_again(
    run: OneRun,
    *,
    engine: str = ...,
    executor: Executor | None = ...,
    workers: int | None = ...,
    progress: bool | Listener = ...,
) -> OneRun: ...


@overload
def judge_again(
    run: str | Path,
    *,
    engine: str = ...,
    executor: Executor | None = ...,
    workers: int | None = ...,
    progress: bool | Listener = ...,
) -> Run | Campaign: ...


def judge_again(
    run: Run | Campaign | str | Path,
    *,
    engine: str = "reference",
    executor: Executor | None = None,
    workers: int | None = None,
    progress: bool | Listener = True,
) -> Run | Campaign:
    """Executes the contested grasps of a run with another engine, which settles their verdicts.

    The new verdict replaces the old one in the table and in all counts; the columns `judged_again`
    and `outcome_before` record this. Results of the stages before the trial are kept. A grasp that
    was judged again no longer counts as contested. The same call continues an interrupted one.

    Example::

        run = burg.runs.judge_again("runs/first", engine="reference")
        changed = run.results["outcome"] != run.results["outcome_before"]

    Args:
        run: a complete run of one scene or of many, or its folder. Scenes of a run over many that
            could not be judged are left out.
        engine: name of a preset other than the run's.
        executor: executor that judges, instead of `workers` processes of this machine.
        workers: number of processes; one per processor if None.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Returns:
        The run with the new verdicts. Grasps that the engine cannot simulate keep their old one.

    Raises:
        InvalidInputError: the run is not complete, its objects were shaken, the engine is the run's
            own or does not support the arm or an object, documents have changed since the run, or
            another process is writing the folder.
        UnknownNameError: there is no such engine.
        MissingDependencyError: the engine is not installed.
        SimulationError: the worker processes die.
    """
    found = run if isinstance(run, (Run, Campaign)) else open_results(run)
    require_second_engine(engine, found.document.engine, found.document.mode)
    if protocol_of(found.document.trial) == "shake":
        raise InvalidInputError(
            f"{found.path}: its objects were shaken, and the verdicts of such trials have no"
            " confidence, so that none is contested"
        )
    if found.document.shard:
        raise InvalidInputError(
            f"{found.path} is shard {found.document.shard} of a run; merge the shards first"
        )
    _require_complete(found)
    if executor is None:
        executor = LocalExecutor.of_this_machine(workers)
        require_device(ENGINES[engine], None)
    with Reporter(progress) as reporter:
        if isinstance(found, Campaign):
            return _judge_scenes(found, engine, executor, reporter)
        settled: list[Run] = []
        _judge_contested([found], len(found.contested), engine, executor, reporter, settled.append)
        (judged,) = settled
        judged = finish_run(judged, judged.document.table)
        keep_parts(judged)
        return judged


def _require_complete(found: Run | Campaign) -> None:
    """Refuses a run with open grasps, or with open scenes.

    Raises:
        InvalidInputError: the run has open grasps or scenes.
    """
    if isinstance(found, Run):
        complete, which = found.complete, ""
    else:
        left = found.open_scenes
        complete, which = not left, f" ({list_names(left)})"
    if not complete:
        raise InvalidInputError(
            f"{found.path} is not complete{which}; finish it first with the command that"
            f" began it: {found.document.command}"
        )


def require_second_engine(engine: str, first: Engine, mode: Mode) -> None:
    """Refuses an engine that is not independent of the run's engine or finer than it.

    Args:
        engine: name of a preset.
        first: engine of the run.
        mode: mode of the run.

    Raises:
        UnknownNameError: there is no such preset.
        InvalidInputError: the engine is the first one, has the same simulator with longer steps, or
            cannot run trials of the mode.
        MissingDependencyError: the engine is not installed.
    """
    if engine not in ENGINES:
        raise UnknownNameError(
            f"engine {engine!r} does not exist; {suggest_names(engine, ENGINES)}"
        )
    second = ENGINES[engine]
    others = ", ".join(name for name, one in ENGINES.items() if _is_finer(one, first))
    if not _is_finer(second, first):
        why = "takes longer steps than the one"
        if second.serial == first.serial:
            why = "is the one" if second == first else "has the physics of the one"
        raise InvalidInputError(
            f"engine {engine!r} {why} that has judged all grasps, {first.name!r}; give one of"
            f" {others}"
        ).about("engine")
    require_engine_for(second, mode)


def _is_finer(second: Engine, first: Engine) -> bool:
    return second.simulator != first.simulator or second.time_step < first.time_step


def _judge_scenes(
    campaign: Campaign, engine: str, executor: Executor, reporter: Reporter
) -> Campaign:
    """Judges the contested grasps of each scene again, and updates tables, reports and parts."""
    with WriterLock(campaign.path / CAMPAIGN_LOCK_FILE):
        document, scene_states = campaign.document, SceneStates(campaign.path)
        done = {name for name, state in scene_states.states.items() if state.state == "done"}
        contested = {g.name: g.contested for g in summarize(campaign).scenes if g.name in done}
        reports = {name: (campaign.folder(name) / REPORT_FILE).exists() for name in contested}
        folders = {name: campaign.folder(name) for name in contested}

        def is_settled(name: str) -> bool:
            size, table = scene_states.states[name].size, document.table
            return is_finished(folders[name], size, table, report=reports[name])

        names = [name for name, n in contested.items() if n or not is_settled(name)]

        def finish(run: Run) -> None:
            name = run.path.name
            finish_run(run, document.table, report=reports[name])
            size = (run.path / JOURNAL_FILE).stat().st_size
            scene_states.note(replace(scene_states.states[name], size=size))

        runs = (load_run(campaign.folder(name)) for name in names)
        session, begun = begin_session(executor.workers, sum(contested.values())), time.monotonic()
        judged = _judge_contested(runs, sum(contested.values()), engine, executor, reporter, finish)
        if judged.total():
            document = _add_second_session(document, session.finish(judged, begun), engine)
            save_campaign(Campaign(campaign.path, document))
        update_parts(campaign)
        campaign = load_campaign(campaign.path)
        renew_report(campaign)
        return campaign


def _judge_contested(
    runs: Iterable[Run],
    count: int,
    engine: str,
    executor: Executor,
    reporter: Reporter,
    finish: Callable[[Run], None],
) -> Counter[str]:
    """Judges the contested grasps of runs again; returns the number of new verdicts by their
    `device`.

    Args:
        runs: the runs, opened when workers run out of work.
        count: number of contested grasps, for the progress.
        engine, executor, reporter: see `judge_again`.
        finish: called once for each run, when all of its verdicts are written.
    """
    opened: dict[str, _ContestedRun] = {}
    meter = ProgressMeter(reporter.show, Progress(STARTING_PHASE, 0, count), "judging again")
    judged: Counter[str] = Counter()

    def jobs() -> Iterator[Job]:
        for run in runs:
            settling = _ContestedRun(run, engine, executor.workers)
            if settling.left:
                opened[str(run.path)] = settling
                yield settling.job
            else:
                finish(settling.close())

    try:
        with closing(executor.judge(jobs())) as verdicts:
            for job, candidate, verdict in verdicts:
                settling = opened[job.key]
                judged[verdict.device] += settling.write_verdict(candidate, verdict)
                meter.step(outcome=verdict.outcome)
                if not settling.open:
                    finish(opened.pop(job.key).close())
    finally:
        for settling in opened.values():
            settling.close()
    return judged


class _ContestedRun:
    """A run whose contested grasps are being judged again.

    Attributes:
        left: grasps that are judged again.
        open: number of grasps in `left` without a new verdict so far.
    """

    def __init__(self, run: Run, engine: str, workers: int) -> None:
        """Opens the journal.

        Raises:
            InvalidInputError: another process is writing it, or the engine does not support an
                object.
        """
        self._journal = Journal(run.path / JOURNAL_FILE)
        self._run, self._engine = run, engine
        self.left = [run.trial(id).candidate for id in run.contested]
        self.open = len(self.left)
        self._session, self._begun = begin_session(workers, run.rows().count), time.monotonic()
        self._judged: Counter[str] = Counter()
        if self.left:
            try:
                require_scene_for(ENGINES[engine], run.scene(), run.station())
            except Exception:
                self._journal.close()
                raise

    @property
    def job(self) -> Job:
        """Job with the grasps that are judged again."""
        run = self._run
        mode: Mode = "arm" if run.document.mode == "arm" else "hand"
        settings = origin_of(run.document).settings()
        engine = ENGINES[self._engine]
        factory = StationJudgeFactory(run.scene(), run.station(), engine, mode, settings)
        return Job(str(run.path), factory, self.left)

    def write_verdict(self, candidate: Candidate, verdict: Verdict) -> bool:
        """Writes a new verdict to the journal; returns False if the simulation failed."""
        self.open -= 1
        if verdict.outcome is Outcome.SIMULATION_FAILED:
            return False
        before = self._run.verdicts[candidate.id]
        self._journal.append(candidate.id, settle_verdict(before, verdict, self._engine))
        self._judged[verdict.device] += 1
        return True

    def close(self) -> Run:
        """Records the session in the run's document, and closes the journal."""
        self._journal.close()
        document = self._run.document
        if not self.left:
            return Run(self._run.path, document)
        session = self._session.finish(self._judged, self._begun)
        return save_run(Run(self._run.path, _add_second_session(document, session, self._engine)))


def _add_second_session(
    document: OneRunDocument, session: WorkSession, engine: str
) -> OneRunDocument:
    """Document of a run with one more session and the versions of that session's engine."""
    versions = software_versions(ENGINES[engine].packages) | document.versions
    return replace(add_session(document, session), versions=versions)


def settle_verdict(before: Verdict, verdict: Verdict, engine: str) -> Verdict:
    """Verdict of another engine, with the old verdict's results of the stages before the trial.

    Args:
        before: verdict of the run's own engine.
        verdict: verdict of a trial by another engine.
        engine: name of the other engine.
    """
    cpu = {
        stage: before.cpu.get(stage, 0.0) + verdict.cpu.get(stage, 0.0)
        for stage in {**before.cpu, **verdict.cpu}
    }
    return replace(
        verdict,
        margins={**before.margins, **verdict.margins},
        q_grasp=before.q_grasp,
        q_pregrasp=before.q_pregrasp,
        cpu=cpu,
        judged_again=engine,
        outcome_before=str(before.outcome),
    )
