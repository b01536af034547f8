"""What is asked about the robustness of one grasp.

A probe is one question about one grasp: how hard it can be tugged or shaken, how much friction it
needs, or what becomes of one perturbed repeat of its trial. What an answer is, is in
`probe_answer`; how a worker finds it, in `probe_judge`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, takewhile

from burg_drake.core import content_hash
from burg_drake.core.grasps import Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.robustness.probe_answer import ProbeAnswer
from burg_drake.evaluation.robustness.settings import TESTS, RobustnessSettings
from burg_drake.scene.document import Scene
from burg_drake.simulation.robustness import perturb

HASH_DIGITS = 8
"""Digits of the hash in the id of a probe: answers found with other settings do not count."""


@dataclass(frozen=True, eq=False)
class Probe:
    """One question.

    Attributes:
        test: one of `TESTS`.
        grasp: id of the grasp.
        trial: the grasp as it is tried, perturbed or not; its id tells test, repeat and settings.
    """

    test: str
    grasp: str
    trial: Candidate

    @property
    def id(self) -> str:
        """Under which the answer is kept."""
        return self.trial.id


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
            trial = Candidate(id, grasp.instance, grasp.X_OG, lift=grasp.lift)
            yield Probe(test, grasp.id, trial)
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
            yield Probe(test, grasp.id, trial)


def known_answers(
    grasp: str,
    answers: Mapping[str, Verdict],
    settings: RobustnessSettings,
    context: Sequence[object],
) -> list[ProbeAnswer]:
    """Answers about a grasp, whichever call asked for them: all tests, and all repeats.

    Args:
        grasp: its id.
        answers: by the id of the probe, as a journal has them.
        settings: only answers found with these count; tests and number of repeats do not matter.
        context: as for `make_probes`.

    Returns:
        In the order of tests; of the repeats those up to the first that is missing.
    """
    found: list[ProbeAnswer] = []
    for test in TESTS:
        key = _key(test, settings, context)
        repeats: Iterable[int | None] = count() if test == "noise" else (None,)
        ids = (_probe_id(grasp, test, key, repeat) for repeat in repeats)
        known = takewhile(answers.__contains__, ids)
        found += [ProbeAnswer.from_verdict(test, answers[id]) for id in known]
    return found


def _key(test: str, settings: RobustnessSettings, context: Sequence[object]) -> str:
    return content_hash(test, settings.content(test), list(context))[:HASH_DIGITS]


def _probe_id(grasp: str, test: str, key: str, repeat: int | None = None) -> str:
    return ":".join([grasp, test, *([] if repeat is None else [str(repeat)]), key])
