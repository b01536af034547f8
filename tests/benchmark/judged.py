"""Made-up answers with verdicts, for tests of measures and comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from burg_drake.benchmark import (
    BenchmarkDocument,
    BenchmarkResult,
    Budget,
    JudgedAnswer,
    StoredAnswer,
    SuiteCamera,
    SuiteDocument,
    SuiteScene,
)
from burg_drake.core import GraspSet, Outcome, Pose, Stage, Verdict
from burg_drake.scene import Instance


def verdict(outcome: Outcome, confidence: float = 1.0) -> Verdict:
    return Verdict(outcome, outcome.stage, confidence=confidence)


def judged(
    scene: str,
    verdicts: Sequence[Verdict | None],
    friction: Sequence[float] = (),
    error: str = "",
) -> JudgedAnswer:
    n = len(verdicts)
    X_OG = np.tile(np.eye(4), (n, 1, 1))
    X_OG[:, 0, 3] = 0.1 * np.arange(n)
    needed = np.array(friction or [0.1] * n, dtype=float)
    columns = {"instance": np.full(n, "mug"), "friction_needed": needed}
    grasps = GraspSet.create(X_OG, object="mug", columns=columns)
    return JudgedAnswer(
        StoredAnswer(scene, "front", grasps, "0", 0.5, n, error),
        tuple(verdicts),
        None not in verdicts,
    )


def result(
    answers: Sequence[JudgedAnswer],
    name: str = "method",
    grasps: int = 4,
    suite_hash: str = "0" * 16,
) -> BenchmarkResult:
    """A complete single-shot benchmark with these answers, which is in no folder."""
    scenes = dict.fromkeys(one.answer.scene for one in answers)
    suite = SuiteDocument(
        name="made_up",
        library="household",
        cameras=(SuiteCamera(X_SC=Pose()),),
        budget=Budget(grasps=grasps),
        scenes=tuple(SuiteScene(name=n, instances=(Instance(object="mug"),)) for n in scenes),
    )
    document = BenchmarkDocument(
        command="",
        complete=True,
        name=name,
        planner=name,
        suite="made_up",
        release=1,
        suite_hash=suite_hash,
    )
    found = BenchmarkResult(Path("nowhere", name), document, suite)
    found.__dict__["answers"] = list(answers)
    return found


LIFTED = verdict(Outcome.LIFTED)
SLIPPED = verdict(Outcome.SLIPPED)
COLLIDES = verdict(Outcome.COLLISION_TARGET)
OUT_OF_REACH = verdict(Outcome.NO_IK)
CONTESTED = verdict(Outcome.LIFTED, confidence=0.6)
FAILED = Verdict(Outcome.SIMULATION_FAILED, Stage.EXECUTED)
