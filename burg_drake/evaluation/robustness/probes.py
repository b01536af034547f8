"""What is asked about the robustness of one grasp, and how a worker answers.

A probe is one question about one grasp: how hard it can be tugged or shaken, how much friction it
needs, or what becomes of one perturbed repeat of its trial. Probes go to the same workers as the
grasps of an evaluation, and their answers are verdicts: numbers are among the margins. An infinite
one, which stands for a limit beyond all that is tried, comes back from a journal as NaN.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import count, takewhile
from typing import TYPE_CHECKING

from burg_drake.core import InvalidInputError, UnknownNameError, content_hash, nearest
from burg_drake.core.grasps import Outcome, Stage, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages import Decide, Decision, Screen, trial_decision
from burg_drake.scene.document import Scene
from burg_drake.simulation.robustness import (
    FrictionSettings,
    LoadSettings,
    Noise,
    friction_limit,
    perturb,
    shake,
    take_grip,
    tug,
)
from burg_drake.simulation.trials import TrialResult
from burg_drake.station.document import Engine, Station

if TYPE_CHECKING:
    from burg_drake.simulation.trials import TrialSettings

TESTS = ("tug", "shake", "friction", "noise")
HASH_DIGITS = 8
"""Digits of the hash in the id of a probe: answers found with other settings do not count."""


@dataclass(frozen=True, kw_only=True)
class RobustnessSettings:
    """What is asked about each grasp.

    Attributes:
        tests: some of `TESTS`.
        loads: of tug and shake.
        friction: coefficients that are tried.
        noise: standard deviations of the perturbed repeats.
        repeats: number of perturbed repeats.
        seed: of the perturbations.
    """

    tests: tuple[str, ...] = TESTS
    loads: LoadSettings = field(default_factory=LoadSettings)
    friction: FrictionSettings = field(default_factory=FrictionSettings)
    noise: Noise = field(default_factory=Noise)
    repeats: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        for test in self.tests:
            if test not in TESTS:
                raise UnknownNameError(f"test {test!r} does not exist; {nearest(test, TESTS)}")
        if not self.tests or self.repeats < 1:
            raise InvalidInputError("give at least one test, and repeats from 1")

    def content(self, test: str) -> list[object]:
        """What decides about the answers of a test."""
        if test == "friction":
            return [vars(self.friction)]
        return [vars(self.noise), self.seed] if test == "noise" else [vars(self.loads)]


@dataclass(frozen=True, eq=False)
class Probe(Candidate):
    """One question.

    Attributes:
        test: one of `TESTS`.
        grasp: id of the grasp; the probe's own `id` tells test, repeat and settings, too.
    """

    test: str = ""
    grasp: str = ""


def make_probes(
    grasp: Candidate, scene: Scene, settings: RobustnessSettings, context: Sequence[object]
) -> Iterator[Probe]:
    """All questions about a grasp that the settings ask.

    Args:
        grasp: the grasp.
        scene: gives mass and friction of the target.
        settings: what is asked.
        context: JSON values of what decides about the answers beside the settings.
    """
    for test in settings.tests:
        key = _key(test, settings, context)
        if test != "noise":
            id = _probe_id(grasp.id, test, key)
            yield Probe(id, grasp.instance, grasp.X_OG, lift=grasp.lift, test=test, grasp=grasp.id)
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
            yield Probe(
                _probe_id(grasp.id, test, key, repeat),
                grasp.instance,
                drawn.X_OG,
                drawn.friction,
                drawn.mass,
                lift=grasp.lift,
                test=test,
                grasp=grasp.id,
            )


def known_answers(
    grasp: str,
    answers: Mapping[str, Verdict],
    settings: RobustnessSettings,
    context: Sequence[object],
) -> list[tuple[str, Verdict]]:
    """Answers about a grasp, whichever call asked for them: all tests, and all repeats.

    Args:
        grasp: its id.
        answers: by the id of the probe.
        settings: only answers found with these count; tests and number of repeats do not matter.
        context: as for `make_probes`.

    Returns:
        Pairs of a test and its answer; of the repeats those up to the first that is missing.
    """
    found = []
    for test in TESTS:
        key = _key(test, settings, context)
        repeats: Iterable[int | None] = count() if test == "noise" else (None,)
        ids = (_probe_id(grasp, test, key, repeat) for repeat in repeats)
        found += [(test, answers[id]) for id in takewhile(answers.__contains__, ids)]
    return found


def _key(test: str, settings: RobustnessSettings, context: Sequence[object]) -> str:
    return content_hash(test, settings.content(test), list(context))[:HASH_DIGITS]


def _probe_id(grasp: str, test: str, key: str, repeat: int | None = None) -> str:
    return ":".join([grasp, test, *([] if repeat is None else [str(repeat)]), key])


class ProbeJudge:
    """Answers probes. There are no screens: what starts in a collision is an answer, too."""

    screens: tuple[Screen, ...] = ()

    def __init__(self, factory: ProbeJudgeFactory) -> None:
        from burg_drake.simulation.trials import HandTrial

        self._settings = factory.settings
        self._trial = HandTrial(
            factory.scene, factory.station, engine=factory.engine, settings=factory.trial
        )
        self.stages: list[tuple[Stage, Decide]] = [(Stage.EXECUTED, self._answer)]

    def _answer(self, probe: Candidate, motion: object) -> Decision:
        assert isinstance(probe, Probe)
        trial, settings, lift = self._trial, self._settings, probe.lift
        what = (probe.instance, probe.X_OG)
        if probe.test == "noise":
            return trial_decision(
                trial.run(*what, friction=probe.friction, mass=probe.mass, lift=lift)
            )
        if probe.test == "friction":
            limit = friction_limit(trial, *what, lift=lift, settings=settings.friction)
            return Decision(Outcome.LIFTED, margins={"friction": limit})
        grip = take_grip(trial, *what, lift=lift)
        if isinstance(grip, TrialResult):
            return trial_decision(grip)
        found = (tug if probe.test == "tug" else shake)(grip, settings.loads)
        return Decision(Outcome.LIFTED, margins={**found.accelerations, "weight": found.weight})


@dataclass(frozen=True)
class ProbeJudgeFactory:
    """What a worker process needs to build its `ProbeJudge`."""

    scene: Scene
    station: Station
    engine: Engine
    trial: TrialSettings
    settings: RobustnessSettings

    def __call__(self) -> ProbeJudge:
        return ProbeJudge(self)

    def content(self) -> list[object]:
        """What decides about answers beside the settings of the tests."""
        return [self.scene.content, self.station.content, asdict(self.engine), asdict(self.trial)]
