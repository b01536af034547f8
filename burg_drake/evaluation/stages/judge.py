"""How one grasp is judged: stage by stage, until one of them decides.

A judge is a row of stages; each answers for one grasp with an outcome, or passes it on. The first
ones are screens: they are asked about many grasps at once, which costs a fraction of asking about
each. The stages of a station are in `station_judge`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

from burg_drake.core.grasps import Outcome, Stage
from burg_drake.evaluation.candidates import Candidate

if TYPE_CHECKING:
    from burg_drake.motion.plans import Plan
    from burg_drake.motion.reach import Witness
    from burg_drake.simulation.trials import TrialResult

ARM_SCREEN_MARGINS = ("arm_clearance", "joint_excess")
"""Of the arm's screen. `arm_clearance` [m]: if the arm can execute the grasp, a bound that the
whole robot keeps from all else on its way; if something is in its way, the signed distance from
that, negative for how deep they overlap. `joint_excess` [rad]: how far the configuration that comes
closest is beyond a joint limit."""
ARM_MARGINS = (
    *ARM_SCREEN_MARGINS,
    *("duration", "tracking_error", "tracking_distance", "pushed"),
)
"""Margins that only stations with an arm have: those of the arm's screen, the `duration` of the
planned motion [s], and those of `simulation.arm_trial`, see `simulation.result.Margins`."""
LIFT_HEIGHT = "lift_height"
"""Margin: length of the lift, as long as the run's motion asks for, or as there is room where it
allows less [m]."""
MARGINS = (
    *("overlap", "clearance", "slip", "tilt", "pad_force", "patch_area"),
    *("lift", LIFT_HEIGHT, "others_moved", "end_time"),
    *ARM_MARGINS,
)
"""Margins of a verdict: see `simulation.result.Margins`, `LIFT_HEIGHT` and `ARM_MARGINS`."""


@dataclass(frozen=True)
class Decision:
    """The answer of one stage.

    Attributes:
        outcome: how the grasp ends here; None passes it on to the next stage.
        blocker: name of the body in the way, if any.
        reason: explanation for people, where the outcome alone does not say enough.
        margins: by name of `MARGINS`; what is not measured is left out.
        displacements: peak displacement of every other free object by instance [m]; empty if the
            trial did not start.
        pushed: displacement of every free object, the target too, before the arm's hand closes, by
            instance [m].
        touched: the first body that the arm touched against its plan, and with what.
        q_grasp, q_pregrasp: arm configurations found [rad].
        motion: the arm's motion, if later stages need it.
    """

    outcome: Outcome | None = None
    blocker: str = ""
    reason: str = ""
    margins: Mapping[str, float] = field(default_factory=dict)
    displacements: Mapping[str, float] = field(default_factory=dict)
    pushed: Mapping[str, float] = field(default_factory=dict)
    touched: str = ""
    q_grasp: tuple[float, ...] = ()
    q_pregrasp: tuple[float, ...] = ()
    motion: Witness | Plan | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Verdict:
    """What became of a grasp.

    Attributes:
        outcome: the one outcome.
        stage: the stage that decided; for `simulation_failed` the stage that failed.
        blocker, reason, margins, displacements, pushed, touched, q_grasp, q_pregrasp: as in
            `Decision`.
        cpu: CPU time by stage [s].
        interrupted: whether it failed because its worker process was ended from outside, so that
            another try may give an answer.
    """

    outcome: Outcome
    stage: Stage
    blocker: str = ""
    reason: str = ""
    margins: Mapping[str, float] = field(default_factory=dict)
    displacements: Mapping[str, float] = field(default_factory=dict)
    pushed: Mapping[str, float] = field(default_factory=dict)
    touched: str = ""
    q_grasp: tuple[float, ...] = ()
    q_pregrasp: tuple[float, ...] = ()
    cpu: Mapping[Stage, float] = field(default_factory=dict)
    interrupted: bool = False

    def is_open(self, *, retry_failed: bool = False) -> bool:
        """Whether a later call asks again.

        Args:
            retry_failed: not only where it was interrupted, but wherever the simulation failed.
        """
        return self.interrupted or (retry_failed and self.outcome is Outcome.SIMULATION_FAILED)


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


def one_line(error: BaseException) -> str:
    """An error as one line: its type and message."""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def _verdict(decisions: Sequence[Decision], stage: Stage, cpu: Mapping[Stage, float]) -> Verdict:
    last = decisions[-1]
    assert last.outcome is not None
    failed = last.outcome is Outcome.SIMULATION_FAILED
    return Verdict(
        outcome=last.outcome,
        stage=stage if failed else last.outcome.stage,
        blocker=last.blocker,
        reason=last.reason,
        margins=_margins(decisions),
        displacements={k: float(v) for d in decisions for k, v in d.displacements.items()},
        pushed={k: float(v) for d in decisions for k, v in d.pushed.items()},
        touched=last.touched,
        q_grasp=next((d.q_grasp for d in decisions if d.q_grasp), ()),
        q_pregrasp=next((d.q_pregrasp for d in decisions if d.q_pregrasp), ()),
        cpu=cpu,
    )


def _margins(decisions: Sequence[Decision]) -> dict[str, float]:
    """The margins of all stages; a later one does not unsay what an earlier one has measured."""
    found: dict[str, float] = {}
    for decision in decisions:
        for name, value in decision.margins.items():
            if name not in found or not math.isnan(value):
                found[name] = float(value)
    return found


def trial_decision(result: TrialResult) -> Decision:
    """The answer of an executed trial, of the hand alone or of the arm."""
    return Decision(
        result.outcome,
        result.blocker,
        result.reason,
        margins=asdict(result.margins),
        displacements=result.displacements,
        pushed=result.pushed,
        touched=result.touched,
    )


def trial_verdict(result: TrialResult) -> Verdict:
    """The verdict of a trial that went through no other stage."""
    return _verdict([trial_decision(result)], Stage.EXECUTED, {})
