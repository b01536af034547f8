"""The search is brute force, bit for bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from grasp_samples import about, crowded_grasps, random_grasps
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, InvalidInputError, check_pose, make_pose, swap_fingers
from burg_drake.grasping import (
    Tolerance,
    find_nearest,
    find_within,
    grasp_components,
    neighbour_search,
)
from tests.grasping.pose_distances import pose_distances

TOLERANCES = [
    Tolerance(),
    Tolerance(translation=0.004, angle=math.radians(40.0)),
    Tolerance(translation=0.03, angle=math.radians(3.0)),
    Tolerance(translation=math.inf, angle=math.radians(6.0)),
    Tolerance(translation=0.004, angle=math.pi),
    Tolerance(translation=math.inf, angle=math.inf),
    Tolerance(translation=math.inf, angle=math.pi, distance=0.012),
    Tolerance(translation=0.008, angle=math.radians(10.0), distance=0.012),
    Tolerance(translation=math.inf, angle=math.pi, distance=0.006, lever=0.0),
    Tolerance(translation=0.0, angle=0.0),
]

SETS = {
    "scattered": (random_grasps(900, 1), random_grasps(300, 2)),
    "crowded": (crowded_grasps(900, 3), crowded_grasps(300, 4)),
    "shared": (crowded_grasps(500, 5), swap_fingers(crowded_grasps(500, 5)[::-3])),
    "few": (crowded_grasps(200, 6), crowded_grasps(2, 7)),
}


def within(G: Array, F: Array, tolerance: Tolerance) -> Array:
    d = pose_distances(G[:, None], F[None], lever=tolerance.lever)
    near = (d.translation <= tolerance.translation) & (d.angle <= tolerance.angle)
    return (near & (d.combined <= tolerance.distance)).any(axis=1)


def assert_nearest(index: Array, distance: Array, d: Array) -> None:
    """Against the whole matrix; which one of several grasps at no distance is found is open."""
    assert (distance == d.min(axis=1)).all()
    assert (d[np.arange(len(d)), index] == distance).all()
    apart = distance > 0.0
    assert (index == d.argmin(axis=1))[apart].all()


@pytest.fixture
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many trees, and few pairs at a time."""
    monkeypatch.setattr(neighbour_search.NeighbourSearchSettings, "tree_size", 70)
    monkeypatch.setattr(neighbour_search.NeighbourSearchSettings, "max_pairs", 300)
    monkeypatch.setattr(neighbour_search.NeighbourSearchSettings, "candidates", 1)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("tolerance", TOLERANCES, ids=str)
def test_find_within_is_brute_force(name: str, tolerance: Tolerance) -> None:
    G, F = SETS[name]
    found = find_within(grasp_components(G), grasp_components(F), tolerance)
    assert (found == within(G, F, tolerance)).all()


def test_the_tolerances_of_these_tests_tell_grasps_apart() -> None:
    shares = [within(*SETS["crowded"], tolerance).mean() for tolerance in TOLERANCES]
    assert sum(0.05 < share < 0.95 for share in shares) >= 5


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("lever", [0.0, 0.001, 0.0573, 1.0])
def test_find_nearest_is_brute_force(name: str, lever: float) -> None:
    G, F = SETS[name]
    index, distance = find_nearest(grasp_components(G), grasp_components(F), lever=lever)
    d = pose_distances(G[:, None], F[None], lever=lever).combined
    assert_nearest(index, distance, d)


def test_small_pieces_change_nothing(small_pieces: None) -> None:
    G, F = SETS["crowded"]
    index, distance = find_nearest(grasp_components(G), grasp_components(F))
    d = pose_distances(G[:, None], F[None]).combined
    assert_nearest(index, distance, d)
    for tolerance in TOLERANCES:
        found = find_within(grasp_components(G), grasp_components(F), tolerance)
        assert (found == within(G, F, tolerance)).all()


def test_a_grasp_does_not_find_itself(small_pieces: None) -> None:
    G = np.concatenate([crowded_grasps(150, 8), random_grasps(50, 9)])
    index, distance = find_nearest(grasp_components(G), grasp_components(G), same=True)
    d = pose_distances(G[:, None], G[None]).combined
    np.fill_diagonal(d, np.inf)
    assert_nearest(index, distance, d)


def test_of_several_as_near_the_first_is_found(small_pieces: None) -> None:
    around = np.stack([make_pose(p_AB=p) for p in np.vstack([np.eye(3), -np.eye(3)]) / 64])
    F = np.concatenate([random_grasps(100, 10) @ make_pose(p_AB=(1, 1, 1)), around, around])
    index, distance = find_nearest(grasp_components(make_pose()[None]), grasp_components(F))
    assert (index[0], distance[0]) == (100, 1 / 64)
    turned = np.stack([about("x", 5.0), about("x", -5.0)] * 50)
    assert find_nearest(grasp_components(make_pose()[None]), grasp_components(turned))[0][0] == 0


def test_thousands_of_equal_grasps() -> None:
    F = grasp_components(np.repeat(random_grasps(1, 11), 5000, axis=0))
    index, distance = find_nearest(F, F, same=True)
    assert (distance == 0.0).all()
    assert (index != np.arange(5000)).all()
    assert (index >= 0).all()


def test_bounds_are_inclusive() -> None:
    # Binary fractions, so that a grasp lies exactly on the bound.
    G, F = (
        grasp_components(make_pose(p_AB=(0.25, 0.0, 0.0))[None]),
        grasp_components(make_pose()[None]),
    )
    for distance in (0.25, np.nextafter(0.25, 0.0)):
        expected = distance == 0.25
        assert find_within(G, F, Tolerance(distance, 0.0)).tolist() == [expected]
        assert find_within(G, F, Tolerance(math.inf, 0.0, distance)).tolist() == [expected]
    turned = grasp_components(about("x", 20.0)[None])
    angle = float(pose_distances(about("x", 20.0), make_pose()).angle)
    assert find_within(turned, F, Tolerance(0.0, angle)).tolist() == [True]
    assert find_within(turned, F, Tolerance(0.0, np.nextafter(angle, 0.0))).tolist() == [False]


def test_rotations_may_be_as_coarse_as_grasp_sets_allow() -> None:
    rng = np.random.default_rng(12)
    G, F = crowded_grasps(300, 13), crowded_grasps(100, 14)
    for X in (G, F):
        X[:, :3, :3] += rng.uniform(-2.8e-7, 2.8e-7, (len(X), 3, 3))
        check_pose(X, "X_OG")
    index, distance = find_nearest(grasp_components(G), grasp_components(F))
    d = pose_distances(G[:, None], F[None]).combined
    assert_nearest(index, distance, d)


def test_wide_bounds_reach_all_turns() -> None:
    G = make_pose(p_AB=(0.31, 0.0, 0.0)) @ about("x", 180.0)
    d = float(pose_distances(G, make_pose()).combined)  # 0.31 m and half a turn: 0.49 m
    g, f = grasp_components(G[None]), grasp_components(make_pose()[None])
    for angle in (math.inf, math.pi):
        assert find_within(g, f, Tolerance(math.inf, angle, 0.5)).all()
        assert find_within(g, f, Tolerance(0.31, angle, d)).all()
        assert not find_within(g, f, Tolerance(math.inf, angle, 0.48)).any()


def test_each_pair_is_within_its_own_distances() -> None:
    """On the very bound, with rotations as coarse as they may be and angles down to 1e-4 rad."""
    rng = np.random.default_rng(16)
    G = random_grasps(200, 17)
    turns = Rotation.from_rotvec(rng.normal(size=(200, 3)) * np.geomspace(1e-4, 1.0, 200)[:, None])
    F = G @ make_pose(turns.as_matrix(), rng.normal(scale=0.01, size=(200, 3)))
    for X in (G, F):
        X[:, :3, :3] += rng.uniform(-2.8e-7, 2.8e-7, (200, 3, 3))
    d = pose_distances(G, F)
    for k in range(200):
        g, f = grasp_components(G[k : k + 1]), grasp_components(F[k : k + 1])
        assert find_within(g, f, Tolerance(d.translation[k], d.angle[k])).all()
        assert find_within(g, f, Tolerance(math.inf, math.inf, d.combined[k])).all()


def test_far_from_the_origin() -> None:
    far = make_pose(p_AB=(1000.0, -2000.0, 500.0))
    G, F = far @ SETS["crowded"][0], far @ SETS["crowded"][1]
    index, distance = find_nearest(grasp_components(G), grasp_components(F))
    d = pose_distances(G[:, None], F[None]).combined
    assert_nearest(index, distance, d)


def test_nothing_is_found_in_nothing() -> None:
    some, none = grasp_components(random_grasps(3, 15)), grasp_components(np.empty((0, 4, 4)))
    index, distance = find_nearest(some, none)
    assert index.tolist() == [-1] * 3
    assert (distance == math.inf).all()
    assert not find_within(some, none, Tolerance()).any()
    assert len(find_nearest(none, some)[0]) == len(find_within(none, some, Tolerance())) == 0
    index, distance = find_nearest(some[:, :1], some[:, :1], same=True)
    assert (index[0], distance[0]) == (-1, math.inf)


@pytest.mark.parametrize("bounds", [{"translation": -1.0}, {"angle": math.nan}, {"distance": -0.1}])
def test_bounds_are_numbers_from_0(bounds: dict[str, float]) -> None:
    (name,) = bounds
    with pytest.raises(InvalidInputError, match=f"tolerance {name} is .* expected a number from 0"):
        Tolerance(**bounds)
