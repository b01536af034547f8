"""Trials of two scenes with their runs, without simulation: verdicts follow from grasp ids."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import GraspSet, make_pose
from burg_drake.evaluation import EvaluationSettings, Run, evaluate
from burg_drake.experiment import (
    RealTrial,
    Selection,
    Stratum,
    TrialSheet,
    grasp_content,
    make_source_run,
    save_trials,
)
from burg_drake.scene import load_scene
from burg_drake.station import load_station
from tests.evaluation.inline_executor import Inline
from tests.evaluation.known_judge import install

SCENES = {
    "one": """\
version: 1
name: one
library: household
instances:
  - {object: box, X_SO: {translation: [0.47, 0.12, 0.0], rpy_deg: [0, 0, 75]}}
  - {name: blue_mug, object: mug, X_SO: {translation: [0.2, 0.25, 0.0]}}
""",
    "two": """\
version: 1
name: two
library: household
instances:
  - {object: bottle, X_SO: {translation: [0.3, 0.2, 0.0]}}
""",
}
DOWN = np.diag([1.0, -1.0, -1.0])


def grasps_of(height: float, object: str, count: int) -> GraspSet:
    """Grasps from above and from the sides, each turned further about the vertical."""
    poses = []
    for k in range(count):
        a, tilt = 0.7 * k, 0.3 * (k % 3)
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]])
        c, s = np.cos(tilt), np.sin(tilt)
        lean = np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
        poses.append(make_pose(turn @ lean @ DOWN, (0.0, 0.0, height)))
    return GraspSet.create(np.array(poses), object=object, width=np.full(count, 0.04))


def make_runs(folder: Path, patch: pytest.MonkeyPatch) -> list[Run]:
    """The runs of both scenes."""
    install(patch.setattr)
    runs = []
    given = {
        "one": {"box": grasps_of(0.19, "box", 2), "blue_mug": grasps_of(0.07, "mug", 2)},
        "two": {"bottle": grasps_of(0.16, "bottle", 3)},
    }
    for name, text in SCENES.items():
        (folder / f"{name}.yaml").write_text(text)
        scene, station = load_scene(folder / f"{name}.yaml"), load_station("panda_tabletop")
        place = folder / f"run_{name}"
        options = {"grasps": given[name], "executor": Inline(), "progress": False}
        settings = EvaluationSettings(mode="hand")
        runs.append(evaluate(scene, station, place, settings=settings, **options))
    return runs


def make_trials(folder: Path, runs: list[Run], **first: object) -> Path:
    """A trials file with a block a run; `first` are fields of its first trial."""
    trials: list[RealTrial] = []
    for block, run in enumerate(runs, 1):
        for candidate in run.candidates:
            object_name = run.scene().instance(candidate.instance).object
            trials.append(
                RealTrial(
                    number=len(trials) + 1,
                    block=block,
                    run=f"r{block}",
                    grasp=candidate.id,
                    content=grasp_content(candidate.instance, candidate.X_OG, candidate.width),
                    instance=candidate.instance,
                    object=object_name,
                    simulated=run.verdicts[candidate.id].outcome,
                    stratum=f"r{block}_{object_name}",
                )
            )
    trials[0] = replace(trials[0], **first)
    strata = {
        t.stratum: Stratum(
            run=t.run, object=t.object, label="all", population=9, selected=2, wanted=2
        )
        for t in trials
    }
    sheet = TrialSheet(
        created="2026-05-04T16:30:00+02:00",
        runs={f"r{block}": make_source_run(run, folder) for block, run in enumerate(runs, 1)},
        selection=Selection(per_object=2, balance="none", seed=3),
        strata=strata,
        trials=tuple(trials),
    )
    save_trials(sheet, folder / "trials.yaml")
    return folder / "trials.yaml"
