"""The batched inverse kinematics against Franka's DH table, finite differences and toy arms."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
)
from pydrake.planning import RobotDiagramBuilder
from scipy.spatial.transform import Rotation

from burg_drake.core import InvalidInputError, make_pose, resolve_reference, rotation_from_rpy
from burg_drake.motion import ArmKinematics, rotation_vector, solve_ik
from burg_drake.scene import load_scene
from burg_drake.station import build_station_diagram, load_station

# Craig's DH table (a, d, alpha) of frankaemika.github.io/docs/control_parameters.html; flange last.
DH = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -pi / 2),
    (0.0, 0.316, pi / 2),
    (0.0825, 0.0, pi / 2),
    (-0.0825, 0.384, -pi / 2),
    (0.0, 0.0, pi / 2),
    (0.088, 0.0, pi / 2),
    (0.0, 0.107, 0.0),
]


def flange_by_dh(q: np.ndarray) -> np.ndarray:
    """`X_AF` (4, 4) of one configuration."""
    X = np.eye(4)
    for (a, d, alpha), theta in zip(DH, [*q, 0.0], strict=True):
        X = X @ make_pose(rotation_from_rpy((alpha, 0, 0)), (a, 0, 0))
        X = X @ make_pose(rotation_from_rpy((0, 0, theta)), (0, 0, d))
    return X


@pytest.fixture(scope="module")
def panda() -> ArmKinematics:
    """The arm with its flange for a hand, on a base that does not stand at the world's origin."""
    builder = RobotDiagramBuilder()
    plant = builder.plant()
    builder.parser().AddModels(
        str(resolve_reference("package://burg_drake/models/panda/panda_arm.sdf"))
    )
    base = plant.GetFrameByName("panda_link0")
    plant.WeldFrames(plant.world_frame(), base, RigidTransform([0.3, -0.2, 0.5]))
    plant.Finalize()
    joints = [plant.GetJointByName(f"panda_joint{i}") for i in range(1, 8)]
    return ArmKinematics.from_plant(plant, joints, base, plant.GetFrameByName("panda_link8"))


def random_postures(arm: ArmKinematics, n: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(arm.lower, arm.upper, (n, len(arm.lower)))


def test_forward_kinematics_is_that_of_the_dh_table(panda: ArmKinematics) -> None:
    q = random_postures(panda, 100)
    X_AF, _ = panda.forward(q)
    np.testing.assert_allclose(X_AF, [flange_by_dh(row) for row in q], atol=1e-12)


def test_jacobian_by_finite_differences(panda: ArmKinematics) -> None:
    q, h = random_postures(panda, 20), 1e-5
    _, J = panda.forward(q)
    for i in range(7):
        delta = h * np.eye(7)[i]
        after, before = panda.forward(q + delta)[0], panda.forward(q - delta)[0]
        turn = Rotation.from_matrix(after[:, :3, :3] @ before[:, :3, :3].swapaxes(1, 2))
        np.testing.assert_allclose(J[:, :3, i], turn.as_rotvec() / (2 * h), atol=1e-8)
        moved = (after[:, :3, 3] - before[:, :3, 3]) / (2 * h)
        np.testing.assert_allclose(J[:, 3:, i], moved, atol=1e-8)


def test_solutions_hit_the_goal_within_the_limits(panda: ArmKinematics) -> None:
    q = random_postures(panda, 64)
    goal, _ = panda.forward(q)
    near = q + np.random.default_rng(1).uniform(-0.2, 0.2, q.shape)
    found, met = solve_ik(panda, goal, near, iterations=20, tolerance=1e-8, margin=0.0)
    assert met.mean() > 0.9
    assert ((found >= panda.lower) & (found <= panda.upper)).all()
    np.testing.assert_allclose(panda.forward(found[met])[0], goal[met], atol=1e-7)


def test_the_margin_is_kept(panda: ArmKinematics) -> None:
    at_limit = np.tile(panda.upper, (1, 1))
    goal, _ = panda.forward(at_limit)
    found, _ = solve_ik(panda, goal, at_limit, iterations=20, tolerance=1e-8, margin=0.05)
    assert (found <= panda.upper - 0.05 + 1e-12).all()


def test_out_of_reach_is_not_met(panda: ArmKinematics) -> None:
    goal = np.tile(make_pose(p_AB=(0.0, 0.0, 2.0)), (8, 1, 1))
    start = random_postures(panda, 8)
    found, met = solve_ik(panda, goal, start, iterations=30, tolerance=1e-6)
    assert not met.any() and np.isfinite(found).all()


def gantry(last: str) -> tuple[MultibodyPlant, list]:
    """Rail along x, mast along z, and a turntable about y (or a ball joint)."""
    plant = MultibodyPlant(0.0)
    inertia = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    bodies = [plant.AddRigidBody(name, inertia) for name in ("carriage", "mast", "head")]
    frames = [plant.world_frame(), *(body.body_frame() for body in bodies)]
    joints = [
        PrismaticJoint("rail", frames[0], frames[1], np.array([1.0, 0, 0]), -1.0, 1.0),
        PrismaticJoint("lift", frames[1], frames[2], np.array([0, 0, 1.0]), 0.0, 1.0),
        RevoluteJoint("turn", frames[2], frames[3], np.array([0, 1.0, 0]), -3.0, 3.0)
        if last == "turn"
        else BallRpyJoint("ball", frames[2], frames[3]),
    ]
    joints = [plant.AddJoint(joint) for joint in joints]
    plant.Finalize()
    return plant, joints


def test_prismatic_joints_by_closed_form() -> None:
    plant, joints = gantry("turn")
    hand = plant.GetFrameByName("head")
    arm = ArmKinematics.from_plant(plant, joints, plant.world_frame(), hand)
    goal = make_pose(rotation_from_rpy((0.0, 0.7, 0.0)), (-0.4, 0.0, 0.6))[None]
    start = np.zeros((1, 3))
    found, met = solve_ik(arm, goal, start, iterations=10, tolerance=1e-10)
    assert met.all()
    np.testing.assert_allclose(found, [[-0.4, 0.6, 0.7]], atol=1e-9)


def test_other_joints_are_refused() -> None:
    plant, joints = gantry("ball")
    with pytest.raises(InvalidInputError, match=r"arm joint 'ball' is ball_rpy; inverse"):
        ArmKinematics.from_plant(plant, joints, plant.world_frame(), plant.GetFrameByName("head"))


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-4, 1.0, 3.0, pi - 1e-6])
def test_rotation_vector(angle: float) -> None:
    axis = np.array([0.48, -0.6, 0.64])
    R = Rotation.from_rotvec(angle * axis).as_matrix()[None]
    np.testing.assert_allclose(rotation_vector(R)[0], angle * axis, atol=1e-8)


def test_half_a_turn_is_not_taken_for_none() -> None:
    R = np.diag([-1.0, -1.0, 1.0])[None]
    assert np.linalg.norm(rotation_vector(R)) == pytest.approx(pi)


def test_joints_without_limits_turn_once_either_way(tmp_path: Path) -> None:
    """A `continuous` joint of a URDF."""
    urdf = resolve_reference("package://burg_drake/models/ur5e/ur5e.urdf").read_text("utf-8")
    endless = urdf.replace('"wrist_3_joint" type="revolute"', '"wrist_3_joint" type="continuous"')
    endless = re.sub(r'(continuous".*?)lower="\S+" upper="\S+" ', r"\1", endless, flags=re.DOTALL)
    (tmp_path / "arm.urdf").write_text(endless, encoding="utf-8")
    text = load_station("ur5e_tabletop").path.read_text("utf-8")
    text = text.replace("package://burg_drake/models/ur5e/ur5e.urdf", "arm.urdf")
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    station = load_station(tmp_path / "mine.yaml")
    arm = ArmKinematics.of(build_station_diagram(load_scene("tabletop_six"), station))
    assert arm.upper[5] == -arm.lower[5] == 2 * np.pi
    home = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    lower, upper = arm.one_revolution_around(home, 0.01)
    assert upper[5] - 1.0 == 1.0 - lower[5] == pytest.approx(np.pi + 0.5)
    assert upper[2] == -lower[2] == pytest.approx(np.pi - 0.01)


def test_whole_turns_towards_a_posture() -> None:
    limits = np.array([2 * np.pi, 2.9, 0.5])
    arm = ArmKinematics(
        turns=np.array([1.0, 1.0, 0.0]),
        axis=np.eye(3),
        p_AJ=np.zeros((3, 3)),
        X_AH0=np.eye(4),
        lower=-limits,
        upper=limits,
    )
    q = np.array([[3.0, 2.0, 0.4], [-3.0, -2.0, 0.3], [5.0, 2.8, 0.2], [-6.0, 2.0 - 2 * np.pi, 0]])
    expected = [[3.0, 2.0, 0.4], [2 * np.pi - 3.0, -2.0, 0.3], [5.0, 2.8, 0.2]]
    expected.append([2 * np.pi - 6.0, 2.0, 0.0])
    near = arm.wrapped_near(q, np.array([2.0, -0.5, 0.0]))
    np.testing.assert_allclose(near, expected, atol=1e-12)
