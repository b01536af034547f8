"""A scene with the station's hand above it, as MuJoCo reads and moves it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose
from burg_drake.export import Exported, export_scene
from burg_drake.objects import load_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument
from burg_drake.station import Station, load_station


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    document = SceneDocument(
        name="one",
        library="household",
        board=Board(),
        instances=(Instance(object="can", X_SO=Pose((0.2, 0.15, 0.0))),),
    )
    return Scene(document, load_library("household"), tmp_path_factory.mktemp("one") / "one.yaml")


@pytest.fixture(scope="module")
def exported(scene: Scene, station: Station, tmp_path_factory) -> Exported:
    return export_scene(scene, tmp_path_factory.mktemp("mjcf") / "out", "mjcf", station, hand=True)


def test_its_actuators_grasp_and_lift(exported: Exported, scene: Scene, station: Station) -> None:
    model = mujoco.MjModel.from_xml_path(str(exported.main))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = {model.actuator(k).name for k in range(model.nu)}
    assert {word for word in names if f"'{word}'" in exported.notes[0]} == names
    hand, can = data.body("hand panda_hand"), data.body("can")
    p_WG = hand.xpos + hand.xmat.reshape(3, 3) @ station.hand.X_HG.matrix()[:3, 3]
    below_rim = np.array((0.0, 0.0, scene.entry("can").upper[2] - 0.02))
    way = can.xpos + below_rim - p_WG
    start = can.xpos.copy()

    def go(x: float, y: float, z: float, seconds: float) -> None:
        here = np.array([data.actuator(f"hand {axis}").ctrl[0] for axis in "xyz"])
        for share in np.linspace(0.0, 1.0, round(seconds / model.opt.timestep)):
            for axis, a, b in zip("xyz", here, (x, y, z), strict=True):
                data.actuator(f"hand {axis}").ctrl = a + share * (b - a)
            mujoco.mj_step(model, data)

    go(*way[:2], 0.0, 0.5)
    go(*way, 0.5)
    for joint in ("panda_finger_joint1", "panda_finger_joint2"):
        data.actuator(f"hand {joint}").ctrl = -station.hand.closing_speed
    go(*way, 1.0)
    assert np.linalg.norm(can.xpos - start) < 0.01
    go(*way[:2], way[2] + 0.1, 1.0)
    assert can.xpos[2] - start[2] == pytest.approx(0.1, abs=0.005)


def test_only_mjcf_has_a_hand_and_only_a_station_gives_one(
    scene: Scene, station: Station, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match="exported to mjcf, not to sdf"):
        export_scene(scene, tmp_path / "out", "sdf", station, hand=True)
    with pytest.raises(InvalidInputError, match="name the station, too"):
        export_scene(scene, tmp_path / "out", "mjcf", hand=True)
