"""What a scene looks like after a grasp: the protocol `clear`, in which objects are taken away."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.benchmark.benchmark_folder import BenchmarkResult, JudgedAnswer
from burg_drake.core import (
    Array,
    InvalidInputError,
    Outcome,
    Pose,
    SimulationError,
    Verdict,
    inverse,
    make_pose,
)
from burg_drake.evaluation import (
    judge_grasp,
    judge_of_trial,
    load_run,
    origin_of,
)
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import settle_scene
from burg_drake.station import Station, instance_pose

MAX_FAILURES = 3
"""Failed attempts in a row after which a scene is given up."""


@dataclass(frozen=True)
class ExecutedGrasp:
    """The grasp that the robot executes in a scene.

    Attributes:
        run: folder of the scene's run.
        id: id of the grasp.
    """

    run: Path
    id: str


def scene_after(work: tuple[Scene, ExecutedGrasp]) -> Scene:
    """The scene after a grasp, at rest: without the object if it is held, and without objects that
    fell off the table.

    The grasp is executed again, with the same result to the bit, to see where all objects are at
    its end. What can move then comes to rest as physics says.
    """
    scene, grasp = work
    run = load_run(grasp.run)
    trial, station = run.trial(grasp.id), run.station()
    assert trial.verdict is not None
    if trial.verdict.outcome is Outcome.SIMULATION_FAILED:
        return scene
    origin = origin_of(run.document).judged_by(trial.verdict.judged_again)
    judge = judge_of_trial(scene, station, trial, origin)
    judge_grasp(judge, trial.candidate)
    poses = judge.trial.final_poses()
    if trial.verdict.outcome.held:
        poses.pop(trial.instance)
    return settle_after(scene, station, poses, trial.instance)


def settle_after(scene: Scene, station: Station, X_WO: Mapping[str, Array], target: str) -> Scene:
    """The scene at rest, starting from given poses.

    A target that was let go in contact with something may overlap it a little; it is raised until
    it does not. If that does not help, it is put back where it stood, and at last all objects.

    Args:
        scene: the scene before.
        station: the station.
        X_WO: (4, 4) poses of the objects that are still there, by instance.
        target: the object that was grasped.
    """
    clearances = (0.0, 0.002, 0.005, 0.01, 0.02, 0.05)  # Metres that the target is raised by.
    for height in clearances:
        raised = {
            name: make_pose(X[:3, :3], X[:3, 3] + [0.0, 0.0, height]) if name == target else X
            for name, X in X_WO.items()
        }
        try:
            return _settled(_moved_scene(scene, station, raised), station)
        except (InvalidInputError, SimulationError):
            continue
    standing = {name: X for name, X in X_WO.items() if name != target}
    if target in X_WO:
        standing[target] = instance_pose(scene, station, target)
    try:
        return _settled(_moved_scene(scene, station, standing), station)
    except (InvalidInputError, SimulationError):
        kept = {name: instance_pose(scene, station, name) for name in X_WO}
        return _moved_scene(scene, station, kept)


def _settled(scene: Scene, station: Station) -> Scene:
    return settle_scene(scene, station).scene if scene.instances else scene


def _moved_scene(scene: Scene, station: Station, X_WO: Mapping[str, Array]) -> Scene:
    """The scene with its objects at poses in the world; objects without a pose are left out."""
    X_SW = inverse(station.document.X_WS.matrix())
    instances: list[Instance] = []
    for name, instance in scene.instances.items():
        if name not in X_WO:
            continue
        if not np.allclose(X_WO[name], instance_pose(scene, station, name), atol=1e-6):
            instance = replace(instance, X_SO=Pose.readable(X_SW @ X_WO[name]))
        instances.append(instance)
    document = replace(scene.document, instances=tuple(instances))
    return Scene(document, scene.library, scene.path)


@dataclass(frozen=True)
class Attempt:
    """An attempt to take an object away.

    Attributes:
        answer: the planner's answer.
        verdict: verdict of the executed grasp; None if no grasp could be executed.
    """

    answer: JudgedAnswer
    verdict: Verdict | None

    @property
    def succeeded(self) -> bool:
        """Whether the object was held to the end, and is taken away."""
        return self.verdict is not None and self.verdict.outcome.held


def episodes(result: BenchmarkResult) -> dict[str, list[Attempt]]:
    """Attempts in each scene of the protocol `clear`, in order.

    Raises:
        InvalidInputError: the benchmark is not complete.
    """
    found: dict[str, list[Attempt]] = {name: [] for name in result.scene_names}
    for round in result.rounds:
        for answer in result.judged_answers(round):
            executed = answer.executed
            verdict = None if executed is None else answer.verdicts[executed]
            found[answer.answer.scene].append(Attempt(answer, verdict))
    return found


def scenes_to_clear(result: BenchmarkResult, number: int) -> list[str]:
    """Scenes in which the last of `number` attempts was made and judged, and that are not given
    up."""
    last = slice(-MAX_FAILURES, None)
    return [
        name
        for name, attempts in episodes(result).items()
        if len(attempts) == number
        and attempts[-1].answer.is_judged
        and (number < MAX_FAILURES or any(one.succeeded for one in attempts[last]))
    ]
