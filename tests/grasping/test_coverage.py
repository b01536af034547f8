"""Coverage and precision where they are known, and by brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from grasp_samples import about, brute_force, crowded_grasps, random_grasps

from burg_drake.core import GraspSet, make_pose, swap_fingers
from burg_drake.grasping import (
    DISTANCE_LEVER,
    DISTANCE_VERSION,
    Share,
    Tolerance,
    coverage,
    nearest_grasps,
    precision,
)
from tests.grasping.pose_distances import pose_distances

STEP = 1 / 128
"""[m]; a binary fraction, so that grasps lie exactly on a bound."""


def grid() -> GraspSet:
    """9 x 9 positions, each with 8 turns about the approach in steps of 22.5 degrees."""
    spots = [
        make_pose(p_AB=(i * STEP, j * STEP, 0.0)) @ about("z", 22.5 * k)
        for i in range(9)
        for j in range(9)
        for k in range(8)
    ]
    return GraspSet.create(np.stack(spots), object="mug")


def one(*spot: float, object: str = "mug", turn: float = 0.0) -> GraspSet:
    return GraspSet.create(make_pose(p_AB=spot) @ about("z", turn), object=object)


@pytest.mark.parametrize(
    ("steps", "degrees", "spots", "turns"),
    [
        (0.0, 1.0, 1, 1),
        (1.0, 1.0, 5, 1),
        (1.5, 1.0, 9, 1),
        (2.0, 23.0, 13, 3),
        (2.0, 46.0, 13, 5),
        (4.0, 68.0, 49, 7),
        (100.0, 90.0, 81, 8),
    ],
)
def test_coverage_of_a_grid(steps: float, degrees: float, spots: int, turns: int) -> None:
    """Points of a square lattice in a circle, times turns to both sides (Gauss's circle)."""
    middle = one(4 * STEP, 4 * STEP, 0.0, turn=180.0)
    bounds = {"translation": steps * STEP, "angle": math.radians(degrees) + 1e-9}
    result = coverage(grid(), middle, **bounds)
    assert result.overall == Share(spots * turns, 81 * 8)
    assert precision(middle, grid(), **bounds).overall == Share(1, 1)


def test_the_combined_bound_on_a_grid() -> None:
    """22.5 degrees are 22.5 mm, and a step is 7.8125 mm."""
    middle = one(4 * STEP, 4 * STEP, 0.0)
    free = {"translation": math.inf, "angle": math.pi}
    assert coverage(grid(), middle, distance=0.0079, **free).overall.count == 5
    assert coverage(grid(), middle, distance=0.0226, **free).overall.count == 25 + 2
    assert coverage(grid(), middle, distance=0.0304, **free).overall.count == 45 + 2 * 5


def test_it_is_brute_force_on_random_sets() -> None:
    reference = GraspSet.create(crowded_grasps(700, 1), object="mug")
    grasps = GraspSet.create(crowded_grasps(60, 2), object="mug")
    translation, angle = brute_force(reference.X_OG, grasps.X_OG)
    near = (translation <= 0.006) & (angle <= math.radians(8.0))
    bounds = {"translation": 0.006, "angle": math.radians(8.0)}
    covered = coverage(reference, grasps, **bounds)
    assert (covered.matched == near.any(axis=1)).all()
    assert 0.1 < covered.overall.value < 0.9
    assert (precision(grasps, reference, **bounds).matched == near.any(axis=0)).all()


def test_fingers_and_order_do_not_matter() -> None:
    reference = GraspSet.create(crowded_grasps(300, 3), object="mug")
    X = crowded_grasps(40, 4)
    order = np.random.default_rng(5).permutation(300)
    plain = coverage(reference, GraspSet.create(X, object="mug"))
    swapped = GraspSet.create(swap_fingers(X)[::-1], object="mug")
    assert (coverage(reference.select(order), swapped).matched == plain.matched[order]).all()


def test_more_grasps_and_wider_bounds_cover_more() -> None:
    reference = GraspSet.create(random_grasps(400, 6), object="mug")
    grasps = GraspSet.create(random_grasps(200, 7), object="mug")
    few = coverage(reference, grasps.select(slice(100))).matched
    many = coverage(reference, grasps).matched
    wide = coverage(reference, grasps, translation=0.02).matched
    assert (few <= many).all()
    assert (many <= wide).all()
    assert few.sum() < many.sum() < wide.sum()


def test_objects_do_not_mix() -> None:
    reference = GraspSet.concatenate([one(0, 0, 0), one(0, 0, 0, object="box"), one(1, 0, 0)])
    result = coverage(reference, GraspSet.concatenate([one(0, 0, 0), one(1, 0, 0, object="box")]))
    assert result.matched.tolist() == [True, False, False]
    assert result.by_object == {"box": Share(0, 1), "mug": Share(1, 2)}
    assert result.overall == Share(1, 3)


def test_instances_count_where_both_sets_name_them() -> None:
    left = one(0, 0, 0).with_columns(instance="left")
    right = one(0, 0, 0).with_columns(instance="right")
    assert coverage(left, left).overall == Share(1, 1)
    assert coverage(left, right).overall == Share(0, 1)
    assert coverage(left, one(0, 0, 0)).overall == Share(1, 1)
    both = GraspSet.concatenate([left, right])
    assert nearest_grasps(right, both).index.tolist() == [1]
    assert nearest_grasps(one(0, 0, 0), both).index.tolist() == [0]


def test_nearest_grasps_by_hand() -> None:
    others = GraspSet.concatenate([one(0.01, 0, 0), one(0, 0, 0, turn=5.0), one(9, 9, 9)])
    grasps = GraspSet.concatenate([one(0, 0, 0), one(0.01, 0, 0), one(0, 0, 0, object="box")])
    found = nearest_grasps(grasps, others)
    assert found.index.tolist() == [1, 0, -1]
    np.testing.assert_allclose(found.distance, [0.005, 0.0, math.inf], atol=1e-15)
    np.testing.assert_allclose(found.translation, [0.0, 0.0, math.inf], atol=1e-15)
    np.testing.assert_allclose(found.angle, [math.radians(5.0), 0.0, math.inf], atol=1e-15)
    assert nearest_grasps(grasps, others, lever=1.0).index.tolist() == [0, 0, -1]


def test_nearest_grasps_by_brute_force() -> None:
    names = np.array(["mug", "box", "can"])
    rng = np.random.default_rng(8)
    reference = GraspSet.create(crowded_grasps(300, 9), object=names[rng.integers(3, size=300)])
    grasps = GraspSet.create(crowded_grasps(80, 10), object=names[rng.integers(2, size=80)])
    d = pose_distances(reference.X_OG[:, None], grasps.X_OG[None]).combined
    d[reference.object[:, None] != grasps.object] = np.inf
    found = nearest_grasps(reference, grasps)
    assert (found.distance == d.min(axis=1)).all()
    has = reference.object != "can"
    assert (found.index[has] == d[has].argmin(axis=1)).all()
    assert (found.index[~has] == -1).all()


def test_results_say_what_they_are() -> None:
    result = coverage(one(0, 0, 0), one(0, 0, 0), translation=0.01)
    assert result.tolerance == Tolerance(translation=0.01)
    assert result.version == nearest_grasps(one(0, 0, 0), one(0, 0, 0)).version == DISTANCE_VERSION
    assert result.tolerance.lever == DISTANCE_LEVER


def test_nothing_to_cover_is_no_share() -> None:
    none = one(0, 0, 0).select([])
    assert math.isnan(coverage(none, one(0, 0, 0)).overall.value)
    assert coverage(none, one(0, 0, 0)).by_object == {}
    assert coverage(one(0, 0, 0), none).overall == Share(0, 1)
