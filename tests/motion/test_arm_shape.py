"""What is kept of a robot serves other scenes, and only the same robot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from burg_drake.core import Pose
from burg_drake.motion import ArmProximity, ArmShape, arm_shape
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import Station, StationDiagram, build_station_diagram, load_station

SIX = load_scene("tabletop_six")
EMPTY = Scene(SceneDocument(name="empty", library="household"), SIX.library, Path("empty.yaml"))
PANDA = load_station("panda_tabletop")


def built(scene: Scene, station: Station) -> StationDiagram:
    return build_station_diagram(scene, station, robot="arm", weld_objects=True)


def test_another_scene_has_the_same_robot_with_other_numbers() -> None:
    few, many = built(EMPTY, PANDA), built(SIX, PANDA)
    one, two = ArmShape.of(few), ArmShape.of(many)
    assert one.self_clearance is two.self_clearance
    for a, b in zip(one.trees.bodies, two.trees.bodies, strict=True):
        assert a.body != b.body
        assert few.plant.get_body(a.body).name() == many.plant.get_body(b.body).name()
        assert set(one.links.frame_of) == set(few.robot_bodies)


def test_what_was_kept_changes_nothing() -> None:
    diagram = built(SIX, PANDA)
    q = np.random.default_rng(0).uniform(*ArmShape.of(diagram).limits.T, (500, 7))
    kept = ArmProximity(diagram)
    arm_shape._kept.clear()
    fresh = ArmProximity(diagram)
    np.testing.assert_array_equal(kept.bounds(q).lower, fresh.bounds(q).lower)
    np.testing.assert_array_equal(
        kept.displacement(q[1:], q[:-1]), fresh.displacement(q[1:], q[:-1])
    )


def test_a_robot_that_differs_is_another_one() -> None:
    arm = PANDA.document.arm
    assert arm is not None
    turned = replace(arm, X_FH=Pose(rpy_deg=(0.0, 0.0, -44.0)))
    other = replace(PANDA, document=replace(PANDA.document, arm=turned))
    found = ArmShape.of(built(EMPTY, PANDA)), ArmShape.of(built(EMPTY, other))
    assert found[0].self_clearance is not found[1].self_clearance
