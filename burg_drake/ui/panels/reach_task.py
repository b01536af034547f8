"""What a worker process computes for the page: where the arm grasps from above."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.scene.document import Board
from burg_drake.station.document import Station

if TYPE_CHECKING:
    from burg_drake.motion.workspace import ReachLayer


@dataclass(frozen=True)
class ReachTask:
    """Asks for a layer.

    Attributes:
        station: with an arm.
        board: under the grasps.
        height: of the grasps above the board [m].
    """

    station: Station
    board: Board
    height: float

    def __call__(self, report: Callable[[float, str], None]) -> ReachLayer:
        from burg_drake.motion.workspace import reach_from_above

        return reach_from_above(self.station, self.board, height=self.height)
