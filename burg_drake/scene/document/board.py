"""The printed board: its size, and the markers on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from burg_drake.core import InvalidInputError
from burg_drake.core.documents import require_finite
from burg_drake.scene.document.markers import MarkerLayout, Markers, marker_layout

LARGEST = 100.0
"""Side of a board [m]."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """The printed board. The origin of the scene frame S is its lower left corner.

    Attributes:
        size: lengths along x and y [m]; A2 landscape if left out.
        markers: ArUco markers printed on the board.
    """

    size: tuple[float, float] = (0.594, 0.420)
    markers: Markers = Markers()

    def __post_init__(self) -> None:
        require_finite(self)
        if not 0.0 < min(self.size) <= max(self.size) <= LARGEST:
            raise InvalidInputError(
                f"board size {list(self.size)} must be above 0 and at most {LARGEST:g} m;"
                " A2 is [0.594, 0.42]"
            )

    @cached_property
    def layout(self) -> MarkerLayout:
        """Where its markers lie; see `scene.document.markers.marker_layout`.

        Raises:
            InvalidInputError: they do not fit.
        """
        return marker_layout(self.size, self.markers)
