"""Farthest-point selection on figures where it is known, and what it promises."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from grasp_samples import about, crowded_grasps, random_grasps

from burg_drake.core import Array, GraspSet, InvalidInputError, make_pose, swap_fingers
from burg_drake.grasping import DISTANCE_LEVER, farthest_points, neighbour_distances
from tests.grasping.pose_distances import pose_distances


def on_a_line(n: int) -> Array:
    """Grasps 1/64 m apart: binary fractions, so that ties are ties."""
    return make_pose(p_AB=np.arange(n)[:, None] * np.array([1 / 64, 0.0, 0.0]))


def about_z(n: int) -> Array:
    """Grasps on one spot, turned about the approach by 180 / n degrees from one to the next."""
    return np.stack([about("z", k * 180.0 / n) for k in range(n)])


def test_a_line_is_halved_again_and_again() -> None:
    assert farthest_points(on_a_line(9), 9).tolist() == [0, 8, 4, 2, 6, 1, 3, 5, 7]
    assert farthest_points(on_a_line(9), 4, first=4).tolist() == [4, 0, 8, 2]


def test_turns_about_the_approach_close_after_half_a_turn() -> None:
    selected = farthest_points(about_z(8), 4, first=0).tolist()
    assert selected[:2] == [0, 4]  # 90 degrees are as far as it gets
    assert sorted(selected[2:]) == [2, 6]


def test_it_agrees_with_the_definition() -> None:
    X = np.concatenate([random_grasps(150, 1), crowded_grasps(150, 2)])
    d = pose_distances(X[:, None], X[None]).combined
    selected = farthest_points(X, 60)
    for k in range(1, 60):
        to_selection = d[selected[:k]].min(axis=0)
        assert selected[k] == np.argmax(to_selection)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_the_radius_is_at_most_twice_the_best_one(n: int) -> None:
    X = crowded_grasps(14, 3)
    d = pose_distances(X[:, None], X[None]).combined
    best = min(d[list(some)].min(axis=0).max() for some in combinations(range(14), n))
    radius = d[farthest_points(X, n)].min(axis=0).max()
    assert best <= radius <= 2.0 * best


def test_fingers_do_not_matter() -> None:
    X = crowded_grasps(400, 4)
    mixed = X.copy()
    mixed[::3] = swap_fingers(X[::3])
    assert (farthest_points(mixed, 100) == farthest_points(X, 100)).all()


def test_order_does_not_matter_without_ties() -> None:
    X = crowded_grasps(300, 5)
    order = np.random.default_rng(6).permutation(300)
    assert (order[farthest_points(X[order], 80)] == farthest_points(X, 80)).all()


def test_longer_selections_continue_shorter_ones() -> None:
    X = random_grasps(200, 7)
    assert (farthest_points(X, 200)[:40] == farthest_points(X, 40)).all()
    assert sorted(farthest_points(X, 200)) == list(range(200))


def test_duplicates_come_last() -> None:
    X = np.concatenate([on_a_line(3), on_a_line(3), swap_fingers(on_a_line(3))])
    assert farthest_points(X, 9).tolist() == [0, 2, 1, 3, 4, 5, 6, 7, 8]


def test_the_lever_decides_what_is_far() -> None:
    X = np.stack([make_pose(), make_pose(p_AB=(0.01, 0.0, 0.0)), about("x", 30.0)])
    assert farthest_points(X, 2, first=0).tolist() == [0, 2]
    assert farthest_points(X, 2, first=0, lever=0.001).tolist() == [0, 1]


@pytest.mark.parametrize(
    ("n", "first", "text"),
    [
        (4, None, "cannot select 4 of 3 grasps; give 0 to 3"),
        (-1, None, "cannot select -1 of 3 grasps"),
        (2, 3, "first is 3; expected an index from 0 to 2"),
    ],
)
def test_numbers_out_of_range(n: int, first: int | None, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        farthest_points(on_a_line(3), n, first=first)


def test_nothing_can_be_selected_of_nothing() -> None:
    assert len(farthest_points(np.empty((0, 4, 4)), 0)) == 0
    assert len(farthest_points(on_a_line(3), 0)) == 0


def test_neighbours_are_on_the_same_object_and_instance() -> None:
    X = np.concatenate([on_a_line(3), about_z(2), on_a_line(2)])
    grasps = GraspSet.create(X, object=["mug"] * 5 + ["box"] * 2)
    far = DISTANCE_LEVER * math.pi / 2
    expected = [0.0, 1 / 64, 1 / 64, 0.0, far, 1 / 64, 1 / 64]
    np.testing.assert_allclose(neighbour_distances(grasps), expected, atol=1e-15)
    apart = grasps.with_columns(instance=["a", "a", "a", "b", "b", "c", "d"])
    expected = [1 / 64] * 3 + [far] * 2 + [math.inf] * 2
    np.testing.assert_allclose(neighbour_distances(apart), expected, atol=1e-15)
