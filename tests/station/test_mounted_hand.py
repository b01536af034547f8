"""The handle on arm and hand, against the plant itself."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.scene import load_scene
from burg_drake.station import (
    FloatingHand,
    MountedHand,
    StationDiagram,
    build_station_diagram,
    load_station,
)

Q = np.array([0.3, -0.5, 0.2, -2.0, 0.1, 1.7, -0.4])


@pytest.fixture(scope="module")
def built() -> StationDiagram:
    return build_station_diagram(load_scene("tabletop_six"), load_station("panda_tabletop"))


def test_puts_the_arm_where_it_is_told_and_leaves_the_objects(built: StationDiagram) -> None:
    hand, plant = MountedHand(built), built.plant
    context = plant.CreateDefaultContext()
    box = plant.get_body(built.free["box"])
    before = plant.EvalBodyPoseInWorld(context, box).GetAsMatrix4()
    plant.SetVelocities(context, np.ones(plant.num_velocities()))
    hand.place(context, Q, closed=0.25)
    assert hand.q(context).tolist() == Q.tolist()
    assert [joint.GetOnePosition(context) for joint in built.arm_joints] == Q.tolist()
    assert [joint.get_translation(context) for joint in hand.joints] == pytest.approx([0.03, 0.03])
    assert {joint.GetOneVelocity(context) for joint in built.arm_joints} == {0.0}
    assert hand.finger_speed(context) == 0.0
    assert (plant.EvalBodyPoseInWorld(context, box).GetAsMatrix4() == before).all()


def test_the_grasp_frame_is_between_the_pads(built: StationDiagram) -> None:
    """Its x axis goes through both fingers, which are as far apart as the hand is open."""
    hand, plant = MountedHand(built), built.plant
    context = plant.CreateDefaultContext()
    hand.place(context, Q)
    X_WG = hand.X_WG(context)
    one, other = (
        plant.EvalBodyPoseInWorld(context, plant.get_body(i)).translation() for i in hand.fingers
    )
    np.testing.assert_allclose(X_WG[:3, 0] * 0.08, one - other, atol=1e-9)
    between = (one + other) / 2
    np.testing.assert_allclose(np.cross(X_WG[:3, 3] - between, X_WG[:3, 2]), 0.0, atol=1e-9)


def test_links_are_the_arm_without_the_hand(built: StationDiagram) -> None:
    names = {built.plant.get_body(i).name() for i in MountedHand(built).links}
    assert names == {f"panda_link{i}" for i in range(8)}


def test_opening_is_closing_the_other_way_round(built: StationDiagram) -> None:
    hand = MountedHand(built)
    opening, closing = hand.opening_command(), hand.closing_command()
    assert opening[:2].tolist() == [0.04, 0.04]
    assert closing[:2].tolist() == [0.0, 0.0]
    assert (opening[2:] == -closing[2:]).all()


def test_other_robots_are_refused(built: StationDiagram) -> None:
    alone = build_station_diagram(built.scene, built.station, robot="hand")
    with pytest.raises(InvalidInputError, match=r"robot='hand'; .*'arm'"):
        MountedHand(alone)
    with pytest.raises(InvalidInputError, match=r"robot='arm'; .*'hand'"):
        FloatingHand(built)
