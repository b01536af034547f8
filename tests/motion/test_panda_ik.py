"""The Panda's closed form: against Drake's forward kinematics, and whether it finds everything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import InvalidInputError, inverse, make_pose, resolve_reference, rot_z
from burg_drake.motion import ArmKinematics, PandaIk, PandaPostures, panda_forward

FINE = 1e-9
"""What the closed form promises [m and of matrix entries]."""


@pytest.fixture(scope="module")
def plant() -> MultibodyPlant:
    builder = RobotDiagramBuilder()
    builder.parser().AddModels(
        str(resolve_reference("package://burg_drake/models/panda/panda_arm.sdf"))
    )
    plant = builder.plant()
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_link0"))
    plant.Finalize()
    return plant


@pytest.fixture(scope="module")
def arm(plant: MultibodyPlant) -> ArmKinematics:
    joints = [plant.GetJointByName(f"panda_joint{i}") for i in range(1, 8)]
    base, flange = plant.GetFrameByName("panda_link0"), plant.GetFrameByName("panda_link8")
    return ArmKinematics.from_plant(plant, joints, base, flange)


@pytest.fixture(scope="module")
def ik(arm: ArmKinematics) -> PandaIk:
    closed = PandaIk.of(arm)
    assert closed is not None
    return closed


def random_postures(ik: PandaIk, n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(ik.lower, ik.upper, (n, 7))


def flange_by_drake(plant: MultibodyPlant, q: np.ndarray) -> np.ndarray:
    context = plant.CreateDefaultContext()
    frame, poses = plant.GetFrameByName("panda_link8"), []
    for positions in q:
        plant.SetPositions(context, positions)
        poses.append(frame.CalcPoseInWorld(context).GetAsMatrix4())
    return np.array(poses)


def nearest(found: PandaPostures, wanted: np.ndarray) -> np.ndarray:
    """Largest joint error of the solution nearest to each wanted posture [rad]."""
    distance = np.full(len(wanted), np.inf)
    np.minimum.at(distance, found.pose, np.abs(found.q - wanted[found.pose]).max(axis=1))
    return distance


def test_the_table_of_links_is_drake_s_model(plant: MultibodyPlant, ik: PandaIk) -> None:
    q = random_postures(ik, 200)
    np.testing.assert_allclose(panda_forward(q), flange_by_drake(plant, q), atol=1e-12)


def test_solutions_are_at_the_pose_by_drake_s_kinematics(
    plant: MultibodyPlant, ik: PandaIk
) -> None:
    X = flange_by_drake(plant, random_postures(ik, 100, seed=1))
    found = ik.solve(X, np.linspace(ik.lower[6], ik.upper[6], 16))
    assert len(found) > 1000
    np.testing.assert_allclose(flange_by_drake(plant, found.q), X[found.pose], atol=FINE)


def test_every_one_of_30_000_random_postures_is_found_again(ik: PandaIk) -> None:
    q = random_postures(ik, 30_000, seed=2)
    X = panda_forward(q)
    found = ik.solve(X, q[:, 6:])
    assert nearest(found, q).max() < 1e-7
    np.testing.assert_allclose(panda_forward(found.q), X[found.pose], atol=FINE)
    assert ((found.q >= ik.lower) & (found.q <= ik.upper)).all()


def test_branches_are_different_postures_and_all_of_them_occur(ik: PandaIk) -> None:
    q = random_postures(ik, 20_000, seed=3)
    found = ik.solve(panda_forward(q), q[:, 6:])
    assert set(found.branch.tolist()) == set(range(8))
    key = 8 * found.pose + found.branch
    assert (np.diff(key) > 0).all()  # ordered, and none twice
    same = found.pose[1:] == found.pose[:-1]
    assert np.abs(np.diff(found.q, axis=0))[same].max(axis=1).min() > 1e-6


def test_nothing_is_lost_by_the_limits(ik: PandaIk) -> None:
    """Within wider limits the same postures come up, and those that are outside of ours."""
    pi = np.pi
    q = random_postures(ik, 5000, seed=4)
    X = panda_forward(q)
    low = np.array([-pi, -pi, -pi, -pi, -pi, -0.0175, -pi])
    wide = replace(ik, lower=low, upper=np.array([pi, pi, pi, 0.0, pi, 2 * pi - 0.0175, pi]))
    all_q = wide.solve(X, q[:, 6:]).q
    inside = ((all_q >= ik.lower) & (all_q <= ik.upper)).all(axis=1)
    np.testing.assert_array_equal(all_q[inside], ik.solve(X, q[:, 6:]).q)
    assert not inside.all()


def test_a_solution_does_not_depend_on_the_batch(ik: PandaIk) -> None:
    X = panda_forward(random_postures(ik, 600, seed=5))
    q7 = np.linspace(-2.5, 2.5, 11)
    whole = ik.solve(X, q7)
    for k in (0, 1, 599):
        alone = ik.solve(X[k : k + 1], q7)
        mine = whole.pose == k
        np.testing.assert_array_equal(alone.q, whole.q[mine])
        np.testing.assert_array_equal(alone.parameter, whole.parameter[mine])
        np.testing.assert_array_equal(alone.branch, whole.branch[mine])


def test_values_of_the_last_joint_for_each_pose(ik: PandaIk) -> None:
    q = random_postures(ik, 50, seed=6)
    q7 = q[:, 6:] + np.array([0.0, 0.1, -0.2])
    found = ik.solve(panda_forward(q), q7)
    np.testing.assert_array_equal(found.q[:, 6], q7[found.pose, found.parameter])


def test_swapped_fingers_are_the_last_joint_turned_by_half_a_turn(ik: PandaIk) -> None:
    q = random_postures(ik, 2000, seed=7)
    q = q[np.abs(q[:, 6]) < 2.8973 - 0.01]
    turned = panda_forward(q) @ make_pose(rot_z(np.pi))
    other = q[:, 6] - np.copysign(np.pi, q[:, 6])
    possible = np.abs(other) <= ik.upper[6]
    found = ik.solve(turned[possible], other[possible, None])
    wanted = np.column_stack([q[possible, :6], other[possible]])
    assert nearest(found, wanted).max() < 1e-7


@pytest.mark.parametrize(
    "q",
    [
        (0.3, 0.0, -0.5, -1.8, 0.2, 1.6, 0.7),  # upper arm upright: q1 + q3 counts
        (0.0, 0.0, 0.0, -np.pi / 2, 0.0, np.pi / 2, np.pi / 4),
        (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4),
    ],
)
def test_singular_and_plain_postures(ik: PandaIk, q: tuple[float, ...]) -> None:
    X = panda_forward(np.array([q]))
    found = ik.solve(X, [q[6]])
    assert len(found)
    np.testing.assert_allclose(panda_forward(found.q), X[found.pose], atol=FINE)
    near = found.q[np.abs(found.q[:, 3:] - q[3:]).max(axis=1).argmin()]
    np.testing.assert_allclose(near[3:], q[3:], atol=1e-6)
    assert near[0] + near[2] == pytest.approx(q[0] + q[2], abs=1e-6)


def test_out_of_reach_and_empty(ik: PandaIk) -> None:
    far = make_pose(p_AB=[[1.5, 0.0, 0.5], [0.0, 0.0, 2.0]])
    assert len(ik.solve(far, np.linspace(-2, 2, 9))) == 0
    assert len(ik.solve(np.empty((0, 4, 4)), [0.0])) == 0
    assert ik.solve(far, []).q.shape == (0, 7)


def test_a_hand_on_the_flange(ik: PandaIk, arm: ArmKinematics) -> None:
    X_FH = make_pose(rot_z(-np.pi / 4), (0.01, 0.0, 0.02))
    with_hand = PandaIk.of(replace(arm, X_AH0=arm.X_AH0 @ X_FH))
    assert with_hand is not None
    np.testing.assert_allclose(with_hand.X_FH, X_FH, atol=1e-12)
    q = random_postures(ik, 100, seed=8)
    found = with_hand.solve(panda_forward(q) @ X_FH, q[:, 6:])
    assert nearest(found, q).max() < 1e-7


def test_other_arms_are_not_taken_for_a_panda(arm: ArmKinematics) -> None:
    longer = arm.p_AJ.copy()
    longer[4:, 2] += 0.01
    moved = replace(arm, p_AJ=arm.p_AJ + np.array([0.0, 0.0, 0.1]), X_AH0=arm.X_AH0)
    for other in (replace(arm, p_AJ=longer), replace(arm, turns=np.zeros(7)), moved):
        assert PandaIk.of(other) is None
    six = replace(arm, lower=arm.lower[:6], upper=arm.upper[:6])
    assert PandaIk.of(six) is None


def test_what_cannot_be_solved_is_said(ik: PandaIk) -> None:
    X = inverse(panda_forward(random_postures(ik, 3)))
    with pytest.raises(InvalidInputError, match=r"X_AH has shape \(4, 4\); expected \(N, 4, 4\)"):
        ik.solve(X[0], [0.0])
    with pytest.raises(InvalidInputError, match=r"q7 has shape \(2, 1\); expected .* \(3, M\)"):
        ik.solve(X, [[0.0], [0.1]])
    with pytest.raises(InvalidInputError, match=r"X_AH\[0\] has NaN"):
        ik.solve(X * np.nan, [0.0])
