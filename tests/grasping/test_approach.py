"""Approach directions: closed forms, brute force over all turns, and what cones leave alone."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from sampled import assert_same_distribution, box, closing, grasp, lumpy
from scipy.stats import kstest
from trimesh import creation

from burg_drake.core import GraspSet, InvalidInputError, check_pose
from burg_drake.grasping import ApproachCone

DOWN = (0.0, 0.0, -1.0)


def cone(degrees: float, axis=DOWN) -> ApproachCone:
    return ApproachCone(axis, np.deg2rad(degrees))


def from_axis(grasps: GraspSet, axis=DOWN) -> np.ndarray:
    """Angle between approach and axis [deg]."""
    cosine = grasps.X_OG[:, :3, 2] @ np.array(axis) / np.linalg.norm(axis)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def rank_among_allowed(grasps: GraspSet, degrees: float, axis=DOWN) -> np.ndarray:
    """Share of the allowed turns below the approach's own, by trying 3600 turns one by one."""
    x, z = closing(grasps)[:, None], grasps.X_OG[:, None, :3, 2]
    turn = np.deg2rad(np.arange(0.05, 360.0, 0.1))[:, None]
    tried = np.cos(turn) * z + np.sin(turn) * np.cross(x, z)
    allowed = tried @ axis >= np.cos(np.deg2rad(degrees)) * np.linalg.norm(axis)
    ahead = allowed.cumprod(axis=1).sum(axis=1)  # one interval: on from here, and back from here
    behind = allowed[:, ::-1].cumprod(axis=1).sum(axis=1)
    whole = allowed.all(axis=1)
    np.testing.assert_array_equal((ahead + behind)[~whole], allowed.sum(axis=1)[~whole])
    return (behind / np.maximum(ahead + behind, 1))[~whole]


@pytest.mark.parametrize(
    ("degrees", "axis"), [(45.0, DOWN), (45.0, (1.0, -2.0, 0.5)), (90.0, DOWN), (130.0, DOWN)]
)
def test_approaches_to_a_sphere_are_uniform_in_the_cone(degrees, axis):
    """Lines through a sphere have all directions alike, so their component along the axis is
    uniform, up to the sine of the cone's angle, from where on no approach is left."""
    n = 1500
    sphere = creation.icosphere(subdivisions=5, radius=0.03)
    grasps = grasp(sphere, n=n, friction=0.01, approach_cones=(cone(degrees, axis),))
    check_pose(grasps.X_OG, "X_OG")
    assert len(grasps) == n
    assert degrees - 2.0 < from_axis(grasps, axis).max() <= degrees + 1e-6
    along = np.abs(closing(grasps) @ axis) / np.linalg.norm(axis)
    largest = np.sin(np.deg2rad(min(degrees, 90.0)))
    assert along.max() <= largest + 1e-9
    assert kstest(along / largest, "uniform").pvalue > 1e-3
    rank = rank_among_allowed(grasps.select(slice(0, 500)), degrees, axis)
    assert len(rank) > 250
    assert kstest(rank, "uniform").pvalue > 1e-3


def test_a_box_on_a_table_is_not_grasped_by_its_top_and_bottom():
    cube = box(0.04, 0.04, 0.04)
    vertical = {
        degrees: np.abs(closing(grasp(cube, n=3000, approach_cones=(cone(degrees),)))[:, 2]) > 0.5
        for degrees in (60.0, 75.0, 90.0, 180.0)
    }
    assert not vertical[60.0].any() and not vertical[75.0].any()  # the lines tilt by 13.5 degrees
    for degrees in (90.0, 180.0):
        assert len(vertical[degrees]) == 3000
        assert vertical[degrees].mean() == pytest.approx(1 / 3, abs=0.04)


def test_a_plate_that_lies_has_no_grasp_from_above():
    assert len(grasp(box(0.3, 0.4, 0.05), n=100, approach_cones=(cone(75.0),))) == 0
    steeper = grasp(box(0.3, 0.4, 0.05), n=100, approach_cones=(cone(80.0),))
    assert len(steeper) == 100  # closing lines that tilt by 10 degrees or more
    assert np.abs(closing(steeper)[:, 2]).max() <= np.cos(np.deg2rad(10.0))


def test_a_cone_of_all_directions_leaves_out_nothing():
    free, everywhere = (
        grasp(lumpy(), n=12000),
        grasp(lumpy(), n=12000, approach_cones=(cone(180.0),)),
    )
    for column in (0, 3):  # the same pairs of contacts
        np.testing.assert_array_equal(everywhere.X_OG[..., column], free.X_OG[..., column])
    assert_same_distribution(free, everywhere)


def test_a_cone_selects_among_the_pairs_of_the_same_seed():
    free, above = grasp(lumpy(), n=4000), grasp(lumpy(), n=500, approach_cones=(cone(50.0),))
    rows = {tuple(row): i for i, row in enumerate(free.X_OG[:, :3, 3])}
    index = [rows[tuple(row)] for row in above.X_OG[:, :3, 3]]
    assert index == sorted(index)
    possible = np.abs(closing(free)[: index[-1] + 1, 2]) <= np.sin(np.deg2rad(50.0))
    assert np.flatnonzero(possible).tolist() == index
    repeated = grasp(lumpy(), n=9000, approach_cones=(cone(50.0),))
    np.testing.assert_array_equal(repeated.id[:500], above.id)


def test_several_approaches_share_the_cone_evenly():
    grasps = grasp(lumpy(), n=600, approaches=3, approach_cones=(cone(50.0),))
    assert from_axis(grasps).max() <= 50.0 + 1e-6
    rank = rank_among_allowed(grasps, 50.0).reshape(-1, 3)
    wide = np.abs(closing(grasps)[::3, 2]) < 0.6  # where 0.1 degrees are little
    gaps = np.diff(np.sort(rank[wide], axis=1), axis=1)
    np.testing.assert_allclose(gaps, 1 / 3, atol=5e-3)
    assert kstest(rank[:, 0], "uniform").pvalue > 1e-3


# --- several limits at once -----------------------------------------------------------------------

SIDE = (0.8, -0.6, 0.0)


def test_a_half_space_and_a_cone_both_hold():
    cones = (cone(60.0), cone(90.0, SIDE))
    grasps = grasp(lumpy(), n=3000, approach_cones=cones)
    assert len(grasps) == 3000
    check_pose(grasps.X_OG, "X_OG")
    assert 55.0 < from_axis(grasps).max() <= 60.0 + 1e-6
    along = grasps.X_OG[:, :3, 2] @ SIDE
    assert -1e-9 <= along.min() < 0.01 and along.max() > 0.8
    assert [told["angle"] for told in grasps.provenance["approach_cones"]] == [
        np.deg2rad(60.0),
        np.pi / 2,
    ]
    np.testing.assert_array_equal(grasp(lumpy(), n=100, approach_cones=cones).id, grasps.id[:100])


@pytest.mark.parametrize(
    "cones",
    [
        (cone(60.0), cone(90.0, SIDE)),
        (cone(130.0), cone(125.0, (0.2, 0.1, 1.0))),  # two intervals of turns
        (cone(130.0), cone(125.0, (0.2, 0.1, 1.0)), cone(140.0, SIDE)),
        (cone(180.0), cone(180.0, SIDE), cone(70.0, (1.0, 1.0, 0.0))),
    ],
    ids=["half space", "two intervals", "three cones", "all, all and one"],
)
def test_turns_are_spread_evenly_over_all_that_is_allowed(cones):
    """Against trying all turns one by one, about closing axes in all directions."""
    approaches, steps = 200, 3600
    grasps = grasp(lumpy(), n=40 * approaches, approaches=approaches, approach_cones=cones)
    X = grasps.X_OG.reshape(40, approaches, 4, 4)
    turn = 2 * np.pi * np.arange(steps) / steps
    for pair in X:
        x, y, z = pair[0, :3, 0], pair[0, :3, 1], pair[0, :3, 2]
        tried = np.outer(np.cos(turn), z) + np.outer(np.sin(turn), y)
        allowed = np.ones(steps, bool)
        for c in cones:
            axis = np.array(c.axis) / np.linalg.norm(c.axis)
            assert (pair[:, :3, 2] @ axis >= np.cos(c.angle) - 1e-9).all()
            allowed &= tried @ axis >= np.cos(c.angle)
        np.testing.assert_allclose(pair[:, :3, 2] @ x, 0.0, atol=1e-9)
        own = np.arctan2(pair[:, :3, 2] @ y, pair[:, :3, 2] @ z) % (2 * np.pi)
        below = np.r_[0, np.cumsum(allowed)]  # allowed turns up to each step
        rank = np.sort(below[(own * steps / (2 * np.pi)).astype(int)])
        np.testing.assert_allclose(np.diff(rank), allowed.sum() / approaches, atol=2.5)


def test_the_first_turn_is_uniform_over_all_that_is_allowed():
    """Its rank among the allowed turns, counted from one direction on, is uniform."""
    cones = (cone(130.0), cone(125.0, (0.2, 0.1, 1.0)))
    grasps = grasp(lumpy(), n=1500, approach_cones=cones)
    x, z = closing(grasps), grasps.X_OG[:, :3, 2]
    start = np.cross(x, (0.3, -0.5, 0.2))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    side = np.cross(x, start)
    turn = 2 * np.pi * np.arange(1440)[:, None] / 1440
    tried = np.cos(turn) * start[:, None] + np.sin(turn) * side[:, None]
    allowed = np.ones(tried.shape[:2], bool)
    for c in cones:
        allowed &= tried @ c.axis >= np.cos(c.angle) * np.linalg.norm(c.axis)
    own = np.arctan2(np.einsum("ij,ij->i", z, side), np.einsum("ij,ij->i", z, start)) % (2 * np.pi)
    below = (allowed & (turn[:, 0] < own[:, None])).sum(axis=1)
    assert kstest(below / allowed.sum(axis=1), "uniform").pvalue > 1e-3


def test_the_order_of_cones_does_not_matter_to_what_is_allowed():
    a, b = cone(60.0), cone(90.0, SIDE)
    one, two = (grasp(lumpy(), n=12000, approach_cones=c) for c in ((a, b), (b, a)))
    assert_same_distribution(one, two)
    np.testing.assert_array_equal(one.X_OG[..., 0], two.X_OG[..., 0])  # the same pairs
    same = grasp(lumpy(), n=500, approach_cones=(a, a))
    np.testing.assert_allclose(
        same.X_OG, grasp(lumpy(), n=500, approach_cones=(a,)).X_OG, atol=1e-7
    )


def test_an_object_that_is_turned_with_its_limits_has_the_turned_approaches():
    X_NO = trimesh.transformations.rotation_matrix(1.1, [1, 2, -0.5])
    cones = (cone(80.0), cone(90.0, SIDE))
    turned_cones = [ApproachCone(tuple(X_NO[:3, :3] @ c.axis), c.angle) for c in cones]
    turned = grasp(lumpy().apply_transform(X_NO), n=12000, seed=1, approach_cones=turned_cones)
    back = GraspSet.create(
        np.linalg.inv(X_NO) @ turned.X_OG, object="", width=turned.width, score=turned.score
    )
    assert_same_distribution(grasp(lumpy(), n=12000, seed=2, approach_cones=cones), back)


def test_cones_that_have_no_direction_in_common():
    opposite = (cone(30.0), cone(30.0, (0.0, 0.0, 1.0)))
    assert len(grasp(lumpy(), n=10, approach_cones=opposite)) == 0


# --- what is told, and what is refused ------------------------------------------------------------


def test_the_provenance_tells_the_cone():
    assert grasp(lumpy(), n=1).provenance["approach_cones"] == []
    above = grasp(lumpy(), n=5, approach_cones=(cone(60.0, np.array([0, 1, -1])),))
    (told,) = above.provenance["approach_cones"]
    assert told == {"axis": [0.0, 1.0, -1.0], "angle": np.deg2rad(60.0)}
    again = grasp(lumpy(), n=5, approach_cones=(ApproachCone(tuple(told["axis"]), told["angle"]),))
    np.testing.assert_array_equal(again.id, above.id)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 0.0), (0.0, 1.0), (0.0, 0.0, np.nan)])
def test_an_axis_that_is_no_direction(axis):
    with pytest.raises(InvalidInputError, match=r"^axis of the approach cone is \(0.0, .*; give a"):
        ApproachCone(axis, 1.0)


@pytest.mark.parametrize("angle", [0.0, -1.0, 3.2, np.nan])
def test_an_angle_that_makes_no_cone(angle):
    with pytest.raises(InvalidInputError, match=f"^angle of the approach cone is {angle}; give it"):
        ApproachCone(DOWN, angle)
