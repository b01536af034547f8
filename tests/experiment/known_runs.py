"""Runs on disk whose verdicts are made up, on a scene without physics behind it."""

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
    """A mug and a box of the library that comes along."""
    places = {"mug": (x, 0.11, 0.0), "box": (0.35, 0.2, 0.0)}
    instances = tuple(Instance(object=o, X_SO=Pose(places[o])) for o in OBJECTS)
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
    """A run in a folder.

    Args:
        folder: for it.
        scene: of it.
        verdicts: one a grasp, by instance; None for a grasp that is not judged yet.
        mode: what was asked.
        seed: of the poses.
        poses: by instance, in place of random ones.
        recorded: other fields of its document.
    """
    station = load_station("panda_tabletop")
    sets = [
        GraspSet.create(
            random_poses(len(own), seed + k) if poses is None else poses[name],
            object=name,
            width=0.03 if poses is None else 0.06,
        )
        for k, (name, own) in enumerate(verdicts.items())
    ]
    instances = np.array([name for name, own in verdicts.items() for _ in own])
    candidates = Candidates(GraspSet.concatenate(sets), instances)
    counts = {name: len(own) for name, own in verdicts.items()}
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
    told = [verdict for own in verdicts.values() for verdict in own]
    with Journal(run.path / JOURNAL_FILE) as journal:
        for id, verdict in zip(candidates.id, told, strict=True):
            if verdict is not None:
                journal.append(id, verdict)
    return load_run(run.path)


def ended(outcome: str, **margins: float) -> Verdict:
    """A verdict of an outcome, of the stage that decides it."""
    return Verdict(Outcome(outcome), Outcome(outcome).stage, margins=margins)


def failed() -> Verdict:
    """A trial that could not be stepped."""
    return Verdict(Outcome.SIMULATION_FAILED, Stage.EXECUTED, reason="NaN")
