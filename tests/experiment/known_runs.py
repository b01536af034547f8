"""Runs on disk with invented verdicts, without a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.core import (
    Array,
    GraspSet,
    Mode,
    Outcome,
    Pose,
    Stage,
    Verdict,
    make_pose,
    software_versions,
)
from burg_drake.evaluation import (
    JOURNAL_FILE,
    Candidates,
    Grasps,
    Journal,
    Library,
    Run,
    RunDocument,
    create_run,
    input_of,
    load_run,
    run_hash,
)
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene, save_scene
from burg_drake.station import ENGINES, load_station

OBJECTS = ("mug", "box")


def make_scene(folder: Path, name: str = "two", x: float = 0.12) -> Scene:
    """A scene with a mug and a box of the library `household`."""
    positions = {"mug": (x, 0.11, 0.0), "box": (0.35, 0.2, 0.0)}
    instances = tuple(Instance(object=name, X_SO=Pose(positions[name])) for name in OBJECTS)
    document = SceneDocument(name=name, library="household", instances=instances)
    save_scene(document, folder / f"{name}.yaml")
    return load_scene(folder / f"{name}.yaml")


def random_poses(count: int, seed: int) -> Array:
    """(N, 4, 4) poses within 10 cm."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(count, random_state=rng).as_matrix()
    return np.stack([make_pose(R, rng.uniform(-0.1, 0.1, 3)) for R in turns])


def make_run(
    folder: Path,
    scene: Scene,
    verdicts: Mapping[str, Sequence[Verdict | None]],
    *,
    mode: Mode = "hand",
    seed: int = 0,
    poses: Mapping[str, Array] | None = None,
    **recorded: Any,
) -> Run:
    """Writes a run with given verdicts.

    Args:
        folder: folder of the run.
        scene: scene of the run.
        verdicts: a verdict for each grasp, by instance; None for a grasp that is not judged yet.
        mode: mode of the run.
        seed: random seed of the poses.
        poses: poses of the grasps by instance; random if None.
        recorded: other fields of the run's document.
    """
    station = load_station("panda_tabletop")
    sets = [
        GraspSet.create(
            random_poses(len(of_instance), seed + k) if poses is None else poses[name],
            object=name,
            width=0.03 if poses is None else 0.06,
        )
        for k, (name, of_instance) in enumerate(verdicts.items())
    ]
    instances = np.array([name for name, of_instance in verdicts.items() for _ in of_instance])
    candidates = Candidates(GraspSet.concatenate(sets), instances)
    counts = {name: len(of_instance) for name, of_instance in verdicts.items()}
    document = RunDocument(
        scene=input_of(scene, "scenes"),
        station=input_of(station, "stations"),
        library=Library(
            name="household",
            path=str(scene.library.root),
            objects={name: scene.library.entry(name).build for name in OBJECTS},
        ),
        grasps=Grasps(
            origin="given", count=len(candidates), objects=counts, content=candidates.content
        ),
        engine=ENGINES["standard"],
        mode=mode,
        seed=seed,
        versions=software_versions(),
    )
    document = replace(document, **recorded)
    document = replace(document, hash=run_hash(document))
    run = create_run(folder, document, scene, station, candidates)
    in_order = [verdict for of_instance in verdicts.values() for verdict in of_instance]
    with Journal(run.path / JOURNAL_FILE) as journal:
        for id, verdict in zip(candidates.id, in_order, strict=True):
            if verdict is not None:
                journal.append(id, verdict)
    return load_run(run.path)


def ended(outcome: str, **margins: float) -> Verdict:
    """A verdict with an outcome and the stage that decides it."""
    return Verdict(Outcome(outcome), Outcome(outcome).stage, margins=margins)


def failed() -> Verdict:
    """A verdict of a trial whose simulation failed."""
    return Verdict(Outcome.SIMULATION_FAILED, Stage.EXECUTED, reason="NaN")
