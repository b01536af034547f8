"""Verifies a result: judges a random sample of its grasps again, and compares to the bit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from burg_drake.benchmark.benchmark_folder import (
    FRICTION_COLUMN,
    BenchmarkResult,
    JudgedAnswer,
    Round,
    load_result,
)
from burg_drake.benchmark.benchmark_run import with_friction_needed
from burg_drake.benchmark.settings import VERIFIED_GRASPS
from burg_drake.benchmark.suite import SuiteDocument
from burg_drake.core import (
    GraspSet,
    InvalidInputError,
    Listener,
    Progress,
    ProgressMeter,
    Reporter,
    map_unordered,
    software_versions,
    worker_count,
)
from burg_drake.evaluation import (
    comparison,
    differences,
    load_run,
    origin_of,
    replay_engine,
    rerun,
)


@dataclass(frozen=True)
class VerifiedGrasp:
    """A grasp that was judged again.

    Attributes:
        run, id: folder of the scene's run, and id of the grasp.
        text: `as recorded`, or what differs, in lines.
        same: whether all results are the same to the bit.
    """

    run: str
    id: str
    text: tuple[str, ...]
    same: bool


@dataclass(frozen=True)
class Verification:
    """Result of `verify_result`.

    Attributes:
        grasps: the grasps that were judged again, by run.
        notes: packages whose versions differ from those of the result.
    """

    grasps: tuple[VerifiedGrasp, ...]
    notes: tuple[str, ...] = ()

    @property
    def differing(self) -> list[VerifiedGrasp]:
        """Grasps whose results differ."""
        return [grasp for grasp in self.grasps if not grasp.same]


def verify_result(
    result: BenchmarkResult | str | Path,
    *,
    count: int = VERIFIED_GRASPS,
    seed: int = 0,
    workers: int | None = None,
    progress: bool | Listener = True,
) -> Verification:
    """Judges a random sample of the grasps of a benchmark again.

    Times, and the numbers of answered grasps, are those that the benchmark recorded.

    Args:
        result: a complete benchmark, or its folder.
        count: number of grasps; all if there are fewer.
        seed: seed of the choice.
        workers: number of processes; one per processor if None.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        InvalidInputError: the benchmark is not complete, or its answers and verdicts do not belong
            together.
    """
    found = result if isinstance(result, BenchmarkResult) else load_result(result)
    found.require_complete()
    judged: dict[tuple[Path, str], float] = {}  # cameras may share a grasp
    for round in found.rounds:
        answers = found.judged_answers(round)
        _require_consistent(round, answers, found.suite)
        for one in answers:
            needed = one.answer.grasps.columns[FRICTION_COLUMN].tolist()
            for id, verdict, friction in zip(one.ids, one.verdicts, needed, strict=True):
                if verdict is not None:
                    judged[round.run_folder(one.answer.scene), id] = friction
    rng = np.random.default_rng(seed)
    chosen = sorted(rng.permutation(len(judged))[:count].tolist())
    every = [(folder, id, friction) for (folder, id), friction in judged.items()]
    work = [every[k] for k in chosen]
    again: list[VerifiedGrasp] = []
    with Reporter(progress) as reporter:
        meter = ProgressMeter(reporter.show, Progress("verifying", total=len(work)))
        for _, grasp in map_unordered(_judge_again, work, worker_count(workers)):
            if isinstance(grasp, BaseException):
                raise grasp
            again.append(grasp)
            meter.step()
    again.sort(key=lambda grasp: (grasp.run, grasp.id))
    return Verification(tuple(again), tuple(_version_notes(found)))


def _require_consistent(
    round: Round, answers: Sequence[JudgedAnswer], suite: SuiteDocument
) -> None:
    """Refuses verdicts of other answers or in another way, and missing verdicts.

    Raises:
        InvalidInputError: the message says which.
    """
    campaign = round.campaign
    content = round.stored_grasps().content
    if campaign is not None and campaign.document.grasps.content != content:
        raise InvalidInputError(
            f"{campaign.path}: the verdicts are not those of the answers, which have changed since"
        )
    if campaign is not None:
        judged = campaign.document.mode, campaign.document.engine.name
        if judged != (suite.mode, suite.engine):
            raise InvalidInputError(
                f"{campaign.path}: the grasps were judged in mode {judged[0]} with engine"
                f" {judged[1]}; the suite says {suite.mode} and {suite.engine}"
            )
    failed = {} if campaign is None else campaign.failed
    for one in answers:
        if None in one.verdicts and one.answer.scene not in failed:
            raise InvalidInputError(
                f"{round.path}: grasps of scene {one.answer.scene} have no verdict, so the result"
                " has been changed"
            )


def _judge_again(work: tuple[Path, str, float]) -> VerifiedGrasp:
    """Judges one grasp of a scene again, and finds again the friction that it needs."""
    folder, id, friction = work
    run = load_run(folder)
    trial = run.trial(id)
    assert trial.verdict is not None
    origin = origin_of(run.document).judged_by(trial.verdict.judged_again)
    scene, station = run.scene(), run.station()
    engine = replay_engine(origin)
    now, _ = rerun(scene, station, trial, origin, engine)
    found = differences(trial.verdict, now)
    text = list(comparison(found, origin, engine))
    object = scene.instance(trial.instance).object
    grasp = GraspSet.create(trial.X_OG[None], object=object)
    (needed,) = with_friction_needed(grasp, scene, station).columns[FRICTION_COLUMN]
    same_friction = bool(np.isclose(needed, friction, rtol=1e-9, equal_nan=True))
    if not same_friction:
        text.append(f"needed friction: {friction:g} recorded, {needed:g} now")
    return VerifiedGrasp(str(folder), id, tuple(text), not found and same_friction)


def _version_notes(result: BenchmarkResult) -> Sequence[str]:
    """Packages with another version than in the result."""
    here = software_versions()
    return [
        f"{name} is {here[name]} here, {then} in the result"
        for name, then in result.document.versions.items()
        if name in here and here[name] != then
    ]
