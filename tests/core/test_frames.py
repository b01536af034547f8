from __future__ import annotations

import itertools

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, frames


def random_rotations(n: int, seed: int) -> np.ndarray:
    """Uniform rotations by QR decomposition, independent of any quaternion code."""
    Q, R = np.linalg.qr(np.random.default_rng(seed).normal(size=(n, 3, 3)))
    Q *= np.sign(np.diagonal(R, axis1=1, axis2=2))[:, None, :]
    Q[np.linalg.det(Q) < 0, :, 0] *= -1.0
    return Q


def random_poses(n: int, seed: int) -> np.ndarray:
    p = np.random.default_rng(seed + 1000).normal(size=(n, 3))
    return frames.make_pose(random_rotations(n, seed), p)


def elementary(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def test_poses_form_a_group():
    X, Y, Z = (random_poses(200, seed) for seed in (1, 2, 3))
    identity = frames.make_pose()
    frames.check_pose(X @ Y, "closure")
    np.testing.assert_allclose((X @ Y) @ Z, X @ (Y @ Z), atol=1e-13)
    np.testing.assert_array_equal(X @ identity, X)
    for product in (X @ frames.inverse(X), frames.inverse(X) @ X):
        np.testing.assert_allclose(product, np.broadcast_to(identity, X.shape), atol=1e-13)
    np.testing.assert_allclose(
        frames.inverse(X @ Y), frames.inverse(Y) @ frames.inverse(X), atol=1e-13
    )
    np.testing.assert_allclose(frames.inverse(X), np.linalg.inv(X), atol=1e-13)


def test_transform_points_is_homogeneous_multiplication_and_composes():
    X_AB, X_BC = random_poses(6, 4).reshape(2, 3, 4, 4), random_poses(6, 5).reshape(2, 3, 4, 4)
    p_CQ = np.random.default_rng(6).normal(size=(2, 3, 7, 3))
    homogeneous = np.concatenate([p_CQ, np.ones((2, 3, 7, 1))], axis=-1)
    expected = np.einsum("...ij,...nj->...ni", X_AB @ X_BC, homogeneous)[..., :3]
    nested = frames.transform_points(X_AB, frames.transform_points(X_BC, p_CQ))
    np.testing.assert_allclose(nested, expected, atol=1e-12)


def test_make_pose_broadcasts_and_keeps_empty_batches():
    assert frames.make_pose(np.eye(3), np.zeros((5, 1, 3))).shape == (5, 1, 4, 4)
    assert frames.make_pose(np.zeros((4, 3, 3)), np.zeros((5, 1, 3))).shape == (5, 4, 4, 4)
    assert frames.inverse(np.empty((0, 4, 4))).shape == (0, 4, 4)
    assert frames.quaternion_from_rotation(np.empty((0, 3, 3))).shape == (0, 4)


def test_rpy_is_rz_ry_rx_about_fixed_axes():
    rpy = np.random.default_rng(7).uniform(-np.pi, np.pi, (50, 3))
    expected = [elementary(2, y) @ elementary(1, p) @ elementary(0, r) for r, p, y in rpy]
    np.testing.assert_allclose(frames.rotation_from_rpy(rpy), expected, atol=1e-14)
    np.testing.assert_allclose(frames.rot_z(0.7), elementary(2, 0.7), atol=1e-15)


def test_rpy_round_trip_of_angles_within_the_principal_range():
    rng = np.random.default_rng(8)
    rpy = rng.uniform([-np.pi, -1.55, -np.pi], [np.pi, 1.55, np.pi], (4, 50, 3))
    back = frames.rpy_from_rotation(frames.rotation_from_rpy(rpy))
    np.testing.assert_allclose(back, rpy, atol=1e-11)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_rpy_round_trip_of_rotations_at_gimbal_lock(pitch):
    for roll, yaw in itertools.product(np.linspace(-3, 3, 7), repeat=2):
        R = frames.rotation_from_rpy([roll, pitch, yaw])
        rpy = frames.rpy_from_rotation(R)
        np.testing.assert_allclose(frames.rotation_from_rpy(rpy), R, atol=1e-7)
        assert abs(abs(rpy[1]) - np.pi / 2) < 1e-6


def test_quaternions_are_wxyz_against_the_axis_angle_formula():
    axis, angle = np.array([2.0, -1.0, 0.5]), 1.1
    axis /= np.linalg.norm(axis)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K  # Rodrigues
    q = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    np.testing.assert_allclose(frames.rotation_from_quaternion(q), R, atol=1e-14)
    np.testing.assert_allclose(frames.rotation_from_quaternion(-2.0 * q), R, atol=1e-14)
    np.testing.assert_allclose(frames.quaternion_from_rotation(R), q, atol=1e-14)
    np.testing.assert_allclose(frames.rotation_angle(R), angle, atol=1e-14)


def test_quaternion_round_trip_has_unit_length_and_positive_w():
    half_turns = np.array([np.diag(d) for d in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1])], float)
    R = np.concatenate([random_rotations(300, 9), half_turns])
    q = frames.quaternion_from_rotation(R)
    assert (q[:, 0] >= 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(frames.rotation_from_quaternion(q), R, atol=1e-13)


def test_pregrasp_lies_behind_the_grasp_and_approaches_along_z():
    X_AG = random_poses(20, 10)
    X_AP = frames.pregrasp(X_AG, 0.1)
    np.testing.assert_array_equal(X_AP[:, :3, :3], X_AG[:, :3, :3])
    way = X_AG[:, :3, 3] - X_AP[:, :3, 3]
    np.testing.assert_allclose(way, 0.1 * X_AG[:, :3, 2], atol=1e-14)


def test_a_grasp_and_the_one_with_swapped_fingers_have_one_name():
    """Also in a batch of other ones: the largest component of each closing axis is positive."""
    X = random_poses(50, 15)
    named = frames.canonical_fingers(X)
    np.testing.assert_allclose(frames.canonical_fingers(frames.swap_fingers(X)), named, atol=1e-15)
    for before, after in zip(X, named, strict=True):
        closing = after[:3, 0].tolist()
        assert max(closing, key=abs) > 0.0
        assert any(np.allclose(after, same) for same in (before, frames.swap_fingers(before)))


def test_swapping_fingers_exchanges_the_pads_and_nothing_else():
    X_AG = random_poses(20, 11)
    swapped = frames.swap_fingers(X_AG)
    pads = np.array([[0.04, 0.0, 0.0], [-0.04, 0.0, 0.0], [0.0, 0.0, -0.1]])  # and the palm
    np.testing.assert_allclose(
        frames.transform_points(swapped, pads),
        frames.transform_points(X_AG, pads[[1, 0, 2]]),
        atol=1e-14,
    )
    np.testing.assert_array_equal(frames.swap_fingers(swapped), X_AG)
    frames.check_pose(swapped, "swapped")


def test_grasp_from_axes_keeps_closing_and_the_perpendicular_part_of_approach():
    rng = np.random.default_rng(12)
    closing, approach, p = rng.normal(size=(3, 40, 3)) * [[[5.0]], [[1e-12]], [[1.0]]]
    X = frames.check_pose(frames.grasp_from_axes(closing, approach, p), "X_AG")
    np.testing.assert_array_equal(X[:, :3, 3], p)
    x, z = X[:, :3, 0], X[:, :3, 2]
    np.testing.assert_allclose(np.cross(x, closing), 0.0, atol=1e-14)
    assert (np.einsum("ij,ij->i", x, closing) > 0).all()
    assert (np.einsum("ij,ij->i", z, approach) > 0).all()
    unit = approach / np.linalg.norm(approach, axis=1, keepdims=True)
    np.testing.assert_allclose(np.einsum("ij,ij->i", np.cross(x, z), unit), 0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("closing", "approach"),
    [([1, 0, 0], [-3, 0, 0]), ([0, 0, 0], [0, 0, 1]), ([1, 0, 0], [0, 0, 0])],
)
def test_grasp_from_axes_refuses_degenerate_directions(closing, approach):
    with pytest.raises(InvalidInputError, match="must not be zero or parallel to each other"):
        frames.grasp_from_axes(closing, approach, [0, 0, 0])


def test_check_pose_error_texts():
    def message(X):
        with pytest.raises(InvalidInputError) as caught:
            frames.check_pose(X, "X_SO of 'mug'")
        return str(caught.value)

    good = random_poses(3, 13)
    assert frames.check_pose(good, "X") is good
    assert message(np.eye(3)) == "X_SO of 'mug' has shape (3, 3); expected (..., 4, 4)"
    bad = good.copy()
    bad[1, 0, 3] = np.nan
    assert message(bad) == (
        "X_SO of 'mug'[1] has NaN or infinite numbers; give finite metres and angles"
    )
    bad[1, 0, 3] = -1e200
    assert message(bad) == "X_SO of 'mug'[1] is more than 1e+06 m from the origin; give metres"
    bad = good.copy()
    bad[2, :3, :3] *= 1.01
    assert message(bad) == (
        "X_SO of 'mug'[2] is not a rigid transform: its rotation part is off by 0.02"
        " from orthonormal"
    )
    assert message(np.diag([1.0, 1.0, -1.0, 1.0])).endswith(
        "its rotation part is a reflection (determinant -1)"
    )
    bad = good.copy()
    bad[0, 3, 0] = 0.5
    assert message(bad) == "X_SO of 'mug'[0] has a last row that is not 0 0 0 1"


def test_check_pose_names_a_pose_far_down():
    many = np.tile(np.eye(4), (140_000, 1, 1))
    many[131_500, 3, 1] = 0.5
    with pytest.raises(InvalidInputError, match=r"^X\[131500\] has a last row"):
        frames.check_pose(many, "X")


def test_check_pose_accepts_what_text_files_round():
    frames.check_pose(np.round(random_poses(100, 14), 7), "X")


def test_angles_are_wrapped_to_the_interval_from_minus_pi_to_pi():
    angles = np.array([0.0, np.pi, -np.pi, 7.0, -7.0])
    wrapped = [0.0, -np.pi, -np.pi, 7.0 - 2.0 * np.pi, 2.0 * np.pi - 7.0]
    np.testing.assert_allclose(frames.wrap_to_pi(angles), wrapped, atol=1e-15)
    assert frames.wrap_to_pi(7.0) == pytest.approx(7.0 - 2.0 * np.pi)
