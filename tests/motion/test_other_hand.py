"""An arm that carries another hand than its own."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import grasp_from_axes
from burg_drake.motion import ArmCollision, ArmReach, empty_scene
from burg_drake.scene import Scene
from burg_drake.station import StationDiagram, build_station_diagram, load_station

OWN, OTHER = "panda_tabletop", "panda_wsg"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return empty_scene()


@pytest.fixture(scope="module")
def arms(scene: Scene) -> dict[str, StationDiagram]:
    return {
        name: build_station_diagram(scene, load_station(name), robot="arm", weld_objects=True)
        for name in (OWN, OTHER)
    }


def X_WG(built: StationDiagram, q: np.ndarray) -> np.ndarray:
    """(4, 4) grasp frame at the arm's joint positions (7,)."""
    context = built.plant.CreateDefaultContext()
    for joint, angle in zip(built.arm_joints, q, strict=True):
        joint.set_angle(context, angle)
    body = built.plant.GetBodyByName(built.station.hand.body)
    return body.EvalPoseInWorld(context).GetAsMatrix4() @ built.station.hand.X_HG.matrix()


def test_it_grips_where_the_arms_own_hand_does_only_farther_out(
    arms: dict[str, StationDiagram],
) -> None:
    """Same axes of G; the gripper is longer by its body of 72.5 mm, fingers of 73 mm up to the
    middle of the pads and an adapter of 10 mm, less the 103.4 mm of the Panda's hand."""
    for q in np.random.default_rng(0).uniform(-0.5, 0.5, (5, 7)) - (0, 0, 0, 1.5, 0, -1.5, 0):
        own, other = X_WG(arms[OWN], q), X_WG(arms[OTHER], q)
        np.testing.assert_allclose(other[:3, :3], own[:3, :3], atol=1e-12)
        farther = own[:3, 3] + (0.0725 + 0.073 + 0.010 - 0.1034) * own[:3, 2]
        np.testing.assert_allclose(other[:3, 3], farther, atol=1e-12)


def test_home_is_free_of_collisions(arms: dict[str, StationDiagram]) -> None:
    collision = ArmCollision(arms[OTHER])
    assert arms[OTHER].station.document.arm is not None
    assert collision.overlaps(np.array(arms[OTHER].station.document.arm.home)) == []


def test_reach_brings_the_grasp_frame_of_that_hand_to_the_grasp(
    scene: Scene, arms: dict[str, StationDiagram]
) -> None:
    wanted = grasp_from_axes((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.45, 0.0, 0.25))
    reach = ArmReach(scene, load_station(OTHER)).check("", wanted)
    assert reach.outcome is None
    found = X_WG(arms[OTHER], reach.q_grasp)
    closing = found[:3, 0] @ wanted[:3, 0]
    assert abs(closing) == pytest.approx(1.0, abs=1e-6)  # fingers may be exchanged
    np.testing.assert_allclose(found[:3, 2:], wanted[:3, 2:], atol=1e-5)
