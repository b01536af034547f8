"""How one grasp is judged: stage by stage, until one of them decides.

A judge is a row of stages; each answers for one grasp with an outcome, or passes it on. The
stages of a station are in `StationJudge`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from burg_drake.core.outcome import Outcome, Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.scene.scene import Scene
from burg_drake.station.engine import Engine
from burg_drake.station.station import Station

if TYPE_CHECKING:
    from burg_drake.simulation.result import TrialResult
    from burg_drake.simulation.trial_settings import TrialSettings

MARGINS = (
    *("overlap", "clearance", "slip", "tilt", "pad_force", "patch_area"),
    *("lift", "others_moved", "end_time"),
)
"""Margins of a verdict: see `simulation.result.Margins`."""


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
        q_grasp, q_pregrasp: arm configurations found [rad].
    """

    outcome: Outcome | None = None
    blocker: str = ""
    reason: str = ""
    margins: Mapping[str, float] = field(default_factory=dict)
    displacements: Mapping[str, float] = field(default_factory=dict)
    q_grasp: tuple[float, ...] = ()
    q_pregrasp: tuple[float, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """What became of a grasp.

    Attributes:
        outcome: the one outcome.
        stage: the stage that decided; for `simulation_failed` the stage that failed.
        blocker, reason, margins, displacements, q_grasp, q_pregrasp: as in `Decision`.
        cpu: CPU time by stage [s].
    """

    outcome: Outcome
    stage: Stage
    blocker: str = ""
    reason: str = ""
    margins: Mapping[str, float] = field(default_factory=dict)
    displacements: Mapping[str, float] = field(default_factory=dict)
    q_grasp: tuple[float, ...] = ()
    q_pregrasp: tuple[float, ...] = ()
    cpu: Mapping[Stage, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Screened:
    """The answer of `Stage.CLEAR`.

    Attributes:
        decision: the answer.
        cpu: CPU time that it took; an equal share, if grasps were screened together [s].
    """

    decision: Decision
    cpu: float

    def verdict(self) -> Verdict:
        """The verdict, where that decides."""
        return _verdict([self.decision], Stage.CLEAR, {Stage.CLEAR: self.cpu})


class Judge(Protocol):
    """Stages in the order in which a grasp passes them: `Stage.CLEAR`, which is asked about many
    grasps at once, and those after it; the last one always decides."""

    def screen(self, grasps: Sequence[Candidate]) -> list[Decision]:
        """The answers of `Stage.CLEAR`; they do not depend on the batch."""
        ...

    @property
    def stages(self) -> Sequence[tuple[Stage, Callable[[Candidate], Decision]]]:
        """Name and function of each later stage."""
        ...


def screen_grasps(judge: Judge, candidates: Sequence[Candidate]) -> list[Screened]:
    """Asks `Stage.CLEAR` about many grasps at once.

    Returns:
        Its answers. Where an error comes up, each grasp is asked about alone, and the error is the
        answer of those that have it.
    """
    start = time.process_time()
    try:
        decisions = judge.screen(candidates)
    except Exception as error:
        if len(candidates) > 1:
            return [screened for c in candidates for screened in screen_grasps(judge, [c])]
        decisions = [Decision(Outcome.SIMULATION_FAILED, reason=one_line(error))]
    share = (time.process_time() - start) / max(1, len(candidates))
    return [Screened(decision, share) for decision in decisions]


def judge_grasp(
    judge: Judge,
    candidate: Candidate,
    announce: Callable[[Stage], None] | None = None,
    screened: Screened | None = None,
) -> Verdict:
    """Sends a grasp through the stages.

    Args:
        judge: the stages.
        candidate: the grasp.
        announce: called with each stage before it begins.
        screened: answer of `Stage.CLEAR`, if it is known already.

    Returns:
        The verdict. An error inside a stage ends in `simulation_failed` with its message.
    """
    announce = announce or (lambda stage: None)
    if screened is None:
        announce(Stage.CLEAR)
        (screened,) = screen_grasps(judge, [candidate])
    if screened.decision.outcome is not None:
        return screened.verdict()
    cpu = {Stage.CLEAR: screened.cpu}
    decisions = [screened.decision]
    for stage, decide in judge.stages:
        announce(stage)
        start = time.process_time()
        try:
            decisions.append(decide(candidate))
        except Exception as error:  # whatever Drake throws becomes this one grasp's outcome
            decisions.append(Decision(Outcome.SIMULATION_FAILED, reason=one_line(error)))
        cpu[stage] = time.process_time() - start
        if decisions[-1].outcome is not None:
            return _verdict(decisions, stage, cpu)
    raise ValueError("the last stage of a judge has to decide")


def one_line(error: BaseException) -> str:
    """An error as one line: its type and message."""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def _verdict(decisions: list[Decision], stage: Stage, cpu: Mapping[Stage, float]) -> Verdict:
    last = decisions[-1]
    assert last.outcome is not None
    failed = last.outcome is Outcome.SIMULATION_FAILED
    return Verdict(
        outcome=last.outcome,
        stage=stage if failed else last.outcome.stage,
        blocker=last.blocker,
        reason=last.reason,
        margins={k: float(v) for d in decisions for k, v in d.margins.items()},
        displacements={k: float(v) for d in decisions for k, v in d.displacements.items()},
        q_grasp=next((d.q_grasp for d in decisions if d.q_grasp), ()),
        q_pregrasp=next((d.q_pregrasp for d in decisions if d.q_pregrasp), ()),
        cpu=cpu,
    )


def trial_decision(result: TrialResult) -> Decision:
    """The answer of an executed trial."""
    return Decision(
        result.outcome,
        result.blocker,
        result.reason,
        margins=asdict(result.margins),
        displacements=result.displacements,
    )


def trial_verdict(result: TrialResult) -> Verdict:
    """The verdict of a trial that went through no other stage."""
    return _verdict([trial_decision(result)], Stage.EXECUTED, {})


class StationJudge:
    """Judges grasps on a station: clearance of the hand, reach of the arm, trial in simulation."""

    def __init__(
        self,
        scene: Scene,
        station: Station,
        *,
        engine: Engine,
        reach: bool,
        settings: TrialSettings | None = None,
    ) -> None:
        """Builds the diagrams that all grasps share.

        Args:
            scene, station: what to build.
            engine: how the trial is stepped.
            reach: ask whether the arm reaches; the station needs an arm then.
            settings: phases of the trial, if not the usual ones.
        """
        from burg_drake.simulation.hand_trial import HandTrial
        from burg_drake.simulation.trial_settings import TrialSettings

        settings = TrialSettings() if settings is None else settings
        self._trial = HandTrial(scene, station, engine=engine, settings=settings)
        self._X_WO = {name: self._trial.diagram.X_WO(name) for name in scene.instances}
        self.stages: list[tuple[Stage, Callable[[Candidate], Decision]]] = []
        if reach:
            from burg_drake.motion.reach import ArmReach

            self._arm = ArmReach(scene, station)
            self.stages.append((Stage.REACHABLE, self._reach))
        self.stages.append((Stage.EXECUTED, self._execute))

    def screen(self, grasps: Sequence[Candidate]) -> list[Decision]:
        """Clearance of the hand at many grasps."""
        places: dict[str, list[int]] = {}
        for place, grasp in enumerate(grasps):
            places.setdefault(grasp.instance, []).append(place)
        decisions = [Decision()] * len(grasps)
        for instance, chosen in places.items():
            # One by one: products of stacked matrices may differ from single ones in the last bit.
            X_WG = np.array([self._X_WO[instance] @ grasps[k].X_OG for k in chosen])
            found = self._trial.clearance.check_all(instance, X_WG)
            for k, clearance in zip(chosen, found, strict=True):
                margins = {"overlap": clearance.overlap, "clearance": clearance.clearance}
                decisions[k] = Decision(clearance.outcome, clearance.blocker, margins=margins)
        return decisions

    def _reach(self, grasp: Candidate) -> Decision:
        X_WG = self._X_WO[grasp.instance] @ grasp.X_OG
        found = self._arm.check(X_WG)
        return Decision(
            found.outcome,
            found.blocker,
            q_grasp=_floats(found.q_grasp),
            q_pregrasp=_floats(found.q_pregrasp),
        )

    def _execute(self, grasp: Candidate) -> Decision:
        result = self._trial.run(
            grasp.instance, grasp.X_OG, friction=grasp.friction, mass=grasp.mass
        )
        return trial_decision(result)


@dataclass(frozen=True)
class StationJudgeFactory:
    """What a worker process needs to build its `StationJudge`."""

    scene: Scene
    station: Station
    engine: Engine
    reach: bool

    def __call__(self) -> StationJudge:
        return StationJudge(self.scene, self.station, engine=self.engine, reach=self.reach)


def _floats(q: object) -> tuple[float, ...]:
    return () if q is None else tuple(float(value) for value in q)  # type: ignore[attr-defined]
