"""How objects can be laid out on a board, by name."""

from __future__ import annotations

from typing import Literal, get_args

LayoutName = Literal["random", "wide", "close", "touching", "packed", "heap"]
"""`random`: anywhere on the board; `wide`: with room for an open hand's fingers in between; `close`
and `touching`: beside one another, a few millimetres apart or in contact; `packed`: as dense as it
gets; `heap`: in any orientation above a spot, to be dropped."""
LAYOUTS: tuple[LayoutName, ...] = get_args(LayoutName)

PoseChoice = Literal["probability", "uniform", "as_scanned"]
"""Which of its stable poses an object gets: by their probabilities, each as often,
or as its mesh stands, where that is stable, and else the most probable one."""

TRIES = 100
"""Random places that are tried for an object."""
