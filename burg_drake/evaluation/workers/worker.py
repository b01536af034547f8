"""What workers do: build a judge, screen grasps, judge a grasp."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from burg_drake.core import BurgError, SimulationError, one_line
from burg_drake.core.grasps import Verdict
from burg_drake.core.workers import report_progress
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages import Judge, ScreenAnswers, judge_grasp, screen_grasps

Grasp = tuple[Candidate, ScreenAnswers]
"""A grasp with the answers of the screens that have been asked."""


def build_judge(make_judge: Callable[[], Judge]) -> Judge:
    """Builds a judge.

    Raises:
        BurgError: it cannot be built.
    """
    try:
        return make_judge()
    except BurgError:
        raise
    except Exception as error:
        raise SimulationError(f"cannot build the simulation: {one_line(error)}") from error


def screen_sizes(judge: Judge) -> tuple[int, ...]:
    """How many grasps to screen at a time, by screen."""
    return tuple(screen.batch for screen in judge.screens)


def screen_batch(judge: Judge, grasps: Sequence[Grasp]) -> list[ScreenAnswers]:
    """The next screen of many grasps: all answers so far, in their order."""
    return list(screen_grasps(judge, grasps))


def judge_one(judge: Judge, candidate: Candidate, answers: ScreenAnswers) -> Verdict:
    """Asks all that is left to ask about a grasp; reports each stage that begins.

    Args:
        judge: the stages.
        candidate: the grasp.
        answers: of the screens that have been asked.
    """
    return judge_grasp(judge, candidate, report_progress, answers)
