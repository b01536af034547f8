"""How one grasp is judged: stage by stage, until one of them decides.

A judge is a row of stages; each answers for one grasp with an outcome, or passes it on. The first
ones are screens: they are asked about many grasps at once, which costs a fraction of asking about
each. The stages of a station are in `station_judge`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

from burg_drake.core import one_line
from burg_drake.core.grasps import LIFT_HEIGHT, Findings, Outcome, Stage, Verdict, joined_findings
from burg_drake.evaluation.candidates import Candidate

if TYPE_CHECKING:
    from burg_drake.motion.plans import Plan
    from burg_drake.motion.reach import Witness
    from burg_drake.simulation.trials import TrialResult


@dataclass(frozen=True)
class Decision(Findings):
    """The answer of one stage.

    Attributes:
        outcome: how the grasp ends here; None passes it on to the next stage.
        motion: the arm's motion, if later stages need it.
    """

    outcome: Outcome | None = None
    motion: Witness | Plan | None = field(default=None, compare=False, repr=False, kw_only=True)


class Screen(NamedTuple):
    """A stage that is asked about many grasps at once; its answers do not depend on the batch.

    Attributes:
        stage: its name.
        ask: gives an answer for each grasp.
        batch: how many grasps to ask about at a time, so that more would hardly be cheaper each.
    """

    stage: Stage
    ask: Callable[[Sequence[Candidate]], list[Decision]]
    batch: int


Decide = Callable[[Candidate, "Witness | Plan | None"], Decision]
"""A stage that is asked about one grasp, with the motion that an earlier stage has found for it."""


class Judge(Protocol):
    """Stages in the order in which a grasp passes them; the last one always decides."""

    @property
    def screens(self) -> Sequence[Screen]:
        """The first stages."""
        ...

    @property
    def stages(self) -> Sequence[tuple[Stage, Decide]]:
        """Name and function of each later stage."""
        ...


@dataclass(frozen=True)
class ScreenAnswers:
    """The answers of the first screens of a judge; all but the last one pass the grasp on.

    Attributes:
        decisions: the answers.
        cpu: CPU time that they took by stage; an equal share, if grasps were screened together [s].
    """

    decisions: tuple[Decision, ...] = ()
    cpu: Mapping[Stage, float] = field(default_factory=dict)

    @property
    def outcome(self) -> Outcome | None:
        """How the grasp ends; None if it is passed on."""
        return self.decisions[-1].outcome if self.decisions else None

    def verdict(self) -> Verdict:
        """The verdict, where the last answer decides."""
        return _verdict(self.decisions, list(self.cpu)[-1], self.cpu)

    def then(self, stage: Stage, decision: Decision, cpu: float) -> ScreenAnswers:
        """With one more answer."""
        return ScreenAnswers((*self.decisions, decision), {**self.cpu, stage: cpu})


def screen_grasps(
    judge: Judge, grasps: Sequence[tuple[Candidate, ScreenAnswers]]
) -> list[ScreenAnswers]:
    """Asks the next screen about many grasps at once.

    Args:
        judge: the stages.
        grasps: with the answers of the screens before; the same ones for all grasps.

    Returns:
        All answers. Where an error comes up, each grasp is asked about alone, and the error is the
        answer of those that have it.
    """
    if not grasps:
        return []
    screen = judge.screens[len(grasps[0][1].decisions)]
    start = time.process_time()
    try:
        decisions = screen.ask([candidate for candidate, _ in grasps])
    except Exception as error:
        if len(grasps) > 1:
            return [screened for grasp in grasps for screened in screen_grasps(judge, [grasp])]
        decisions = [Decision(Outcome.SIMULATION_FAILED, reason=one_line(error))]
    share = (time.process_time() - start) / len(grasps)
    return [
        before.then(screen.stage, decision, share)
        for (_, before), decision in zip(grasps, decisions, strict=True)
    ]


def judge_grasp(
    judge: Judge,
    candidate: Candidate,
    announce: Callable[[Stage], None] | None = None,
    screened: ScreenAnswers | None = None,
) -> Verdict:
    """Sends a grasp through the stages.

    Args:
        judge: the stages.
        candidate: the grasp.
        announce: called with each stage before it begins.
        screened: answers of screens that are known already.

    Returns:
        The verdict. An error inside a stage ends in `simulation_failed` with its message.
    """
    announce = announce or (lambda stage: None)
    answers = screened or ScreenAnswers()
    for screen in judge.screens[len(answers.decisions) :]:
        if answers.outcome is None:
            announce(screen.stage)
            (answers,) = screen_grasps(judge, [(candidate, answers)])
    for stage, decide in judge.stages:
        if answers.outcome is not None:
            break
        announce(stage)
        motion = next((d.motion for d in reversed(answers.decisions) if d.motion), None)
        start = time.process_time()
        try:
            decision = decide(_with_lift(candidate, answers.decisions), motion)
        except Exception as error:  # whatever Drake throws becomes this one grasp's outcome
            decision = Decision(Outcome.SIMULATION_FAILED, reason=one_line(error))
        answers = answers.then(stage, decision, time.process_time() - start)
    if answers.outcome is None:
        raise ValueError("the last stage of a judge has to decide")
    return answers.verdict()


def _with_lift(candidate: Candidate, decisions: Sequence[Decision]) -> Candidate:
    """A grasp with the length of the lift for which an earlier stage has found room, unless it
    comes with one."""
    if candidate.lift is not None:
        return candidate
    found = [d.margins[LIFT_HEIGHT] for d in decisions if LIFT_HEIGHT in d.margins]
    return replace(candidate, lift=found[-1]) if found else candidate


def _verdict(decisions: Sequence[Decision], stage: Stage, cpu: Mapping[Stage, float]) -> Verdict:
    last = decisions[-1].outcome
    assert last is not None
    failed = last is Outcome.SIMULATION_FAILED
    decided = stage if failed else last.stage
    return Verdict(last, decided, cpu=cpu, **joined_findings(decisions))


def trial_decision(result: TrialResult) -> Decision:
    """The answer of an executed trial, of the hand alone or of the arm."""
    return Decision(result.outcome, **result.of_trial() | {"margins": result.margins.of_trial()})


def trial_verdict(result: TrialResult) -> Verdict:
    """The verdict of a trial that went through no other stage."""
    return _verdict([trial_decision(result)], Stage.EXECUTED, {})
