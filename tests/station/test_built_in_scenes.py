"""The scenes that the package installs are at rest: nothing moves when time starts."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from burg_drake.core import builtin_names, inverse, rotation_angle, transform_points
from burg_drake.scene import load_scene
from burg_drake.station import SceneCheck, build_station_diagram, load_station
from tests.thorough import thorough

SECONDS = 0.4
MOVED = 4e-5
TURNED = np.deg2rad(0.04)
"""What creeps passes these in the same time as 0.1 mm or 0.1 degrees in one second."""


@pytest.mark.parametrize(
    "name", [n if n == "tabletop_six" else thorough(n) for n in builtin_names("scenes")]
)
def test_nothing_moves(name: str) -> None:
    scene, station = load_scene(name), load_station("panda_tabletop")
    built = build_station_diagram(scene, station, robot="none")
    simulator = Simulator(built.diagram)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    for time in np.linspace(0.0, SECONDS, 5)[1:]:
        simulator.AdvanceTo(time)
        for instance, index in built.free.items():
            body = built.plant.get_body(index)
            X_WO = built.plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
            X_OO = inverse(built.X_WO(instance)) @ X_WO
            p_OOcm = np.array(scene.entry(instance).mass_properties.center_of_mass)
            moved = np.linalg.norm(transform_points(X_OO, p_OOcm[None])[0] - p_OOcm)
            assert moved < MOVED, (instance, time)
            assert rotation_angle(X_OO[:3, :3]) < TURNED, (instance, time)


@pytest.mark.parametrize("station", builtin_names("stations"))
def test_every_scene_is_sound_on_every_station(station: str) -> None:
    scenes = [load_scene(name) for name in builtin_names("scenes")]
    check = SceneCheck(load_station(station), scenes[0].library)
    assert {scene.name: check.issues(scene) for scene in scenes if check.issues(scene)} == {}
