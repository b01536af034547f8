"""What a run asks of each grasp."""

from __future__ import annotations

from typing import Literal, get_args

Mode = Literal["hand", "reach", "arm"]
"""`hand`: the hand alone executes the grasp in simulation. `reach`: the same, of grasps that the
arm can execute. `arm`: of those, too, but the whole arm executes them."""
MODES: tuple[Mode, ...] = get_args(Mode)
"""Each asks more than the one before."""


Least = Mode | Literal["approach"]
"""The least mode that finds something out; `approach`: the whole arm, or the hand alone where its
approach is simulated."""


def asks(mode: Mode, least: Least, *, approach: bool = False) -> bool:
    """Whether a mode asks at least as much as another one.

    Args:
        mode: that is asked about.
        least: the other one.
        approach: whether the approach of the hand alone is simulated.
    """
    if least == "approach":
        return approach or mode == "arm"
    return MODES.index(mode) >= MODES.index(least)
