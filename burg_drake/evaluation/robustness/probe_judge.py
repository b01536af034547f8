"""How a worker answers questions about the robustness of grasps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from burg_drake.core.grasps import Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.robustness.probe_answer import ProbeAnswer
from burg_drake.evaluation.robustness.settings import (
    RobustnessSettings,
)
from burg_drake.evaluation.stages import Decide, Decision, Screen, trial_decision
from burg_drake.scene.document import Scene
from burg_drake.simulation.robustness import friction_limit, shake, take_grip, tug
from burg_drake.simulation.trials import HandTrial, TrialResult
from burg_drake.station.document import Engine, Station

if TYPE_CHECKING:
    from burg_drake.simulation.trials import TrialSettings


class ProbeJudge:
    """Answers probes. There are no screens: what starts in a collision is an answer, too."""

    screens: tuple[Screen, ...] = ()

    def __init__(self, factory: ProbeJudgeFactory) -> None:
        from burg_drake.simulation.mujoco import hand_trial_of

        self._settings = factory.settings
        self._tests = factory.tests
        self._trial = hand_trial_of(
            factory.scene, factory.station, factory.engine, settings=factory.trial
        )
        self.stages: list[tuple[Stage, Decide]] = [(Stage.EXECUTED, self._decide)]

    def _decide(self, grasp: Candidate, motion: object) -> Decision:
        found = self.answer(self._tests[grasp.id], grasp)
        return trial_decision(found) if isinstance(found, TrialResult) else found.decision()

    def answer(self, test: str, grasp: Candidate) -> ProbeAnswer | TrialResult:
        """The answer to a probe.

        Args:
            test: one of `settings.TESTS`.
            grasp: as it is tried.

        Returns:
            Of `noise`, and where the object is not held, the trial.
        """
        trial, settings, lift = self._trial, self._settings, grasp.lift
        what = (grasp.instance, grasp.X_OG)
        if test == "noise":
            return trial.run(*what, friction=grasp.friction, mass=grasp.mass, lift=lift)
        if test == "friction":
            limit = friction_limit(trial, *what, lift=lift, settings=settings.friction)
            return ProbeAnswer(test, friction=limit)
        assert isinstance(trial, HandTrial)  # else `assess_robustness` refuses the test
        grip = take_grip(trial, *what, lift=lift)
        if isinstance(grip, TrialResult):
            return grip
        return ProbeAnswer(test, forces=(tug if test == "tug" else shake)(grip, settings.loads))


@dataclass(frozen=True)
class ProbeJudgeFactory:
    """What a worker process needs to build its `ProbeJudge`.

    Attributes:
        scene, station: where the grasps are.
        engine, trial: how their trials are executed.
        settings: what is asked.
        tests: of each probe by its id.
    """

    scene: Scene
    station: Station
    engine: Engine
    trial: TrialSettings
    settings: RobustnessSettings
    tests: Mapping[str, str] = field(default_factory=dict)

    def __call__(self) -> ProbeJudge:
        return ProbeJudge(self)

    def content(self) -> list[object]:
        """What decides about answers beside the settings of the tests."""
        return [self.scene.content, self.station.content, asdict(self.engine), asdict(self.trial)]
