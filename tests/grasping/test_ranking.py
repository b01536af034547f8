"""What a column says about which grasps are good."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike

from burg_drake.core import GraspSet, InvalidInputError, UnknownNameError, make_pose
from burg_drake.grasping import graspnet_ap, rank_by


def with_column(score: ArrayLike, **column: ArrayLike) -> GraspSet:
    """Grasps a decimetre apart, with scores and a column."""
    spots = np.arange(len(np.asarray(score)))[:, None] * np.array([0.1, 0.0, 0.0])
    return GraspSet.create(make_pose(p_AB=spots), object="mug", score=score, columns=column)


def test_friction_needed() -> None:
    needed = [0.1, 0.7, math.nan, 1.1]
    grasps = with_column([4, 3, 2, 1], friction_needed=needed)
    ranking = rank_by(grasps, "friction_needed")
    assert ranking.criteria == ("mu 0.2", "mu 0.4", "mu 0.6", "mu 0.8", "mu 1", "mu 1.2")
    assert ranking.good == (1, 1, 1, 2, 2, 3)
    assert ranking.average_precision[0] == 1.0
    assert ranking.average_precision[-1] == pytest.approx((1 + 1 + 3 / 4) / 3)
    assert ranking.top.ap == graspnet_ap(grasps, needed).ap


@pytest.mark.parametrize(
    ("columns", "colliding"),
    [
        ({"clearance": [0.01, -0.002, math.nan, 0.0]}, 1),
        ({"screened": ["clear", "collision_table", "", "clear"]}, 1),
        ({"outcome": ["lifted", "collision_target", "slipped", "no_ik"]}, 1),
        ({"clearance": [0.01, -0.002, 0.1, 0.0], "outcome": ["collision_clutter", "", "", ""]}, 2),
        ({"clearance": [math.nan] * 4, "screened": [""] * 4}, None),
        ({"clearance": ["near", "far", "", ""], "outcome": [1, 0, 0, 1]}, None),
        ({}, None),
    ],
)
def test_what_collides_is_bad_at_any_friction(
    columns: dict[str, ArrayLike], colliding: int | None
) -> None:
    """graspnetAPI marks what collides like what holds at no friction: -1, never good."""
    needed = np.array([0.1, 0.1, 0.1, 1.1])
    grasps = with_column([3, 4, 2, 1], friction_needed=needed, **columns)
    ranking = rank_by(grasps, "friction_needed")
    assert ranking.colliding == colliding
    bad = [k for k, of in ((0, 2), (1, 1)) if (colliding or 0) >= of]
    needed[bad] = math.inf
    assert ranking.top.ap == graspnet_ap(grasps, needed).ap
    assert ranking.good[-1] == 4 - len(bad)


def test_labels_judge_alone() -> None:
    grasps = with_column([2, 1], label=[1, 0], clearance=[-0.01, 0.01])
    ranking = rank_by(grasps, "label")
    assert (ranking.colliding, ranking.good) == (None, (1,))


def test_outcomes() -> None:
    outcome = ["slipped", "lifted", "", "lifted_disturbed"]
    ranking = rank_by(with_column([4, 3, 2, 1], outcome=outcome), "outcome")
    assert (ranking.criteria, ranking.grasps, ranking.good) == (("lifted",), 3, (1,))
    assert ranking.average_precision == (0.5,)
    assert ranking.top.kept.tolist() == [0, 1, 2]
    feasible = with_column([4, 3, 2, 1], outcome=["no_ik", "reachable", "", "reachable"])
    ranking = rank_by(feasible, "outcome")
    assert (ranking.criteria, ranking.grasps, ranking.good) == (("reachable",), 3, (2,))


@pytest.mark.parametrize(
    ("values", "judged", "ap"),
    [
        ([True, False, True], 3, (1 + 2 / 3) / 2),
        ([1, 0, 1], 3, (1 + 2 / 3) / 2),
        ([1.0, math.nan, 1.0], 2, 1.0),
    ],
)
def test_truth_values(values: list[float], judged: int, ap: float) -> None:
    ranking = rank_by(with_column([3, 2, 1], label=values), "label")
    assert (ranking.criteria, ranking.grasps) == (("label",), judged)
    assert ranking.average_precision[0] == pytest.approx(ap)


@pytest.mark.parametrize("values", [[0.5, 1.0], ["good", "bad"], [2, 1]])
def test_columns_that_judge_nothing(values: ArrayLike) -> None:
    with pytest.raises(InvalidInputError, match="column 'label' does not say which grasps are"):
        rank_by(with_column([2, 1], label=values), "label")


def test_an_unknown_column() -> None:
    with pytest.raises(UnknownNameError, match=r"no column 'lable'.*label"):
        rank_by(with_column([2, 1], label=[0, 1]), "lable")


@pytest.mark.parametrize("values", [[math.nan, math.nan], ["", ""]])
def test_empty_columns(values: ArrayLike) -> None:
    with pytest.raises(InvalidInputError, match="column 'label' has no values"):
        rank_by(with_column([2, 1], label=values), "label")


def test_scores_are_needed() -> None:
    with pytest.raises(InvalidInputError, match="by score, but no grasp"):
        rank_by(with_column([math.nan, 1.0], label=[1.0, math.nan]), "label")
