"""The panel of the board: paper sizes, across or upright, or a size of one's own."""

from __future__ import annotations

from dataclasses import replace

import viser

from burg_drake.compose.commands import BOARD_SIZES, SetBoard, board_size, board_size_name
from burg_drake.compose.editing import SessionView
from burg_drake.ui.widgets import PageActions

OWN_SIZE = "own size"
ACROSS, UPRIGHT = "across", "upright"
MAX_SIDE_MM = 100_000.0


class BoardPanel:
    """Chooses the board.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._actions = actions
        self._own = False
        with gui.add_folder("Board"):
            self._size = actions.chosen(
                gui.add_dropdown("Size", (*BOARD_SIZES, OWN_SIZE)), self._choose
            )
            self._orientation = actions.chosen(
                gui.add_dropdown("Lies", (ACROSS, UPRIGHT)), self._turn
            )
            self._extents = actions.typed(
                gui.add_vector2(
                    "Width, depth [mm]",
                    (594.0, 420.0),
                    min=(1.0, 1.0),
                    max=(MAX_SIDE_MM, MAX_SIDE_MM),
                    step=0.1,
                ),
                self._resize,
            )

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        size = view.document.board.size
        name = board_size_name(size)
        self._own = self._own or name is None
        self._size.value = OWN_SIZE if self._own or name is None else name
        self._orientation.value = UPRIGHT if size[1] > size[0] else ACROSS
        self._orientation.visible = not self._own
        self._extents.handle.visible = self._own
        self._extents.show(tuple(round(1e3 * side, 3) for side in size))

    def _choose(self, name: str) -> None:
        self._own = name == OWN_SIZE
        if self._own:
            self.show(self._actions.session.view)
            return
        width, depth = self._actions.session.view.document.board.size
        self._set(board_size(name, upright=depth > width))

    def _turn(self, orientation: str) -> None:
        short, long = sorted(self._actions.session.view.document.board.size)
        self._set((short, long) if orientation == UPRIGHT else (long, short))

    def _resize(self, extents_mm: tuple[float, float]) -> None:
        width, depth = (round(1e-3 * side, 6) for side in extents_mm)
        self._set((width, depth), field="board")

    def _set(self, size: tuple[float, float], field: str = "") -> None:
        session = self._actions.session
        session.do(SetBoard(replace(session.view.document.board, size=size)), field=field)
