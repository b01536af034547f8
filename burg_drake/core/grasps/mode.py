"""What a run asks of each grasp."""

from __future__ import annotations

from typing import Literal, get_args

Mode = Literal["hand", "reach", "arm"]
"""`hand`: the hand alone executes the grasp in simulation. `reach`: the same, of grasps that the
arm can execute. `arm`: of those, too, but the whole arm executes them."""
MODES: tuple[Mode, ...] = get_args(Mode)
"""Each asks more than the one before."""


def asks(mode: Mode, least: Mode) -> bool:
    """Whether a mode asks at least as much as another one."""
    return MODES.index(mode) >= MODES.index(least)
