"""Judges contested grasps of a run again, with another engine, whose verdicts then count."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from burg_drake.core import InvalidInputError, UnknownNameError, nearest, software_versions
from burg_drake.core.grasps import Mode, Outcome, Verdict
from burg_drake.core.terminal import STARTING, Listener, Progress, ProgressMeter, Reporter
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.records import Journal, begun_now, origin_of
from burg_drake.evaluation.run import finish_run
from burg_drake.evaluation.stages import (
    StationJudgeFactory,
    require_engine_for,
    require_scene_for,
)
from burg_drake.evaluation.store import JOURNAL_FILE, Run, keep_parts, load_run, save_run
from burg_drake.evaluation.workers import Executor, Job, LocalExecutor
from burg_drake.station.document import ENGINES, Engine


def judge_again(
    run: Run | str | Path,
    *,
    engine: str = "reference",
    executor: Executor | None = None,
    workers: int | None = None,
    progress: bool | Listener = True,
) -> Run:
    """Has another engine execute the contested grasps of a run, and settle their verdicts.

    The new verdict takes the place of the old one in the table and in all counts; the columns
    `judged_again` and `outcome_before` say so. What the stages before the trial found stays as it
    is. A grasp that was judged again is not contested any more. An interrupted call goes on where
    it was.

    Args:
        run: complete; or its folder.
        engine: name of a preset, not the run's own.
        executor: who judges, in place of so many processes of this machine.
        workers: number of processes; as many as there are processors if None.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Returns:
        The run with the new verdicts. Grasps that the engine cannot simulate keep their old one.

    Raises:
        InvalidInputError: the run is not complete, the engine is its own or cannot have the arm or
            an object, documents have changed since, or another process is writing the folder.
        UnknownNameError: no such engine.
        MissingDependencyError: it is not installed.
        SimulationError: the worker processes die.
    """
    run = run if isinstance(run, Run) else load_run(run)
    require_second_engine(engine, run.document.engine, run.document.mode)
    if run.document.shard:
        raise InvalidInputError(
            f"{run.path} is shard {run.document.shard} of a run; merge the shards, and then judge"
            " again what is contested"
        )
    if not run.complete:
        raise InvalidInputError(
            f"{run.path} is not complete; run the command that began it to the end first:"
            f" {run.document.command}"
        )
    executor = executor or LocalExecutor.of_this_machine(workers)
    with Reporter(progress) as reporter, Journal(run.path / JOURNAL_FILE) as journal:
        left = [run.trial(id).candidate for id in run.contested]
        if left:
            require_scene_for(ENGINES[engine], run.scene(), run.station())
            run = _judge(run, left, engine, executor, journal, reporter)
        run = finish_run(run, run.document.table)
        keep_parts(run)
        return run


def require_second_engine(engine: str, first: Engine, mode: Mode) -> None:
    """Refuses an engine whose opinion of the verdicts of another one is worth nothing.

    Args:
        engine: name of a preset.
        first: the engine of the run.
        mode: of the run.

    Raises:
        UnknownNameError: no such preset.
        InvalidInputError: it is the first one, or the same simulator with longer steps, or cannot
            run trials of the mode.
        MissingDependencyError: it is not installed.
    """
    if engine not in ENGINES:
        raise UnknownNameError(f"engine {engine!r} does not exist; {nearest(engine, ENGINES)}")
    second = ENGINES[engine]
    others = ", ".join(name for name, one in ENGINES.items() if _is_finer(one, first))
    if not _is_finer(second, first):
        why = "is the one" if second == first else "takes longer steps than the one"
        raise InvalidInputError(
            f"engine {engine!r} {why} that has judged all grasps, {first.name!r}; give one of"
            f" {others}"
        ).about("engine")
    require_engine_for(second, mode)


def _is_finer(second: Engine, first: Engine) -> bool:
    return second.simulator != first.simulator or second.time_step < first.time_step


def _judge(
    run: Run,
    left: list[Candidate],
    engine: str,
    executor: Executor,
    journal: Journal,
    reporter: Reporter,
) -> Run:
    mode: Mode = "arm" if run.document.mode == "arm" else "hand"
    settings = origin_of(run.document).settings()
    factory = StationJudgeFactory(run.scene(), run.station(), ENGINES[engine], mode, settings)
    pace = ProgressMeter(reporter.show, Progress(STARTING, 0, len(left)), "judging again")
    session, begun, judged = begun_now(executor.workers, len(run.verdicts)), time.monotonic(), 0
    job = Job(run.document.scene.name, factory, left)
    try:
        with closing(executor.judge([job])) as verdicts:
            for _, candidate, verdict in verdicts:
                before = run.verdicts[candidate.id]
                if verdict.outcome is not Outcome.SIMULATION_FAILED:
                    journal.append(candidate.id, settled(before, verdict, engine))
                    judged += 1
                pace.step(outcome=verdict.outcome)
    finally:
        seconds = round(time.monotonic() - begun, 3)
        sessions = (*run.document.stretches, replace(session, judged=judged, seconds=seconds))
        versions = software_versions(ENGINES[engine].packages) | run.document.versions
        document = replace(run.document, stretches=sessions, versions=versions)
        run = save_run(Run(run.path, document))
    return run


def settled(before: Verdict, verdict: Verdict, engine: str) -> Verdict:
    """A verdict in the place of another one.

    Args:
        before: of the run's own engine.
        verdict: of a trial by another engine.
        engine: the name of that.
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
