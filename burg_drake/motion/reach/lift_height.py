"""How high the hand can be lifted where there is no room for the whole lift.

A motion to some height holds one to every smaller height, so that the largest one is found by
halving: first that of the hand alone, which is quick, then that of the arm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from burg_drake.core import Array, Booleans, Indices
from burg_drake.core.grasps import Outcome
from burg_drake.motion.reach.verdict import Reach

STEP = 0.01
"""Distance of the heights that are tried [m]."""
DECIMALS = 9
"""Of heights in metres: adding steps up leaves roundings behind."""
WHATEVER_HEIGHT = (
    Outcome.HAND_COLLISION_APPROACH,
    Outcome.HAND_COLLISION_RETREAT,
    Outcome.NO_IK,
    Outcome.JOINT_LIMIT,
)
"""Outcomes that no smaller lift changes."""

ReachAtHeight = Callable[[float, Indices], Sequence[Reach]]
"""Verdicts on some grasps (S,) that are lifted to a height [m]."""
HandIsFree = Callable[[float, Indices], Booleans]
"""Whether the hand alone is free on its ways (S,), lifted to a height [m]."""
LevelIsFree = Callable[[int, Indices], Booleans]
"""Whether some rows (S,) are free up to a level."""


def lift_heights(least: float, most: float) -> Array:
    """What is tried, rising from `least` by `STEP` to `most` [m]."""
    rising = np.arange(least, most - 1e-9, STEP)
    rising[1:] = np.round(rising[1:], DECIMALS)
    return np.append(rising, most)


def raise_lifts(
    whole: Sequence[Reach], tried: Array, judge: ReachAtHeight, hand_is_free: HandIsFree
) -> list[Reach]:
    """Goes on with grasps whose lift is not whole.

    Args:
        whole: N verdicts with the whole lift.
        tried: (H,) rising heights, of which the last is the whole lift [m].
        judge: asks about others.
        hand_is_free: likewise.

    Returns:
        N verdicts: where there is room for the first of the heights, a yes with the largest one
        that was found, and as its `blocker` what is in the way of the whole lift; otherwise why
        there is no room for the first.
    """
    found = list(whole)
    asked = _where(
        reach.outcome is not None and reach.outcome not in WHATEVER_HEIGHT for reach in whole
    )
    low, high = np.full(len(asked), -1), np.full(len(asked), len(tried) - 1)

    def reached(level: int, rows: Indices) -> Booleans:
        verdicts = judge(tried[level], asked[rows])
        for k, reach in zip(asked[rows], verdicts, strict=True):
            if reach.outcome is None:
                found[k] = replace(reach, blocker=whole[k].blocker)
            elif level == 0:
                found[k] = reach
        return np.array([reach.outcome is None for reach in verdicts], dtype=bool)

    by_hand = _where(whole[k].outcome is Outcome.HAND_COLLISION_LIFT for k in asked)
    free, _ = _halved(
        low[by_hand],
        high[by_hand],
        lambda level, rows: hand_is_free(tried[level], asked[by_hand[rows]]),
    )
    # As high as the hand gets by itself, the arm often does, too.
    guess = np.full(len(asked), -1)
    guess[by_hand] = np.maximum(free, 0)
    high[by_hand] = guess[by_hand] + 1
    low, high = _narrowed(low, high, guess, reached)
    # Where there is no room for the first of the heights, there is none for any.
    low, high = _narrowed(low, high, np.where(low < 0, 0, -1), reached)
    _halved(low, high, reached)
    return found


def _halved(low: Indices, high: Indices, is_free: LevelIsFree) -> tuple[Indices, Indices]:
    """Neighbouring levels of which the lower is free and the upper is not, for R rows, from levels
    (R,) of which that is known."""
    while (high - low > 1).any():
        low, high = _narrowed(low, high, (low + high) // 2, is_free)
    return low, high


def _narrowed(
    low: Indices, high: Indices, middle: Indices, is_free: LevelIsFree
) -> tuple[Indices, Indices]:
    """The same with what is between them looked at at one level each (R,)."""
    low, high = low.copy(), high.copy()
    between = (low < middle) & (middle < high)
    for level in np.unique(middle[between]).tolist():
        rows = np.flatnonzero(between & (middle == level))
        free = is_free(level, rows)
        low[rows[free]], high[rows[~free]] = level, level
    return low, high


def _where(said: Iterable[bool]) -> Indices:
    return np.flatnonzero(np.fromiter(said, dtype=bool))
