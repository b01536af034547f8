"""A hand with a camera at its side: with fingers swapped the same grasp, and not the same hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import Outcome, data_root, grasp_from_axes, swap_fingers
from burg_drake.motion import ArmReach, HandSweep
from burg_drake.scene import Scene, load_scene
from burg_drake.station import GraspMotion, Station, load_station

CAMERA = """
      <collision name="camera">
        <pose>0.07 0 0.03 0 0 0</pose>
        <geometry><box><size>0.04 0.09 0.04</size></box></geometry>
      </collision>
"""
WALL = """
background:
  wall: {X_WB: {translation: [0.53, 0.0, 0.2]}, size: [0.02, 0.6, 0.4]}
"""
X_WG = grasp_from_axes((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.45, 0.0, 0.2))
"""The wall is 7 cm from the middle of the hand; the camera reaches 9 cm to its side."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    scene = load_scene("tabletop_six")
    return Scene(replace(scene.document, instances=()), scene.library, scene.path)


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Station:
    folder = tmp_path_factory.mktemp("hand")
    models = data_root() / "models"
    sdf = (models / "panda/panda_hand.sdf").read_text(encoding="utf-8")
    sdf = sdf.replace("<uri>meshes/", f"<uri>{(models / 'panda/meshes').as_uri()}/")
    first = '      <collision name="body">'
    assert sdf.count(first) == 1
    (folder / "hand.sdf").write_text(sdf.replace(first, CAMERA + first), encoding="utf-8")
    hand = (models / "hands/panda_hand.yaml").read_text(encoding="utf-8")
    ours = hand.replace("package://burg_drake/models/panda/panda_hand.sdf", "hand.sdf")
    (folder / "hand.yaml").write_text(ours, encoding="utf-8")
    text = Path(load_station("panda_tabletop").path).read_text(encoding="utf-8")
    (folder / "station.yaml").write_text(
        text.replace("hand: panda_hand", "hand: hand.yaml") + WALL, encoding="utf-8"
    )
    return load_station(folder / "station.yaml")


@pytest.fixture(scope="module")
def arm(scene: Scene, station: Station) -> ArmReach:
    return ArmReach(scene, station)


def test_it_is_seen_that_the_hand_is_not_symmetric(scene: Scene, station: Station) -> None:
    assert not HandSweep(scene, station, GraspMotion()).symmetric
    usual = load_station("panda_tabletop")
    assert HandSweep(scene, usual, GraspMotion()).symmetric


def test_the_arm_takes_the_way_in_which_the_camera_is_clear(arm: ArmReach) -> None:
    found, swapped = arm.check("", X_WG), arm.check("", swap_fingers(X_WG))
    assert found.outcome is None and swapped.outcome is None
    assert found.path is not None and swapped.path is not None
    for name in ("X_WG", "transfer", "approach", "lift"):
        np.testing.assert_array_equal(getattr(found.path, name), getattr(swapped.path, name))
    assert found.clearance == swapped.clearance
    camera = found.path.X_WG @ np.array([0.0, -0.07, -0.0734, 1.0])  # x of H is -y of G
    assert camera[0] < X_WG[0, 3] - 0.06


def test_where_neither_way_is_free_the_hand_is_in_the_way(arm: ArmReach) -> None:
    nearer = X_WG.copy()
    nearer[0, 3] = 0.51
    found = arm.check("", nearer)
    assert found.outcome is Outcome.HAND_COLLISION_APPROACH and found.blocker == "wall"
