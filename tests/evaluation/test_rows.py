"""Which grasps are the best ones of a table."""

from __future__ import annotations

import math

import numpy as np
import pytest

from burg_drake.core import Outcome, UnknownNameError
from burg_drake.evaluation import Columns, best_rows, rows_of

MILLIMETRE = 1e-3


def table(*rows: dict[str, float], outcome: Outcome = Outcome.LIFTED) -> Columns:
    """Lifted grasps g0, g1, ... that are equal but for the given margins."""
    usual = {"slip": 0.0, "tilt": 0.0, "others_moved": 0.0, "patch_area": 1e-4, "score": 0.5}
    columns: Columns = {
        name: np.array([row.get(name, value) for row in rows]) for name, value in usual.items()
    }
    columns["clearance"] = np.array([row.get("clearance", 0.004) for row in rows])
    columns["object"] = np.array(["mug"] * len(rows))
    columns["instance"] = columns["object"].copy()
    columns["id"] = np.array([f"g{k}" for k in range(len(rows))])
    columns["outcome"] = np.array([outcome.value] * len(rows), dtype=object)
    return columns


def test_the_least_moved_come_first_and_only_lifted_ones_count() -> None:
    columns = table(
        {"slip": 2 * MILLIMETRE},
        {"others_moved": 3 * MILLIMETRE},  # weighs half as much as slip
        {"tilt": math.radians(1.0)},  # as much as 0.87 mm of slip
        {},
    )
    assert best_rows(columns, 10) == [3, 2, 1, 0]
    assert best_rows(columns) == [3]
    columns["outcome"][3] = Outcome.LIFTED_DISTURBED.value
    assert best_rows(columns, 10) == [2, 1, 0]
    assert best_rows(table({}, outcome=Outcome.DROPPED)) == []


def test_rows_of_a_grasp_are_all_of_its_rows() -> None:
    columns = {"id": np.array(["mug-a", "mug-b", "mug-a"])}
    assert rows_of(columns, "mug-a", "a.csv") == [0, 2] and rows_of(columns, "mug-b", "") == [1]
    with pytest.raises(UnknownNameError, match=r"^a.csv .* 'mug-c'"):
        rows_of(columns, "mug-c", "a.csv")


def test_room_around_the_hand_comes_first() -> None:
    """5.2 and 5.4 mm are the same step of 0.5 mm; what is not known comes last."""
    columns = table(
        {"clearance": math.nan},
        {"clearance": 5.4 * MILLIMETRE, "slip": 1 * MILLIMETRE},
        {"clearance": 5.2 * MILLIMETRE},
        {"clearance": 9.0 * MILLIMETRE, "slip": 4 * MILLIMETRE, "tilt": 0.1},
        {"clearance": 0.0},
    )
    assert best_rows(columns, 10) == [3, 2, 1, 4, 0]


def test_the_best_of_each_object_or_of_some() -> None:
    columns = table(*({"clearance": k * MILLIMETRE} for k in range(6)))
    columns["object"] = np.array(["mug", "can", "mug", "mug", "can", "box"])
    columns["instance"] = np.array(["mug", "can", "mug_2", "mug", "can", "box"])
    assert best_rows(columns, 2) == [5, 4]
    assert best_rows(columns, 2, each=True) == [3, 2, 4, 1, 5]
    assert best_rows(columns, 9, only=["mug"]) == [3, 2, 0]
    assert best_rows(columns, 1, each=True, only=["mug_2", "box"]) == [2, 5]
    with pytest.raises(UnknownNameError, match=r"no grasps of 'mgu'; did you mean 'mug'\?"):
        best_rows(columns, only=["mgu"])


def test_noise_ranks_nothing() -> None:
    """0.01 mm and 0.01 deg are less than a step; patch, score and id then decide, in this order."""
    columns = table(
        {"patch_area": 1e-4, "score": 0.5},
        {"patch_area": 1.3e-6, "score": 1.0},
        {"slip": 0.01 * MILLIMETRE, "patch_area": 2e-4, "score": 0.1},
        {"tilt": math.radians(0.01), "patch_area": 1e-4 + 1e-9, "score": 0.6},
        {"others_moved": 0.01 * MILLIMETRE, "patch_area": 1e-4 - 1e-9, "score": 0.5},
    )
    assert best_rows(columns, 10) == [2, 3, 0, 4, 1]


def test_sums_that_are_equal_rank_equal() -> None:
    """0.3 mm of slip and 0.6 mm of push weigh the same, though not to the last bit."""
    slip, push = {"slip": 0.3 * MILLIMETRE}, {"others_moved": 0.6 * MILLIMETRE}
    large = {"patch_area": 2e-4}
    assert best_rows(table(slip, {**push, **large}), 2) == [1, 0]
    assert best_rows(table(push, {**slip, **large}), 2) == [1, 0]


def test_what_is_not_known_is_no_error() -> None:
    unknown = {"patch_area": math.nan, "score": math.nan, "others_moved": math.nan}
    assert best_rows(table(unknown, {"score": math.nan}, {}), 3) == [2, 1, 0]
