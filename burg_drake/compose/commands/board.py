"""The command that changes the board, and boards by the name of a paper."""

from __future__ import annotations

from dataclasses import dataclass, replace

from burg_drake.compose.document import State, Surroundings
from burg_drake.core import UnknownNameError, nearest
from burg_drake.printout import PAPERS
from burg_drake.scene.document import Board

BOARD_SIZES = {name: size for name, size in PAPERS.items() if name.startswith("A")}
"""Short and long side by name, A4 to A0 [m]."""


@dataclass(frozen=True)
class SetBoard:
    """Replaces the board; objects stay where they are in its frame."""

    board: Board

    label = "change board"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        _ = self.board.layout  # refuses markers that do not fit
        return replace(state, document=replace(state.document, board=self.board))


def board_size(name: str, *, upright: bool = False) -> tuple[float, float]:
    """Extents along x and y of a board of paper size [m], across unless `upright`.

    Raises:
        UnknownNameError: no size of that name.
    """
    if name not in BOARD_SIZES:
        raise UnknownNameError(f"board size {name!r} does not exist; {nearest(name, BOARD_SIZES)}")
    short, long = BOARD_SIZES[name]
    return (short, long) if upright else (long, short)


def board_size_name(size: tuple[float, float]) -> str | None:
    """The name of a board's size, either way up; None if it is one's own."""
    sides = sorted(size)
    for name, paper in BOARD_SIZES.items():
        if all(abs(a - b) < 1e-6 for a, b in zip(sides, paper, strict=True)):
            return name
    return None
