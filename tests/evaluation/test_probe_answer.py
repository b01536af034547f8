"""Answers about robustness keep their numbers on the way through a journal."""

from __future__ import annotations

import math

import pytest

from burg_drake.core import Outcome, Stage, Verdict
from burg_drake.evaluation import ProbeAnswer, decode_verdict, encode_verdict, gather_answers
from burg_drake.simulation import HoldForces


def kept(answer: ProbeAnswer) -> ProbeAnswer:
    """The answer after a worker has returned it and a journal has kept it."""
    decision = answer.decision()
    assert decision.outcome is not None
    verdict = Verdict(decision.outcome, Stage.EXECUTED, margins=decision.margins)
    return ProbeAnswer.from_verdict(answer.test, decode_verdict(encode_verdict("a", verdict))[1])


@pytest.mark.parametrize(
    "answer",
    [
        ProbeAnswer("tug", forces=HoldForces({"+x": 1 / 3, "-x": math.inf, "+y": 0.0}, 4.03)),
        ProbeAnswer("shake", forces=HoldForces({"x": 0.1, "y": 0.2, "z": math.inf}, 0.5)),
        ProbeAnswer("friction", friction=0.1 / 3),
        ProbeAnswer("friction", friction=math.inf),
        ProbeAnswer("noise", Outcome.LIFTED),
        ProbeAnswer("noise", Outcome.SLIPPED),
        ProbeAnswer("tug", Outcome.SIMULATION_FAILED),
    ],
)
def test_a_journal_keeps_an_answer(answer: ProbeAnswer) -> None:
    assert kept(answer) == answer
    assert answer.failed == (answer.outcome is Outcome.SIMULATION_FAILED)


def test_a_repeat_that_fails_is_counted_and_a_test_that_fails_is_named() -> None:
    answers = [
        ProbeAnswer("tug", Outcome.NO_CONTACT),
        ProbeAnswer("friction", friction=0.2),
        ProbeAnswer("noise", Outcome.LIFTED),
        ProbeAnswer("noise", Outcome.SIMULATION_FAILED),
    ]
    found = gather_answers("mug-1", "mug", "mug", 0.5, answers)
    assert found.tug is None and found.shake is None and found.friction_min == 0.2
    assert found.failed == ("tug",)
    assert found.success is not None
    assert (found.success.lifted, found.success.trials) == (1, 2)
