"""How high there is room: against a search through every height, with hands and arms made up."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import Outcome
from burg_drake.motion import Reach, lift_heights, raise_lifts

TRIED = lift_heights(0.02, 0.30)
HAND, ARM = Reach(Outcome.HAND_COLLISION_LIFT, "roof"), Reach(Outcome.LIFT_LINE, "link vs roof")


class MadeUp:
    """Grasps of which the hand, and the arm, get to known heights (N,) [m]."""

    def __init__(self, hand: np.ndarray, arm: np.ndarray) -> None:
        self.hand, self.arm, self.asked = hand, arm, 0

    def judge(self, height: float, some: np.ndarray) -> list[Reach]:
        self.asked += len(some)
        return [
            HAND
            if height > self.hand[k]
            else ARM
            if height > self.arm[k]
            else Reach(None, lift=height)
            for k in some
        ]

    def hand_is_free(self, height: float, some: np.ndarray) -> np.ndarray:
        return np.asarray(height <= self.hand[some])

    def found(self) -> list[Reach]:
        whole = self.judge(TRIED[-1], np.arange(len(self.hand)))
        return raise_lifts(whole, TRIED, self.judge, self.hand_is_free)


def test_heights_lie_a_centimetre_apart_between_the_least_and_the_whole() -> None:
    np.testing.assert_allclose(TRIED, np.arange(2, 31) / 100.0)
    np.testing.assert_allclose(lift_heights(0.0, 0.025), [0.0, 0.01, 0.02, 0.025])
    np.testing.assert_array_equal(lift_heights(0.3, 0.3), [0.3])


def test_the_largest_height_with_a_reserve_is_found() -> None:
    """Below an obstacle 1 cm is left, if the least height allows."""
    rng = np.random.default_rng(1)
    hand, arm = rng.uniform(-0.05, 0.4, (2, 500))
    for k, reach in enumerate(MadeUp(hand, arm).found()):
        room = TRIED[min(hand[k], arm[k]) >= TRIED]
        if len(room):
            with_hand = TRIED[max((hand[k] >= TRIED).sum() - 2, 0)]
            with_arm = TRIED[max((arm[k] >= TRIED).sum() - 2, 0)]
            stopped_by_hand = hand[k] < TRIED[-1] and arm[k] >= with_hand
            expected = with_hand if stopped_by_hand else with_arm
            if len(room) == len(TRIED):
                expected = TRIED[-1]
            assert reach.outcome is None and reach.lift == expected
            whole = HAND if hand[k] < 0.3 else ARM
            assert reach.blocker == ("" if len(room) == len(TRIED) else whole.blocker)
        else:  # what is said is that of the least height
            assert reach is (HAND if hand[k] < 0.02 else ARM)


def test_what_no_lift_changes_is_not_asked_again() -> None:
    made_up = MadeUp(np.empty(0), np.empty(0))
    whole = [Reach(Outcome.NO_IK), Reach(Outcome.HAND_COLLISION_RETREAT, "table"), Reach(None)]
    found = raise_lifts(whole, TRIED, made_up.judge, made_up.hand_is_free)
    assert found == whole and made_up.asked == 0


@pytest.mark.parametrize(("hand", "arm", "most"), [(0.12, 0.4, 2), (0.4, 0.01, 2), (0.4, 0.2, 8)])
def test_few_heights_are_asked_about(hand: float, arm: float, most: int) -> None:
    made_up = MadeUp(np.array([hand]), np.array([arm]))
    made_up.found()
    assert made_up.asked <= most
