"""Average precision of lists worked out by hand, and by another implementation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from grasp_samples import about, brute_force, crowded_grasps, random_grasps

from burg_drake.core import Array, GraspSet, InvalidInputError, make_pose, swap_fingers
from burg_drake.grasping import (
    GraspNetSettings,
    graspnet_ap,
    precision_at_top,
    precision_recall,
    rank_by_score,
    suppress_near_grasps,
)


def apart(score: list[float], object: str | list[str] = "mug") -> GraspSet:
    """Grasps a decimetre apart, so that none is suppressed."""
    spots = np.arange(len(score))[:, None] * np.array([0.1, 0.0, 0.0])
    return GraspSet.create(make_pose(p_AB=spots), object=object, score=score)


def test_precision_at_k_by_hand() -> None:
    grasps = apart([0.3, 0.9, 0.5])  # best first: 1, 2, 0
    result = precision_at_top(grasps, np.array([True, True, False]), top=4)
    assert result.kept.tolist() == [1, 2, 0]
    np.testing.assert_allclose(result.precision[:, 0], [1.0, 1 / 2, 2 / 3, 2 / 4])
    assert result.ap == pytest.approx((1 + 1 / 2 + 2 / 3 + 2 / 4) / 4)
    assert result.attainable == pytest.approx((1 + 1 + 1 + 3 / 4) / 4)


def test_friction_by_hand() -> None:
    grasps = apart([0.9, 0.8])
    result = graspnet_ap(grasps, [0.5, math.nan], frictions=(0.4, 0.5), top=2)
    np.testing.assert_allclose(result.precision, [[0.0, 1.0], [0.0, 0.5]])
    np.testing.assert_allclose(result.by_criterion, [0.0, 0.75])
    assert result.ap == pytest.approx(0.375)


def test_fifty_perfect_grasps() -> None:
    names = [f"object {k // 10}" for k in range(60)]
    perfect = graspnet_ap(apart(np.linspace(1, 0, 60).tolist(), names), np.zeros(60))
    assert perfect.ap == perfect.attainable == 1.0
    assert perfect.precision.shape == (GraspNetSettings.top, len(GraspNetSettings.frictions))
    hopeless = graspnet_ap(apart([0.5] * 60, names), np.full(60, np.inf))
    assert (hopeless.ap, hopeless.attainable) == (0.0, 1.0)


def test_ten_of_an_object() -> None:
    grasps = apart(np.linspace(1, 0, 24).tolist(), ["mug"] * 12 + ["box"] * 12)
    result = graspnet_ap(grasps, np.zeros(24))
    assert result.kept.tolist() == [*range(10), *range(12, 22)]
    everything = graspnet_ap(grasps, np.zeros(24), per_object=None)
    assert everything.kept.tolist() == list(range(24))
    instances = grasps.with_columns(instance=["a", "b"] * 12)
    assert graspnet_ap(instances, np.zeros(24)).kept.tolist() == list(range(24))


@pytest.mark.parametrize(
    ("other", "stays"),
    [
        (make_pose(p_AB=(0.029, 0.0, 0.0)), False),
        (make_pose(p_AB=(0.030, 0.0, 0.0)), True),
        (about("x", 29.9), False),
        (about("x", 30.1), True),
        (about("z", 90.0), True),
        (about("z", 179.0), False),
        (make_pose(p_AB=(0.029, 0.0, 0.0)) @ about("y", 29.9), False),
        (make_pose(p_AB=(0.031, 0.0, 0.0)) @ about("y", 1.0), True),
    ],
)
def test_what_is_suppressed(other: Array, stays: bool) -> None:
    grasps = GraspSet.create(np.stack([other, make_pose()]), object="mug", score=[0.4, 0.6])
    assert suppress_near_grasps(grasps).tolist() == ([1, 0] if stays else [1])
    assert suppress_near_grasps(GraspSet.create(grasps.X_OG, object=["mug", "box"])).shape == (2,)


def test_what_is_suppressed_suppresses_nothing() -> None:
    spots = np.array([[0.00, 0, 0], [0.02, 0, 0], [0.04, 0, 0], [0.06, 0, 0]])
    grasps = GraspSet.create(make_pose(p_AB=spots), object="mug", score=[4, 3, 2, 1])
    assert suppress_near_grasps(grasps).tolist() == [0, 2]


def straightforward_ap(grasps: GraspSet, needed: Array) -> float:
    """graspnetAPI's steps, one grasp at a time, with scipy's rotations."""
    translation, angle = brute_force(grasps.X_OG, grasps.X_OG)
    ranked = sorted(range(len(grasps)), key=lambda k: -grasps.score[k])
    kept: list[int] = []
    for k in ranked:
        rivals = [j for j in kept if grasps.object[j] == grasps.object[k]]
        if not any(translation[j, k] < 0.03 and angle[j, k] < math.pi / 6 for j in rivals):
            kept.append(k)
    best: list[int] = []
    for k in kept:
        if sum(grasps.object[j] == grasps.object[k] for j in best) < 10:
            best.append(k)
    precisions = []
    for mu in (0.2, 0.4, 0.6, 0.8, 1.0, 1.2):
        for k in range(1, 51):
            good = [j for j in best[:k] if needed[j] <= mu]
            precisions.append(len(good) / k)
    return float(np.mean(precisions))


@pytest.mark.parametrize(("objects", "size"), [(1, 0.02), (3, 0.06), (8, 0.2)])
def test_it_agrees_with_a_straightforward_implementation(objects: int, size: float) -> None:
    rng = np.random.default_rng(objects)
    X = np.concatenate([random_grasps(150, objects, size), crowded_grasps(50, objects)])
    names = np.array([f"object {k}" for k in rng.integers(objects, size=200)])
    grasps = GraspSet.create(X, object=names, score=rng.random(200))
    needed = np.where(rng.random(200) < 0.2, np.nan, rng.uniform(0.0, 1.5, 200))
    assert graspnet_ap(grasps, needed).ap == pytest.approx(straightforward_ap(grasps, needed))


def test_order_and_fingers_do_not_matter() -> None:
    rng = np.random.default_rng(9)
    X = crowded_grasps(200, 10)
    X[:, :3, 3] *= 5.0
    score = np.round(rng.random(200), 1)  # many are equal
    grasps = GraspSet.create(X, object="mug", score=score)
    good = rng.random(200) < 0.5
    result = precision_at_top(grasps, good, per_object=None)
    order = rng.permutation(200)
    again = precision_at_top(grasps.select(order), good[order], per_object=None)
    assert (order[again.kept] == result.kept).all()
    assert (again.precision == result.precision).all()
    other = GraspSet(swap_fingers(X), grasps.width, grasps.id, grasps.object, score)
    assert (precision_at_top(other, good, per_object=None).kept == result.kept).all()


def test_grasps_without_a_score_come_last() -> None:
    grasps = apart([math.nan, -5.0, math.nan, 2.0])
    order = rank_by_score(grasps).tolist()
    assert order[:2] == [3, 1]
    assert sorted(order[2:]) == [0, 2]


def test_precision_and_recall_by_hand() -> None:
    curve = precision_recall([0.9, 0.8, 0.8, 0.3, math.nan], [True, True, False, False, True])
    assert curve.score.tolist() == [0.9, 0.8, 0.3, -math.inf]
    np.testing.assert_allclose(curve.precision, [1, 2 / 3, 2 / 4, 3 / 5])
    np.testing.assert_allclose(curve.recall, [1 / 3, 2 / 3, 2 / 3, 1])
    assert curve.ap == pytest.approx(1 / 3 + 2 / 9 + 1 / 5)


def test_average_precision_without_ties_is_the_mean_at_each_good_grasp() -> None:
    rng = np.random.default_rng(11)
    score, good = rng.permutation(100).astype(float), rng.random(100) < 0.3
    ranked = good[np.argsort(-score)]
    at_hits = [ranked[: k + 1].mean() for k in np.flatnonzero(ranked)]
    assert precision_recall(score, good).ap == pytest.approx(np.mean(at_hits))


def test_scores_that_are_all_equal_rank_nothing() -> None:
    good = np.arange(40) % 4 == 0
    assert precision_recall(np.ones(40), good).ap == 0.25
    assert math.isnan(precision_recall(np.ones(3), np.zeros(3, dtype=bool)).ap)


def test_an_empty_set_has_no_precision() -> None:
    result = graspnet_ap(apart([]), [])
    assert (result.ap, result.attainable, len(result.kept)) == (0.0, 0.0, 0)
    assert len(precision_recall([], np.empty(0, dtype=bool)).precision) == 0


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda g: graspnet_ap(g, [0.1]), r"friction_needed has shape \(1,\); expected \(2,\)"),
        (lambda g: precision_at_top(g, [1, 0]), r"type int64; expected \(2,\) or \(2, L\) of bool"),
        (lambda g: precision_at_top(g, [True]), r"good has shape \(1,\)"),
        (lambda g: precision_at_top(g, [True, False], top=0), "top is 0 and per_object 10"),
        (lambda g: precision_recall([1.0], [1]), r"expected \(N,\) numbers and \(N,\) bool"),
    ],
)
def test_bad_input(call, text: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidInputError, match=text):
        call(apart([0.1, 0.2]))
