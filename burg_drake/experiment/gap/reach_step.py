"""Adds the question whether the arm can execute a grasp to a run of the hand alone.

A run in mode `reach` executes the same trials of the hand: of grasps that the arm can execute it
has the verdicts that the hand's run has already. So only the screens are asked here, and a trial is
executed again only where the arm has less room to lift than the hand has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace

from burg_drake.core.grasps import LIFT_HEIGHT, Outcome, Stage, Verdict
from burg_drake.core.terminal import STARTING, Listener, Progress, ProgressMeter, Reporter
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.records import origin_of
from burg_drake.evaluation.stages import Decision, Judge, StationJudge
from burg_drake.evaluation.store import Run
from burg_drake.evaluation.workers import Executor, Job, LocalExecutor
from burg_drake.experiment.gap.scene_judge import SceneJudgeFactory


@dataclass(frozen=True)
class ReachOfHandFactory:
    """Builds a judge of mode `reach` that knows the hand's trials.

    Attributes:
        build: builds the station's judge.
        trials: executed ones by grasp id.
    """

    build: Callable[[], StationJudge]
    trials: Mapping[str, Verdict]

    def __call__(self) -> Judge:
        judge = self.build()
        ((stage, execute),) = judge.stages

        def recall(grasp: Candidate, motion: object) -> Decision:
            known = self.trials.get(grasp.id)
            if known is None or known.margins.get(LIFT_HEIGHT) != grasp.lift:
                return execute(grasp, None)
            return as_decision(known)

        judge.stages = [(stage, recall)]
        return judge


def as_decision(verdict: Verdict) -> Decision:
    """The answer of a trial, from the verdict that it ended in."""
    return Decision(verdict.outcome, **verdict.of_trial())


def reach_verdicts(
    hand: Run,
    known: Mapping[str, Verdict],
    *,
    executor: Executor | None = None,
    progress: bool | Listener = True,
) -> Iterator[tuple[str, Verdict]]:
    """What a run in mode `reach` says of the grasps of a run of the hand, bit for bit.

    Args:
        hand: a complete run in mode `hand`.
        known: verdicts that are there already.
        executor: who judges.
        progress: see `evaluate`.

    Yields:
        Ids and verdicts of the others.
    """
    executor = LocalExecutor.of_this_machine() if executor is None else executor
    origin = origin_of(hand.document)
    build = SceneJudgeFactory(
        hand.scene(), hand.station(), origin.engine, "reach", origin.settings(f"{hand.path}: trial")
    )
    trials = {id: v for id, v in hand.verdicts.items() if _executed(v)}
    todo = [candidate for candidate in hand.candidates if candidate.id not in known]
    if not todo:
        return
    with Reporter(progress) as reporter:
        begin = Progress(STARTING, len(known), len(hand.candidates))
        pace = ProgressMeter(reporter.show, begin, "asking the arm")
        job = Job("reach", ReachOfHandFactory(build.plain, trials), todo)
        with closing(executor.judge([job])) as judged:
            for _, candidate, verdict in judged:
                pace.step(outcome=verdict.outcome)
                yield candidate.id, _with_cost(verdict, trials.get(candidate.id))


def _executed(verdict: Verdict) -> bool:
    lift = verdict.margins.get(LIFT_HEIGHT, math.nan)
    failed = verdict.outcome is Outcome.SIMULATION_FAILED
    return verdict.stage is Stage.EXECUTED and not failed and math.isfinite(lift)


def _with_cost(verdict: Verdict, trial: Verdict | None) -> Verdict:
    """The verdict with the time that its trial took when it was executed."""
    if trial is None or verdict.stage is not Stage.EXECUTED or Stage.EXECUTED not in trial.cpu:
        return verdict
    return replace(verdict, cpu={**verdict.cpu, Stage.EXECUTED: trial.cpu[Stage.EXECUTED]})
