"""Groups hold every grasp exactly once, whatever the column is like."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from burg_drake.core import CATEGORY_COLORS, Outcome
from burg_drake.visualization import (
    COLOR_BINS,
    OTHERS_COLOR,
    UNKNOWN_COLOR,
    GraspGroup,
    group_by_name,
    group_by_number,
    group_by_outcome,
    map_colors,
    outcome_group,
    single_group,
)


def members(groups: tuple[GraspGroup, ...]) -> list[int]:
    return sorted(i for group in groups for i in group.members.tolist())


@pytest.mark.parametrize(
    "numbers",
    [
        np.random.default_rng(0).normal(size=1000),
        np.array([math.nan, 1.0, math.inf, -math.inf]),
        np.full(7, 0.25),
        np.full(3, math.nan),
        np.array([0, 1, 1, 0, 1]),
        np.empty(0),
    ],
)
def test_each_grasp_is_in_one_group(numbers: np.ndarray) -> None:
    found = group_by_number(numbers)
    assert members(found.groups) == list(range(len(numbers)))
    assert len({g.key for g in found.groups}) == len(found.groups)
    assert len(found.groups) <= COLOR_BINS + 1
    assert found.counts.sum() == np.count_nonzero(~np.isnan(numbers))


def test_colors_rise_with_the_numbers() -> None:
    numbers = np.array([0.9, 0.1, 0.5, math.nan])
    found = group_by_number(numbers, (0.0, 1.0))
    color = {i: g.rgba for g in found.groups for i in g.members.tolist()}
    for i, number in enumerate(numbers[:3]):
        assert color[i][:3] == pytest.approx(map_colors(number).tolist(), abs=0.03)
        assert color[i][3] == 1.0
    assert color[3] == UNKNOWN_COLOR
    assert [g.label for g in found.groups][-1] == "not known"


def test_names_by_frequency() -> None:
    names = ["b"] * 3 + ["a"] * 5 + [""] * 2 + ["c"] * 3
    groups = group_by_name(names)
    assert [(g.label, len(g.members)) for g in groups] == [
        ("a", 5),
        ("b", 3),
        ("c", 3),
        ("not known", 2),
    ]
    assert [g.rgba for g in groups] == [*CATEGORY_COLORS[:3], UNKNOWN_COLOR]
    assert members(groups) == list(range(len(names)))


def test_many_names() -> None:
    names = [f"n{i % 50}" for i in range(500)] + ["often"] * 20
    groups = group_by_name(names)
    assert len(groups) == len(CATEGORY_COLORS) + 1
    assert groups[0].label == "often"
    assert (
        groups[-1].label == f"{51 - len(CATEGORY_COLORS)} others"
        and groups[-1].rgba == OTHERS_COLOR
    )
    assert members(groups) == list(range(len(names)))


def test_one_name_more_than_there_are_colors() -> None:
    groups = group_by_name([f"n{i}" for i in range(len(CATEGORY_COLORS) + 1)])
    assert groups[-1].label == "1 other"


def test_names_that_are_outcomes_have_their_colors() -> None:
    names = ["slipped", "lifted", "", "lifted"]
    groups = {g.key: g for g in group_by_name(names)}
    assert set(groups) == {"lifted", "slipped", "not_judged"}
    assert groups["lifted"].rgba == outcome_group(Outcome.LIFTED).rgba
    assert groups["lifted"].members.tolist() == [1, 3]
    assert groups["not_judged"].members.tolist() == [2]
    mixed = group_by_name(["lifted", "mug"])
    assert all(g.rgba in CATEGORY_COLORS for g in mixed)


def test_outcomes_best_first() -> None:
    outcomes = [None, *reversed(Outcome), Outcome.LIFTED]
    groups = group_by_outcome(outcomes)
    assert groups[0].key == "lifted" and groups[-1].key == "not_judged"
    assert Counter(len(g.members) for g in groups) == {1: len(Outcome), 2: 1}
    assert members(groups) == list(range(len(outcomes)))


def test_all_alike() -> None:
    (group,) = single_group(4)
    assert group.members.tolist() == [0, 1, 2, 3]
    assert single_group(0) == ()
