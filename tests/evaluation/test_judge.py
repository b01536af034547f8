"""The cascade of one grasp: the first stage that decides has the last word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import pytest

from burg_drake.core.outcome import Outcome, Stage
from burg_drake.evaluation.candidate_sampling import sample_candidates
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import MARGINS, Decision, Screened, judge_grasp, screen_grasps
from burg_drake.scene.scene import load_scene
from burg_drake.station.engine import ENGINES
from burg_drake.station.station import load_station

GRASP = Candidate("cube-1", "cube", np.eye(4))


@dataclass
class Scripted:
    """Stages that answer from a list; an exception is raised."""

    answers: list[Decision | Exception]

    def screen(self, grasps: Sequence[Candidate]) -> list[Decision]:
        return [self.answer(self.answers[0])(grasp) for grasp in grasps]

    @property
    def stages(self):  # type: ignore[no-untyped-def]
        stages = list(Stage)[1:]
        return [(s, self.answer(a)) for s, a in zip(stages, self.answers[1:], strict=True)]

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


def test_what_was_screened_before_is_not_asked_again() -> None:
    judge = Scripted([ValueError("asked"), Decision(), Decision(Outcome.LIFTED)])
    asked: list[Stage] = []
    passed = Screened(Decision(margins={"overlap": 0.0}), cpu=2.5e-5)
    verdict = judge_grasp(judge, GRASP, asked.append, passed)
    assert asked == [Stage.REACHABLE, Stage.EXECUTED]
    assert verdict.outcome is Outcome.LIFTED and verdict.margins == {"overlap": 0.0}
    assert list(verdict.cpu) == list(Stage) and verdict.cpu[Stage.CLEAR] == 2.5e-5

    rejected = Screened(Decision(Outcome.COLLISION_TABLE, "table"), cpu=2.5e-5)
    verdict = judge_grasp(judge, GRASP, asked.append, rejected)
    assert (verdict.outcome, verdict.stage) == (Outcome.COLLISION_TABLE, Stage.CLEAR)
    assert verdict.blocker == "table" and verdict.cpu == {Stage.CLEAR: 2.5e-5}
    assert len(asked) == 2


@dataclass
class Picky(Scripted):
    """Cannot screen the grasp `cube-1`."""

    def screen(self, grasps: Sequence[Candidate]) -> list[Decision]:
        if any(grasp.id == GRASP.id for grasp in grasps):
            raise ValueError("not this one")
        return [Decision() for _ in grasps]


def test_an_error_while_screening_is_that_of_one_grasp() -> None:
    grasps = [Candidate(id, "cube", np.eye(4)) for id in ("cube-0", "cube-1", "cube-2")]
    screened = screen_grasps(Picky([]), grasps)
    assert [s.decision.outcome for s in screened] == [None, Outcome.SIMULATION_FAILED, None]
    verdict = screened[1].verdict()
    assert (verdict.stage, verdict.reason) == (Stage.CLEAR, "ValueError: not this one")
    assert all(s.cpu > 0.0 for s in screened)
    assert screen_grasps(Picky([]), []) == []


def test_grasps_screened_together_get_the_answers_of_each_alone() -> None:
    """To the last bit, and on instances in any order: the trial asks about its grasp again."""
    from burg_drake.evaluation.judge import StationJudge
    from burg_drake.simulation.hand_trial import HandTrial

    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    judge = StationJudge(scene, station, engine=ENGINES["standard"], reach=False)
    sampled = list(sample_candidates(scene, station, 25, seed=3))
    grasps = [sampled[k] for k in np.random.default_rng(0).permutation(len(sampled))]
    together = judge.screen(grasps)
    assert 5 < sum(d.outcome is None for d in together) < len(grasps) - 5
    trial = HandTrial(scene, station)
    for grasp, decision in zip(grasps, together, strict=True):
        assert judge.screen([grasp]) == [decision]
        X_WG = trial.diagram.X_WO(grasp.instance) @ grasp.X_OG
        found = trial.clearance.check(grasp.instance, X_WG)
        assert (found.outcome, found.blocker) == (decision.outcome, decision.blocker)
        margins = {"overlap": found.overlap, "clearance": found.clearance}
        assert decision.margins == margins
        assert (found.clearance >= 0.0) == (found.outcome is None)


def test_a_judge_without_a_last_word_is_a_mistake() -> None:
    with pytest.raises(ValueError, match="last stage"):
        judge_grasp(Scripted([Decision(), Decision(), Decision()]), GRASP)


def test_margins_are_those_of_the_trial() -> None:
    from burg_drake.simulation.result import Margins

    assert tuple(field.name for field in fields(Margins)) == MARGINS
