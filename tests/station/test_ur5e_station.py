"""The station with a UR5e: an arm that comes as a URDF."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from burg_drake.core import InvalidInputError, resolve_reference
from burg_drake.scene import Scene, load_scene
from burg_drake.station import StationDiagram, build_station_diagram, load_station

HOME = [0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0]


@pytest.fixture(scope="module")
def scene() -> Scene:
    whole = load_scene("tabletop_six")
    return replace(whole, document=replace(whole.document, instances=()))


@pytest.fixture(scope="module")
def built(scene: Scene) -> StationDiagram:
    return build_station_diagram(scene, load_station("ur5e_tabletop"))


def test_the_arm_has_its_six_joints_in_order(built: StationDiagram) -> None:
    names = [joint.name() for joint in built.arm_joints]
    assert names == [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ]


def test_at_home_the_hand_looks_down_at_the_sheet(built: StationDiagram) -> None:
    plant, hand = built.plant, built.station.hand
    X_WH = plant.GetBodyByName(hand.body).EvalPoseInWorld(plant.CreateDefaultContext())
    X_WG = X_WH.GetAsMatrix4() @ hand.X_HG.matrix()
    np.testing.assert_allclose(X_WG[:3, 2], [0.0, 0.0, -1.0], atol=1e-9)
    p_SG = np.linalg.inv(built.station.document.X_WS.matrix()) @ X_WG[:, 3]
    assert (p_SG[:2] > 0.0).all() and (p_SG[:2] < (0.594, 0.42)).all()
    assert 0.2 < p_SG[2] < 0.5


def test_the_servos_hold_it_there(built: StationDiagram) -> None:
    simulator = Simulator(built.diagram)
    context = simulator.get_mutable_context()
    q = np.array(HOME)
    built.diagram.GetInputPort("arm.desired_state").FixValue(context, np.append(q, np.zeros(6)))
    opened = built.diagram.GetOutputPort("hand.state").Eval(context)
    built.diagram.GetInputPort("hand.desired_state").FixValue(context, opened)
    simulator.AdvanceTo(0.3)
    state = built.diagram.GetOutputPort("arm.state").Eval(context)
    np.testing.assert_allclose(state[:6], q, atol=1e-6)
    # And bring it elsewhere.
    q = q + 0.05
    built.diagram.GetInputPort("arm.desired_state").FixValue(context, np.append(q, np.zeros(6)))
    simulator.AdvanceTo(1.3)
    state = built.diagram.GetOutputPort("arm.state").Eval(context)
    np.testing.assert_allclose(state[:6], q, atol=1e-3)


ELBOW = r"  <transmission name=\"elbow.*?</transmission>\n"
BOLTED = (
    '<link name="world"/><joint name="bolts" type="fixed"><parent link="world"/>'
    '<child link="base"/></joint></robot>'
)


@pytest.mark.parametrize(
    ("pattern", "replacement", "expected"),
    [
        (ELBOW, "", "elbow_joint cannot be driven; in a URDF each"),
        (
            "</robot>",
            BOLTED,
            "joint 'bolts' fixes 'base' to the world; remove it, as the station says where",
        ),
    ],
)
def test_a_urdf_that_is_no_arm_for_a_station(
    scene: Scene, tmp_path: Path, pattern: str, replacement: str, expected: str
) -> None:
    urdf = resolve_reference("package://burg_drake/models/ur5e/ur5e.urdf").read_text("utf-8")
    other = re.sub(pattern, replacement, urdf, flags=re.DOTALL)
    assert other != urdf
    (tmp_path / "arm.urdf").write_text(other, encoding="utf-8")
    station = load_station("ur5e_tabletop").path.read_text("utf-8")
    station = station.replace("package://burg_drake/models/ur5e/ur5e.urdf", "arm.urdf")
    (tmp_path / "mine.yaml").write_text(station, encoding="utf-8")
    with pytest.raises(InvalidInputError, match=rf"arm\.urdf: {expected}"):
        build_station_diagram(scene, load_station(tmp_path / "mine.yaml"))
