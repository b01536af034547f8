"""A mesh, a scene and a finished run as inputs of commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import GraspSet, grasp_from_axes, make_pose
from burg_drake.evaluation import EvaluationSettings, Run, evaluate
from burg_drake.station import Engine

SCENE = """\
version: 1
name: two
library: household
board: {size: [0.594, 0.420]}
instances:
  - object: mug
    X_SO: {translation: [0.12, 0.11, 0.0]}
  - object: bottle
    X_SO: {translation: [0.29, 0.11, 0.0]}
"""
TWO = """\
version: 1
name: tabletop_two
library: household
instances:
- {object: mug, X_SO: {translation: [0.125242, 0.109047, 0.0], rpy_deg: [0, 0, 140]}}
- {object: box, X_SO: {translation: [0.475, 0.115, -2.1e-05], rpy_deg: [0, 0, 75]}}
"""
"""Of the built-in `tabletop_six`, where they are."""
ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
X_OG = np.stack([ABOVE, ABOVE @ make_pose(p_AB=(0, 0, 0.1)), ABOVE @ make_pose(p_AB=(0, 0, -0.1))])
"""One that lifts the box, one that collides with it, one in thin air."""


@pytest.fixture(scope="module", autouse=True)
def _judged_here(judged_here: None, measured_once: None, no_pose_mistakes: None) -> None:
    """Judges in this process; `tests/evaluation` tests the worker processes."""


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """A block of 50 x 40 x 60 mm, in metres."""
    path = tmp_path / "block.ply"
    trimesh.creation.box((0.05, 0.04, 0.06)).export(path)
    return path


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """A valid scene, to be damaged."""
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Three grasps on the box with known outcomes, without arm."""
    return box_run(tmp_path_factory.mktemp("run") / "box", "screening")


def box_run(folder: Path, engine: str | Engine) -> Run:
    folder.with_suffix(".yaml").write_text(TWO)
    grasps = GraspSet.create(X_OG, object="box", width=0.06)
    return evaluate(
        folder.with_suffix(".yaml"),
        "panda_tabletop",
        folder,
        settings=EvaluationSettings(mode="hand", engine=engine),
        grasps={"box": grasps},
        workers=1,
        progress=False,
    )
