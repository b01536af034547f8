"""Distances of grasps: closed forms, the axioms of a metric, and scipy's rotations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from grasp_samples import about, brute_force, crowded_grasps, random_grasps

from burg_drake.core import InvalidInputError, make_pose, swap_fingers
from burg_drake.grasping import DISTANCE_LEVER
from tests.grasping.pose_distances import pose_distances

HERE = make_pose()


@pytest.mark.parametrize(
    ("axis", "degrees", "expected"),
    [
        ("x", 40.0, 40.0),
        ("y", 170.0, 170.0),
        ("x", 180.0, 180.0),
        ("z", 40.0, 40.0),
        ("z", 90.0, 90.0),
        ("z", 130.0, 50.0),
        ("z", 180.0, 0.0),
        ("z", -179.5, 0.5),
    ],
)
def test_turns_about_the_axes(axis: str, degrees: float, expected: float) -> None:
    distances = pose_distances(HERE, about(axis, degrees))
    assert math.degrees(distances.angle) == pytest.approx(expected, abs=1e-12)
    assert distances.translation == 0.0
    assert distances.combined == pytest.approx(DISTANCE_LEVER * math.radians(expected), abs=1e-15)


@pytest.mark.parametrize("degrees", [1e-9, 1e-6, 1e-3, 179.999999, 180.0 - 1e-9])
def test_small_and_large_turns_are_exact(degrees: float) -> None:
    distances = pose_distances(HERE, about("x", degrees))
    assert math.degrees(distances.angle) == pytest.approx(degrees, rel=1e-12, abs=1e-13)


def test_turns_about_two_axes_are_the_nearer_finger_form() -> None:
    # A turn by a about x after one by b about z has the half-angle cosine cos(a/2) cos(b/2), and
    # with swapped fingers cos(a/2) sin(b/2).
    a, b = math.radians(50.0), math.radians(110.0)
    angle = pose_distances(HERE, about("x", 50.0) @ about("z", 110.0)).angle
    form = max(abs(math.cos(b / 2)), abs(math.sin(b / 2)))
    assert angle == pytest.approx(2.0 * math.acos(math.cos(a / 2) * form), abs=1e-14)


def test_shifts() -> None:
    moved = make_pose(p_AB=(0.003, -0.004, 0.012))
    distances = pose_distances(HERE, moved)
    assert distances.translation == pytest.approx(0.013, abs=1e-17)
    assert distances.angle == 0.0
    assert distances.combined == distances.translation


def test_one_millimetre_is_one_degree() -> None:
    turned = pose_distances(HERE, about("y", 15.0)).combined
    assert turned == pytest.approx(0.015, abs=1e-15)


def test_the_lever_weighs_the_angle() -> None:
    pose = make_pose(p_AB=(0.01, 0.0, 0.0)) @ about("y", 90.0)
    assert pose_distances(HERE, pose, lever=0.0).combined == 0.01
    expected = 0.01 + 0.1 * math.pi / 2
    assert pose_distances(HERE, pose, lever=0.1).combined == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("lever", [-1.0, math.nan, math.inf])
def test_a_lever_is_a_weight(lever: float) -> None:
    with pytest.raises(InvalidInputError, match=r"lever is .* expected a finite number from 0"):
        pose_distances(HERE, HERE, lever=lever)


def test_angles_agree_with_scipy() -> None:
    X, Y = random_grasps(60, 1), random_grasps(50, 2)
    translation, angle = brute_force(X, Y)
    distances = pose_distances(X[:, None], Y[None])
    np.testing.assert_allclose(distances.translation, translation, atol=1e-15)
    np.testing.assert_allclose(distances.angle, angle, atol=1e-13)
    assert distances.angle.max() <= math.pi


def test_fingers_do_not_matter_in_any_bit() -> None:
    X, Y = random_grasps(60, 3), crowded_grasps(50, 4)
    plain = pose_distances(X[:, None], Y[None])
    for one, other in ((swap_fingers(X), Y), (X, swap_fingers(Y))):
        swapped = pose_distances(one[:, None], other[None])
        assert (swapped.combined == plain.combined).all()
    assert (pose_distances(X, swap_fingers(X)).combined == 0.0).all()


def test_metric_axioms() -> None:
    X = np.concatenate([random_grasps(25, 5), crowded_grasps(25, 6), crowded_grasps(10, 6)])
    distances = pose_distances(X[:, None], X[None])
    for d in (distances.translation, distances.angle, distances.combined):
        assert (d == d.T).all()
        assert (np.diag(d) == 0.0).all()
        assert (d[:, :, None] <= d[:, None, :] + d[None, :, :].swapaxes(1, 2) + 1e-14).all()
    same = distances.combined == 0.0
    equal = np.abs(X[:, None] - X[None]).max(axis=(-1, -2)) == 0.0
    assert (same == equal).all()


def test_moving_the_object_changes_nothing() -> None:
    X, Y = random_grasps(40, 7), random_grasps(40, 8)
    X_WO = random_grasps(1, 9)[0]
    here, there = pose_distances(X, Y), pose_distances(X_WO @ X, X_WO @ Y)
    np.testing.assert_allclose(here.combined, there.combined, atol=1e-15)


def test_a_pair_has_the_same_bits_alone_and_in_a_batch() -> None:
    X, Y = random_grasps(37, 10), random_grasps(41, 11)
    batch = pose_distances(X[:, None], Y[None]).combined
    alone = [[pose_distances(x, y).combined for y in Y] for x in X[:5]]
    assert (batch[:5] == np.array(alone)).all()
