"""Trials of a planner's best grasps on a robot: which are tried, and how they ended."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from burg_drake.benchmark.benchmark_folder import BenchmarkResult, JudgedAnswer
from burg_drake.benchmark.measures import BenchmarkMeasure, precision_at
from burg_drake.core import (
    InvalidInputError,
    RealOutcome,
    count_with_noun,
    mean_interval,
)
from burg_drake.experiment import (
    SelectionSettings,
    Success,
    TrialSheet,
    grasp_contents,
    is_success,
    plan_trials,
)


def plan_robot_trials(
    results: Sequence[BenchmarkResult], out: str | Path, *, seed: int = 0
) -> TrialSheet:
    """Plans a trial of the best grasp of each image, in random order over all methods.

    Grasps that the arm cannot execute are left out; `robot_successes` counts them as failures.

    Args:
        results: complete benchmarks.
        out: trials file to write.
        seed: random seed of the order.

    Raises:
        InvalidInputError: a benchmark is not complete, the file has entries already, or no grasp
            can be executed.
    """
    chosen: dict[Path, set[str]] = {}
    for result in results:
        result.require_complete()
        (first, *_) = result.rounds
        for answer in result.judged_answers(first):
            folder = first.run_folder(answer.answer.scene)
            if answer.executed == 0:
                chosen.setdefault(folder, set()).add(answer.ids[0])
    if not chosen:
        raise InvalidInputError(
            f"none of the best grasps of {count_with_noun(len(results), 'result')} can be executed"
            " by the arm; there is nothing to try on the robot"
        )
    settings = SelectionSettings(per_object=1, balance="none", seed=seed)
    return plan_trials(list(chosen), settings=settings, grasps=chosen, out=out)


@dataclass(frozen=True)
class RobotSuccess:
    """Success of a method's best grasp of each image on the robot, and in simulation.

    Attributes:
        name: name of the method.
        real: share of images whose best grasp succeeded on the robot. While trials are open, they
            count as likely to succeed as those that were carried out, there is no interval, and
            `least` and `most` are the shares if all of them fail, or succeed.
        simulated: the same in simulation.
        agreement: share of tried grasps that ended alike, NaN if none was tried.
        rendered: success of the best grasp on rendered images of the same scenes; None if there is
            no such benchmark of the method.
        tried: number of grasps that were tried.
        infeasible: number of images without a grasp, or whose best one the arm cannot execute:
            failures.
        open: number of grasps that are still to be tried.
    """

    name: str
    real: BenchmarkMeasure
    simulated: BenchmarkMeasure
    agreement: float
    rendered: BenchmarkMeasure | None
    tried: int
    infeasible: int
    open: int


def robot_successes(
    results: Sequence[BenchmarkResult], sheets: Sequence[TrialSheet]
) -> list[RobotSuccess]:
    """Success on the robot of each method with grasps in trials files.

    A trial belongs to a grasp if scene, instance, pose and width are the same; of several trials of
    a grasp the first one that was carried out counts. A method on images of a real camera has no
    trials if the arm can execute none of its best grasps; it failed on all images.

    Args:
        results: complete benchmarks, also those on rendered images.
        sheets: contents of trials files.

    Raises:
        InvalidInputError: the trials have none of the grasps of the results.
    """
    trials: dict[tuple[str, str], _RobotTrial] = {}
    for sheet in sheets:
        for trial in sheet.trials:
            key = (sheet.runs[trial.run].scene.content, trial.content)
            if key not in trials or trials[key].is_open:
                trials[key] = _RobotTrial(trial.outcome, sheet.selection.success)
    twins = {result.path: _rendered_twin(result, results) for result in results}
    shown = [result for result in results if all(result is not twin for twin in twins.values())]
    tops: dict[Path, list[_TopGrasp]] = {
        result.path: [_top_grasp(result, one, trials) for one in result.answers if one.is_judged]
        for result in shown
    }
    if all(one.trial is None for found in tops.values() for one in found):
        raise InvalidInputError(
            "the trials have none of the best grasps of the results; give the trials files that"
            " were planned of them"
        )
    return [
        _robot_success(result, tops[result.path], twins[result.path])
        for result in shown
        if any(one.trial is not None for one in tops[result.path])
        or (result.document.images and not any(one.feasible for one in tops[result.path]))
    ]


@dataclass(frozen=True)
class _RobotTrial:
    """A trial: how it ended, None if it is open, and what counts as success."""

    outcome: RealOutcome | None
    success: Success

    @property
    def is_open(self) -> bool:
        return self.outcome is None or not self.outcome.attempted

    @property
    def succeeded(self) -> bool:
        return self.outcome is not None and is_success(self.outcome, self.success)


@dataclass(frozen=True)
class _TopGrasp:
    """The best grasp of an answer.

    Attributes:
        answer: the answer.
        feasible: whether there is one that the arm can execute.
        trial: its trial; None if it is in no trials file.
    """

    answer: JudgedAnswer
    feasible: bool
    trial: _RobotTrial | None

    @property
    def scene(self) -> str:
        return self.answer.answer.scene

    @property
    def is_open(self) -> bool:
        return self.feasible and (self.trial is None or self.trial.is_open)

    @property
    def real(self) -> bool:
        return self.trial is not None and self.trial.succeeded

    @property
    def simulated(self) -> bool:
        """Success in simulation, as the trials count it."""
        verdict = self.answer.verdicts[0] if self.feasible else None
        if verdict is None:
            return False
        return is_success(verdict.outcome, self.trial.success if self.trial else "lifted")


def _top_grasp(
    result: BenchmarkResult,
    answer: JudgedAnswer,
    trials: Mapping[tuple[str, str], _RobotTrial],
) -> _TopGrasp:
    if answer.executed != 0:
        return _TopGrasp(answer, False, None)
    campaign = result.rounds[0].campaign
    assert campaign is not None
    run = campaign.run(answer.answer.scene)
    (content,) = grasp_contents(run, [answer.ids[0]]).values()
    return _TopGrasp(answer, True, trials.get((run.document.scene.content, content)))


def _robot_success(
    result: BenchmarkResult, tops: Sequence[_TopGrasp], rendered: BenchmarkResult | None
) -> RobotSuccess:
    scenes = {one.scene for one in tops}
    tried = [one for one in tops if one.feasible and not one.is_open]
    alike = [one.real == one.simulated for one in tried]
    conditions = result.document.conditions
    return RobotSuccess(
        name=result.document.name + (f", {conditions}" if conditions.changes else ""),
        real=_real_share(tops),
        simulated=_share([(one.scene, one.simulated) for one in tops]),
        agreement=float(np.mean(alike)) if alike else math.nan,
        rendered=None if rendered is None else _share(_top_successes(rendered, scenes)),
        tried=len(tried),
        infeasible=sum(not one.feasible for one in tops),
        open=sum(one.is_open for one in tops),
    )


def _real_share(tops: Sequence[_TopGrasp]) -> BenchmarkMeasure:
    """Share of successes on the robot; see `RobotSuccess.real`."""
    n_open = sum(one.is_open for one in tops)
    if not n_open:
        return _share([(one.scene, one.real) for one in tops])
    succeeded = sum(one.real for one in tops)
    tried = sum(one.feasible for one in tops) - n_open
    likely = succeeded + n_open * succeeded / tried if tried else math.nan
    shares = [count / len(tops) for count in (likely, succeeded, succeeded + n_open)]
    return BenchmarkMeasure(shares[0], math.nan, math.nan, *shares[1:])


def _top_successes(rendered: BenchmarkResult, scenes: Collection[str]) -> list[tuple[str, float]]:
    """Success of the best grasps on rendered images of the first camera, by scene."""
    camera = rendered.suite.cameras[0].name
    return [
        (one.answer.scene, precision_at(one, 1))
        for one in rendered.answers
        if one.answer.scene in scenes and one.answer.camera == camera and one.is_judged
    ]


def _share(values: Sequence[tuple[str, float]]) -> BenchmarkMeasure:
    """Mean of the values of images, given with their scenes, with its interval over scenes; NaN
    without any."""
    if not values:
        return BenchmarkMeasure(*[math.nan] * 5)
    by_scene: dict[str, list[float]] = {}
    for scene, value in values:
        by_scene.setdefault(scene, []).append(value)
    means = np.array([np.mean(found) for found in by_scene.values()])
    mean = float(means.mean())
    return BenchmarkMeasure(mean, *mean_interval(means), mean, mean)


def _rendered_twin(
    result: BenchmarkResult, results: Sequence[BenchmarkResult]
) -> BenchmarkResult | None:
    """The benchmark of the same method on rendered images of the same suite, if there is one."""
    if not result.document.images:
        return None
    known = result.document
    for other in results:
        one = other.document
        if one.images or one.conditions != known.conditions or one.protocol != known.protocol:
            continue
        if (one.name, one.suite_hash) == (known.name, known.suite_hash) and (
            (one.split, one.depth_only) == (known.split, known.depth_only)
        ):
            return other
    return None
