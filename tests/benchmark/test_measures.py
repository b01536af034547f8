"""Measures of a benchmark against counts by hand, and intervals against an independent library."""

from __future__ import annotations

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from burg_drake.benchmark import all_tables, compare_methods, measure_all
from burg_drake.core import Outcome
from tests.benchmark.judged import (
    COLLIDES,
    CONTESTED,
    FAILED,
    LIFTED,
    OUT_OF_REACH,
    SLIPPED,
    judged,
    result,
    verdict,
)


def test_success_counts_missing_grasps_and_answers_as_failures() -> None:
    found = measure_all(
        result(
            [
                judged("a", [LIFTED, SLIPPED, LIFTED, LIFTED]),
                judged("b", [COLLIDES, LIFTED]),
                judged("c", []),
                judged("d", [], error="the planner raised KeyError"),
            ]
        )
    )
    assert found["top_success"].value == 1 / 4
    assert found["precision_3"].value == pytest.approx((2 / 3 + 1 / 3 + 0 + 0) / 4)
    first = np.mean([1, 1 / 2, 2 / 3, 3 / 4])
    second = np.mean([0, 1 / 2, 1 / 3, 1 / 4])
    assert found["average_precision"].value == pytest.approx((first + second) / 4)
    assert found["answered"].value == 2 / 4
    assert "precision_5" not in found  # the budget is four grasps


def test_steps_are_shares_of_the_judged_grasps() -> None:
    turned = verdict(Outcome.LIFTED_TURNED)
    found = measure_all(result([judged("a", [COLLIDES, OUT_OF_REACH, SLIPPED, turned])]))
    steps = ["clear", "reachable", "planned", "held", "lifted"]
    assert [found[name].value for name in steps] == [3 / 4, 2 / 4, 2 / 4, 1 / 4, 0.0]


def test_a_failed_simulation_is_no_success() -> None:
    found = measure_all(result([judged("a", [FAILED])]))
    assert found["top_success"].value == 0.0 and found["planned"].value == 1.0


def test_scenes_that_could_not_be_judged_count_nowhere() -> None:
    answers = [judged("a", [LIFTED]), judged("b", [SLIPPED]), judged("c", [None, None])]
    found = measure_all(result(answers))
    assert found["top_success"].value == 1 / 2 and found["clear"].value == 1.0
    assert measure_all(result(answers))["answered"].value == 1.0
    other = [judged("a", [SLIPPED]), judged("b", [None]), judged("c", [LIFTED])]
    comparison = compare_methods([result(answers, "x"), result(other, "y")])
    (pair,) = comparison.differences["top_success"]
    assert abs(pair.difference) == 1.0  # of scene a alone
    (counts,) = [t for t in all_tables([comparison]) if t.title == "Answers"]
    assert [row[-1] for row in counts.rows] == ["1", "1"]


def test_disturbed_is_a_share_of_executed_grasps() -> None:
    moved = verdict(Outcome.LIFTED_DISTURBED)
    found = measure_all(result([judged("a", [COLLIDES, moved, LIFTED])]))
    assert found["disturbed"].value == 1 / 2


def test_contested_verdicts_open_a_range() -> None:
    found = measure_all(result([judged("a", [CONTESTED]), judged("b", [LIFTED])]))["top_success"]
    assert (found.value, found.least, found.most) == (1.0, 0.5, 1.0)
    lost = verdict(Outcome.SLIPPED, confidence=0.6)
    found = measure_all(result([judged("a", [lost]), judged("b", [LIFTED])]))["top_success"]
    assert (found.value, found.least, found.most) == (0.5, 0.5, 1.0)
    held = measure_all(result([judged("a", [CONTESTED]), judged("b", [lost, LIFTED])]))["held"]
    assert (held.value, held.least, held.most) == (2 / 3, 1 / 3, 1.0)


def test_graspnet_ap_asks_for_a_clear_hand_and_enough_friction() -> None:
    # GraspNet's coefficients: 0.2, 0.4, ..., 1.2
    answer = judged("a", [LIFTED, COLLIDES, SLIPPED, SLIPPED], [0.3, 0.1, 0.9, np.nan])
    by_friction = []
    for mu in (0.2, 0.4, 0.6, 0.8, 1.0, 1.2):
        good = np.array([mu >= 0.3, False, mu >= 0.9, False])
        by_friction.append(np.mean([good[:k].sum() / k for k in (1, 2, 3, 4)]))
    found = measure_all(result([answer]))["graspnet_ap"]
    assert found.value == pytest.approx(np.mean(by_friction))


def test_intervals_of_yes_and_no_are_nearly_wilsons() -> None:
    answers = [judged(f"s{k}", [LIFTED if k < 13 else SLIPPED]) for k in range(20)]
    found = measure_all(result(answers))["top_success"]
    low, high = proportion_confint(13, 20, method="wilson")
    assert low - 0.03 < found.low <= low and high <= found.high < high + 0.03


def test_images_of_one_scene_are_not_independent() -> None:
    several = [judged(f"s{k // 5}", [LIFTED if k // 5 < 2 else SLIPPED]) for k in range(20)]
    apart = [judged(f"s{k}", [LIFTED if k < 10 else SLIPPED]) for k in range(20)]
    one, other = (measure_all(result(a))["top_success"] for a in (several, apart))
    assert one.value == other.value
    assert one.high - one.low > 1.5 * (other.high - other.low)
