"""Probes, which are single robustness tests of a grasp: made, answered by workers, and recorded."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import count, takewhile
from typing import TYPE_CHECKING

from burg_drake.core import Outcome, Stage, Verdict, content_hash
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import Decide, Decision, Screen, trial_decision
from burg_drake.evaluation.settings import ROBUSTNESS_TESTS, RobustnessSettings
from burg_drake.scene import Scene
from burg_drake.simulation import (
    HandTrial,
    HoldForces,
    TrialResult,
    friction_limit,
    perturb,
    shake,
    take_grip,
    tug,
)
from burg_drake.station import Engine, Station

if TYPE_CHECKING:
    from burg_drake.simulation import TrialSettings


@dataclass(frozen=True)
class ProbeAnswer:
    """The answer to a probe.

    Workers return it and journals store it as a verdict, with its numbers as the margins. A verdict
    needs an outcome: `lifted` stands for an answer in numbers, which only a lifted grasp has.
    Infinity means a limit beyond the tested range; journals, which have no infinity, store null.

    Attributes:
        test: one of `ROBUSTNESS_TESTS`.
        outcome: outcome of the trial. It is the answer of `noise`; for the other tests it says why
            the object was not held, and is None if they have an answer in numbers.
        forces: loads that the grip withstands, for `tug` and `shake`.
        friction: smallest friction coefficient that lifts, for `friction`.
    """

    test: str
    outcome: Outcome | None = None
    forces: HoldForces | None = None
    friction: float | None = None

    @property
    def failed(self) -> bool:
        """Whether the test has no answer, because the object was not held."""
        return self.test != "noise" and self.outcome is not None

    def decision(self) -> Decision:
        """Decision as which a worker returns the answer."""
        numbers: dict[str, float] = {}
        if self.forces is not None:
            numbers = {**self.forces.accelerations, "weight": self.forces.weight}
        if self.friction is not None:
            numbers = {"friction": self.friction}
        return Decision(Outcome.LIFTED if self.outcome is None else self.outcome, margins=numbers)

    @classmethod
    def from_verdict(cls, test: str, verdict: Verdict) -> ProbeAnswer:
        """Reads an answer from its verdict in a journal; a trial only gives its outcome."""
        if test == "noise" or verdict.outcome is not Outcome.LIFTED:
            return cls(test, verdict.outcome)
        numbers = {name: _nan_to_infinity(value) for name, value in verdict.margins.items()}
        if test == "friction":
            return cls(test, friction=numbers["friction"])
        weight = numbers.pop("weight")
        return cls(test, forces=HoldForces(numbers, weight))


def _nan_to_infinity(value: float) -> float:
    return math.inf if math.isnan(value) else value


@dataclass(frozen=True, eq=False)
class RobustnessProbe:
    """A single robustness test of a grasp.

    Attributes:
        test: one of `ROBUSTNESS_TESTS`.
        grasp: id of the grasp.
        trial: the grasp to try, perturbed or not; its id has test, repeat and settings.
    """

    test: str
    grasp: str
    trial: Candidate

    @property
    def id(self) -> str:
        """Id of the answer in the journal."""
        return self.trial.id


def make_probes(
    grasp: Candidate, scene: Scene, settings: RobustnessSettings, context: Sequence[object]
) -> Iterator[RobustnessProbe]:
    """Yields the probes of a grasp.

    Args:
        grasp: the grasp.
        scene: scene with mass and friction of the target.
        settings: settings of the tests.
        context: JSON values that determine the answers, besides the settings.
    """
    for test in settings.tests:
        key = _settings_key(test, settings, context)
        if test != "noise":
            id = _probe_id(grasp.id, test, key)
            trial = Candidate(id, grasp.instance, grasp.X_OG, lift=grasp.lift)
            yield RobustnessProbe(test, grasp.id, trial)
            continue
        entry = scene.entry(grasp.instance)
        for repeat in range(settings.repeats):
            drawn = perturb(
                grasp.X_OG,
                entry.mass,
                entry.friction,
                settings.noise,
                seed=settings.seed,
                grasp=grasp.id,
                repeat=repeat,
            )
            trial = Candidate(
                _probe_id(grasp.id, test, key, repeat),
                grasp.instance,
                drawn.X_OG,
                drawn.friction,
                drawn.mass,
                lift=grasp.lift,
            )
            yield RobustnessProbe(test, grasp.id, trial)


def known_answers(
    grasp: str,
    answers: Mapping[str, Verdict],
    settings: RobustnessSettings,
    context: Sequence[object],
) -> list[ProbeAnswer]:
    """Known answers on a grasp from any call, for all tests and repeats.

    Args:
        grasp: id of the grasp.
        answers: verdicts in the journal, by the id of the probe.
        settings: only answers with these settings count, whatever their tests and repeats.
        context: see `make_probes`.

    Returns:
        Answers in the order of `ROBUSTNESS_TESTS`; repeats up to the first missing one.
    """
    found: list[ProbeAnswer] = []
    for test in ROBUSTNESS_TESTS:
        key = _settings_key(test, settings, context)
        repeats: Iterable[int | None] = count() if test == "noise" else (None,)
        ids = (_probe_id(grasp, test, key, repeat) for repeat in repeats)
        known = takewhile(answers.__contains__, ids)
        found += [ProbeAnswer.from_verdict(test, answers[id]) for id in known]
    return found


def _settings_key(test: str, settings: RobustnessSettings, context: Sequence[object]) -> str:
    digits = 8  # Of the hash; answers with other settings have another key.
    return content_hash(test, settings.content(test), list(context))[:digits]


def _probe_id(grasp: str, test: str, key: str, repeat: int | None = None) -> str:
    return ":".join([grasp, test, *([] if repeat is None else [str(repeat)]), key])


class ProbeJudge:
    """Answers probes. It has no screens, as a start in collision is an answer, too."""

    screens: tuple[Screen, ...] = ()

    def __init__(self, factory: ProbeJudgeFactory) -> None:
        from burg_drake.simulation import hand_trial_of

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
        """Answers a probe.

        Args:
            test: one of `ROBUSTNESS_TESTS`.
            grasp: the grasp to try.

        Returns:
            The answer; the result of the trial for `noise`, and if the object is not held.
        """
        trial, settings, lift = self._trial, self._settings, grasp.lift
        pose = (grasp.instance, grasp.X_OG)
        if test == "noise":
            return trial.run(*pose, friction=grasp.friction, mass=grasp.mass, lift=lift)
        if test == "friction":
            limit = friction_limit(trial, *pose, lift=lift, settings=settings.friction)
            return ProbeAnswer(test, friction=limit)
        assert isinstance(trial, HandTrial)  # else `assess_robustness` refuses the test
        grip = take_grip(trial, *pose, lift=lift)
        if isinstance(grip, TrialResult):
            return grip
        return ProbeAnswer(test, forces=(tug if test == "tug" else shake)(grip, settings.loads))


@dataclass(frozen=True)
class ProbeJudgeFactory:
    """Builds the `ProbeJudge` of a worker process.

    Attributes:
        scene, station: scene and station of the grasps.
        engine, trial: engine and settings of the trials.
        settings: settings of the tests.
        tests: test of each probe, by its id.
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
        """JSON values that determine answers, besides the settings of the tests."""
        return [self.scene.content, self.station.content, asdict(self.engine), asdict(self.trial)]
