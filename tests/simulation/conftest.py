"""A library of simple shapes and scenes of them, in which hands execute grasps."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from burg_drake.core import Pose
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument, load_scene, save_scene
from burg_drake.simulation import HandTrial

# Tests import what they share by name.
sys.path.insert(0, str(Path(__file__).parent))

from trial_world import BOX, BOX_MASS, PILLAR, POST, QUICK, WIDE, box_mesh, make_station

MakeScene = Callable[..., Scene]


@pytest.fixture(scope="session")
def library(measured_once: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Box, block, ball, can, bar, post, pillar, wire, card, a box of 20 kg, and one too wide for
    most hands; each stands on its origin, but for a bar that is 0.3 m away from it."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    ball.apply_translation((0.0, 0.0, 0.03))
    can = trimesh.creation.cylinder(radius=0.03, height=0.1, sections=64)
    can.apply_translation((0.0, 0.0, 0.05))
    wire = trimesh.creation.cylinder(radius=0.002, height=0.08, sections=64)
    wire.apply_translation((0.0, 0.0, 0.04))
    far_bar = box_mesh((0.03, 0.30, 0.04)).apply_translation((0.0, 0.3, 0.0))
    sources = [
        ObjectSource(name="box", mesh=box_mesh(BOX), mass=BOX_MASS),
        ObjectSource(name="heavy", mesh=box_mesh(BOX), mass=20.0),
        ObjectSource(name="block", mesh=box_mesh((0.05, 0.05, 0.05)), mass=0.1),
        ObjectSource(name="ball", mesh=ball, mass=0.1),
        ObjectSource(name="can", mesh=can, mass=0.2),
        ObjectSource(name="bar", mesh=box_mesh((0.03, 0.30, 0.04)), mass=0.2),
        ObjectSource(name="far_bar", mesh=far_bar, mass=0.2),
        ObjectSource(name="wire", mesh=wire, mass=0.3),
        ObjectSource(name="card", mesh=box_mesh((0.0005, 0.06, 0.06)), mass=0.3),
        ObjectSource(name="wide", mesh=box_mesh(WIDE), mass=BOX_MASS),
        ObjectSource(name="post", mesh=box_mesh(POST), mass=0.3),
        ObjectSource(name="pillar", mesh=box_mesh(PILLAR), mass=0.2),
    ]
    out = tmp_path_factory.mktemp("library")
    assert not build_library(sources, out, confirm=False).failed
    return out


@pytest.fixture(scope="session")
def make_scene(library: Path, tmp_path_factory: pytest.TempPathFactory) -> MakeScene:
    """Makes a scene from `(object, x, y, yaw in degrees)` or full instances."""

    def make(*instances: tuple[str, float, float, float] | Instance) -> Scene:
        placed = tuple(
            i
            if isinstance(i, Instance)
            else Instance(object=i[0], X_SO=Pose((i[1], i[2], 0.0), rpy_deg=(0.0, 0.0, i[3])))
            for i in instances
        )
        path = tmp_path_factory.mktemp("scene") / "scene.yaml"
        document = SceneDocument(
            name="test", library=str(library), board=Board(size=(0.6, 0.4)), instances=placed
        )
        save_scene(document, path)
        return load_scene(path)

    return make


@pytest.fixture(scope="session")
def box_trial(make_scene: MakeScene) -> HandTrial:
    """The box alone."""
    return HandTrial(make_scene(("box", 0.3, 0.2, 0.0)), make_station(), engine=QUICK)
