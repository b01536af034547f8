"""The cascade of one grasp: the first stage that decides has the last word."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pytest

from burg_drake.core.outcome import Outcome, Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import MARGINS, Decision, judge_grasp

GRASP = Candidate("cube-1", "cube", np.eye(4))


@dataclass
class Scripted:
    """Stages that answer from a list; an exception is raised."""

    answers: list[Decision | Exception]

    @property
    def stages(self):  # type: ignore[no-untyped-def]
        return [(s, self.answer(a)) for s, a in zip(Stage, self.answers, strict=True)]

    def answer(self, answer: Decision | Exception):  # type: ignore[no-untyped-def]
        def decide(grasp: Candidate) -> Decision:
            if isinstance(answer, Exception):
                raise answer
            return answer

        return decide


def test_the_first_outcome_decides_and_later_stages_are_not_asked() -> None:
    reached = Decision(q_grasp=(1.0, 2.0), q_pregrasp=(3.0,))
    judge = Scripted([Decision(margins={"overlap": 0.0}), reached, Decision(Outcome.DROPPED)])
    asked: list[Stage] = []
    verdict = judge_grasp(judge, GRASP, asked.append)
    assert (verdict.outcome, verdict.stage) == (Outcome.DROPPED, Stage.EXECUTED)
    assert verdict.q_grasp == (1.0, 2.0) and verdict.q_pregrasp == (3.0,)
    assert verdict.margins == {"overlap": 0.0}
    assert asked == list(verdict.cpu) == list(Stage)

    judge.answers[1] = Decision(Outcome.ARM_COLLISION, "table", q_grasp=(1.0,))
    verdict = judge_grasp(judge, GRASP)
    assert (verdict.outcome, verdict.stage) == (Outcome.ARM_COLLISION, Stage.REACHABLE)
    assert verdict.blocker == "table"
    assert list(verdict.cpu) == [Stage.CLEAR, Stage.REACHABLE]


def test_an_error_is_the_outcome_of_the_stage_it_came_from() -> None:
    judge = Scripted([Decision(), ValueError("no\n  good"), Decision(Outcome.LIFTED)])
    verdict = judge_grasp(judge, GRASP)
    assert (verdict.outcome, verdict.stage) == (Outcome.SIMULATION_FAILED, Stage.REACHABLE)
    assert verdict.reason == "ValueError: no good"


def test_a_judge_without_a_last_word_is_a_mistake() -> None:
    with pytest.raises(ValueError, match="last stage"):
        judge_grasp(Scripted([Decision(), Decision(), Decision()]), GRASP)


def test_margins_are_those_of_the_trial() -> None:
    from burg_drake.simulation.result import Margins

    assert tuple(field.name for field in fields(Margins)) == MARGINS
