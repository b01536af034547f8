"""The cascade of one grasp: the first stage that decides has the last word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pytest

from burg_drake.core import MarginNames, Margins, Outcome, Stage
from burg_drake.evaluation import (
    Candidate,
    Decision,
    JudgingState,
    SamplingSettings,
    Screen,
    judge_grasp,
    sample_candidates,
    screen_grasps,
)
from burg_drake.scene import load_scene
from burg_drake.station import ENGINES, load_station

GRASP = Candidate("cube-1", "cube", np.eye(4))


@dataclass
class Scripted:
    """Stages that answer from a list, the first two as screens; an exception is raised.

    `seen` are the motions that they were given.
    """

    answers: list[Decision | Exception]
    seen: list[object] = field(default_factory=list)

    def ask(self, k: int, grasps: Sequence[Candidate]) -> list[Decision]:
        return [self.answer(self.answers[k])(grasp, None) for grasp in grasps]

    @property
    def screens(self) -> list[Screen]:
        return [Screen(s, partial(self.ask, k), 8) for k, s in enumerate(list(Stage)[:2])]

    @property
    def stages(self):  # type: ignore[no-untyped-def]
        stages = list(Stage)[2:]
        return [(s, self.answer(a)) for s, a in zip(stages, self.answers[2:], strict=True)]

    def answer(self, answer: Decision | Exception):  # type: ignore[no-untyped-def]
        def decide(grasp: Candidate, motion: object) -> Decision:
            self.seen.append(motion)
            if isinstance(answer, Exception):
                raise answer
            return answer

        return decide


def test_the_first_outcome_decides_and_later_stages_are_not_asked() -> None:
    reached = Decision(q_grasp=(1.0, 2.0), q_pregrasp=(3.0,))
    clear, planned = Decision(margins={"overlap": 0.0}), Decision(margins={"duration": 5.0})
    judge = Scripted([clear, reached, planned, Decision(Outcome.DROPPED)])
    asked: list[Stage] = []
    verdict = judge_grasp(judge, GRASP, announce=asked.append)
    assert (verdict.outcome, verdict.stage) == (Outcome.DROPPED, Stage.EXECUTED)
    assert verdict.q_grasp == (1.0, 2.0) and verdict.q_pregrasp == (3.0,)
    assert verdict.margins == {"overlap": 0.0, "duration": 5.0}
    assert asked == list(verdict.cpu) == list(Stage)

    judge.answers[1] = Decision(Outcome.ARM_COLLISION, blocker="table", q_grasp=(1.0,))
    verdict = judge_grasp(judge, GRASP)
    assert (verdict.outcome, verdict.stage) == (Outcome.ARM_COLLISION, Stage.REACHABLE)
    assert verdict.blocker == "table"
    assert list(verdict.cpu) == [Stage.CLEAR, Stage.REACHABLE]


def test_an_error_is_the_outcome_of_the_stage_it_came_from() -> None:
    judge = Scripted([Decision(), ValueError("no\n  good"), Decision(), Decision()])
    verdict = judge_grasp(judge, GRASP)
    assert (verdict.outcome, verdict.stage) == (Outcome.SIMULATION_FAILED, Stage.REACHABLE)
    assert verdict.reason == "ValueError: no good"


def test_what_was_screened_before_is_not_asked_again() -> None:
    judge = Scripted([ValueError("asked"), Decision(), Decision(), Decision(Outcome.LIFTED)])
    asked: list[Stage] = []
    passed = JudgingState().with_decision(Stage.CLEAR, Decision(margins={"overlap": 0.0}), 2.5e-5)
    verdict = judge_grasp(judge, GRASP, passed, asked.append)
    assert asked == list(Stage)[1:]
    assert verdict.outcome is Outcome.LIFTED and verdict.margins == {"overlap": 0.0}
    assert list(verdict.cpu) == list(Stage) and verdict.cpu[Stage.CLEAR] == 2.5e-5

    rejected = JudgingState().with_decision(
        Stage.CLEAR, Decision(Outcome.COLLISION_TABLE, blocker="table"), 2.5e-5
    )
    verdict = judge_grasp(judge, GRASP, rejected, asked.append)
    assert (verdict.outcome, verdict.stage) == (Outcome.COLLISION_TABLE, Stage.CLEAR)
    assert verdict.blocker == "table" and verdict.cpu == {Stage.CLEAR: 2.5e-5}
    assert len(asked) == 3


def test_the_arm_screen_decides_about_two_stages() -> None:
    """One question, whose answer may be that the arm cannot be there, or cannot move there."""
    for outcome, stage in (
        (Outcome.JOINT_LIMIT, Stage.REACHABLE),
        (Outcome.LIFT_LINE, Stage.PLANNED),
    ):
        judge = Scripted([Decision(), Decision(outcome, blocker="shelf"), Decision(), Decision()])
        verdict = judge_grasp(judge, GRASP)
        assert (verdict.outcome, verdict.stage) == (outcome, stage)
        assert list(verdict.cpu) == [Stage.CLEAR, Stage.REACHABLE]


def test_a_motion_reaches_the_stages_after_the_one_that_found_it() -> None:
    first, second = object(), object()
    found, timed = Decision(motion=first), Decision(motion=second)  # type: ignore[arg-type]
    judge = Scripted([Decision(), found, timed, Decision(Outcome.LIFTED)])
    judge_grasp(judge, GRASP)
    assert judge.seen == [None, None, first, second]


def test_a_later_stage_does_not_unsay_a_margin() -> None:
    trial = Decision(Outcome.LIFTED, margins={"overlap": np.nan, "slip": np.nan, "clearance": 0.02})
    first = Decision(margins={"overlap": 0.0, "clearance": 0.01})
    judge = Scripted([first, Decision(), Decision(), trial])
    margins = judge_grasp(judge, GRASP).margins
    assert margins["overlap"] == 0.0 and np.isnan(margins["slip"])
    assert margins["clearance"] == 0.02  # measured again


@dataclass
class Picky(Scripted):
    """Cannot screen the grasp `cube-1`."""

    def ask(self, k: int, grasps: Sequence[Candidate]) -> list[Decision]:
        if any(grasp.id == GRASP.id for grasp in grasps):
            raise ValueError("not this one")
        return [Decision() for _ in grasps]


def test_an_error_while_screening_is_that_of_one_grasp() -> None:
    ids = ("cube-0", "cube-1", "cube-2")
    grasps = [(Candidate(id, "cube", np.eye(4)), JudgingState()) for id in ids]
    screened = screen_grasps(Picky([]), grasps)
    assert [s.outcome for s in screened] == [None, Outcome.SIMULATION_FAILED, None]
    verdict = screened[1].verdict()
    assert (verdict.stage, verdict.reason) == (Stage.CLEAR, "ValueError: not this one")
    assert all(s.cpu[Stage.CLEAR] > 0.0 for s in screened)
    assert screen_grasps(Picky([]), []) == []


def test_grasps_screened_together_get_the_answers_of_each_alone() -> None:
    """To the last bit, and on instances in any order: the trial asks about its grasp again."""
    from burg_drake.evaluation import build_judge
    from burg_drake.simulation import HandTrial

    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    judge = build_judge(scene, station, engine=ENGINES["standard"], mode="hand")
    (screen,) = judge.screens
    sampled = list(sample_candidates(scene, station, 15, 3, SamplingSettings(blind=True)))
    grasps = [sampled[k] for k in np.random.default_rng(0).permutation(len(sampled))]
    together = screen.ask(grasps)
    assert 5 < sum(d.outcome is None for d in together) < len(grasps) - 5
    trial = HandTrial(scene, station)
    for grasp, decision in zip(grasps, together, strict=True):
        assert screen.ask([grasp]) == [decision]
        X_WG = trial.diagram.X_WO(grasp.instance) @ grasp.X_OG
        found = trial.clearance.check(grasp.instance, X_WG)
        assert (found.outcome, found.blocker) == (decision.outcome, decision.blocker)
        margins = {"overlap": found.overlap, "clearance": found.clearance}
        assert decision.margins == margins
        assert (found.clearance >= 0.0) == (found.outcome is None)


def test_a_judge_without_a_last_word_is_a_mistake() -> None:
    with pytest.raises(ValueError, match="last stage"):
        judge_grasp(Scripted([Decision()] * 4), GRASP)


def test_a_trial_measures_the_margins_that_no_stage_before_it_does() -> None:
    before = {"lift_height", "arm_clearance", "joint_excess", "duration"}
    assert Margins().of_trial().keys() == {*MarginNames.all} - before
