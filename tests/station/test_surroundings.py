"""The table obeys Coulomb's law of friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import Simulator

from burg_drake.core import Pose
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Instance, SceneDocument, load_scene, save_scene
from burg_drake.station import ENGINES, build_station_diagram, load_station
from tests.thorough import thorough

OBJECT_FRICTION, GRAVITY = 0.24, 9.81


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory):
    folder: Path = tmp_path_factory.mktemp("sliding")
    mesh = trimesh.creation.box((0.1, 0.1, 0.03))
    mesh.apply_translation((0.0, 0.0, 0.015))
    build_library([ObjectSource(name="brick", mesh=mesh, mass=0.3)], folder / "library")
    brick = Instance(object="brick", X_SO=Pose((0.3, 0.2, 0.0), rpy_deg=(0.0, 0.0, 20.0)))
    save_scene(SceneDocument(name="s", library="library", instances=(brick,)), folder / "s.yaml")
    return load_scene(folder / "s.yaml")


@pytest.mark.parametrize(("engine", "share"), [thorough("reference", 0.03), ("standard", 0.08)])
def test_thrown_brick_is_braked_by_friction_alone(scene, engine: str, share: float) -> None:
    """`screening` is left out: at 5 ms sliding on the table is braked too much."""
    station = load_station("panda_tabletop")
    built = build_station_diagram(scene, station, robot="none", engine=ENGINES[engine])
    simulator = Simulator(built.diagram)
    context = built.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    simulator.AdvanceTo(0.3)  # it comes to rest
    brick = built.plant.get_body(built.free["brick"])
    throw = SpatialVelocity(w=np.zeros(3), v=np.array([0.0, 1.0, 0.0]))
    built.plant.SetFreeBodySpatialVelocity(context=context, body=brick, V_JpJc=throw)
    simulator.AdvanceTo(0.5)
    table = station.document.table.friction
    mu = 2 * OBJECT_FRICTION * table / (OBJECT_FRICTION + table)  # Drake's combination
    speed = built.plant.EvalBodySpatialVelocityInWorld(context, brick).translational()[1]
    assert 1.0 - speed == pytest.approx(mu * GRAVITY * 0.2, rel=share)
