"""The panel that lines objects up: on a grid, against each other, along an edge, at equal gaps."""

from __future__ import annotations

from functools import partial
from typing import Any

import viser

from burg_drake.compose.commands import (
    Align,
    Direction,
    Distribute,
    PutDown,
    SnapToContact,
    SnapToGrid,
)
from burg_drake.compose.editing import SessionView
from burg_drake.ui.widgets import PageActions, all_of, box, head, quiet_button

GRID_MM = 10.0
FINEST_MM, COARSEST_MM = 0.1, 1000.0


class ArrangePanel:
    """Buttons that move what is selected.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._gui, self._actions = gui, actions
        self._folder = gui.add_folder("Arrange")
        with self._folder:
            self._contact()
            self._grid = gui.add_number(
                "Grid [mm]", GRID_MM, min=FINEST_MM, max=COARSEST_MM, step=0.1
            )
            actions.clicked(
                quiet_button(gui, "Snap to grid", icon=viser.Icon.GRID_DOTS, hint="Snap (G)"),
                self.snap,
            )
            self._several = gui.add_folder(None)
            with self._several:
                self._alignment()

    @property
    def spacing(self) -> float:
        """Of the grid [m]."""
        return 1e-3 * float(self._grid.value)

    def snap(self) -> None:
        """Brings what is selected onto the grid."""
        session = self._actions.session
        session.do(SnapToGrid(session.view.selection, self.spacing))

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        self._folder.visible = bool(view.selection)
        self._several.visible = len(view.selection) > 1

    def _contact(self) -> None:
        self._gui.add_html(all_of(box(head("Move until it touches"))))
        directions: tuple[tuple[str, Direction, str], ...] = (
            ("←", "-x", "to the left"),
            ("→", "x", "to the right"),
            ("↓", "-y", "to the front"),
            ("↑", "y", "to the back"),
        )
        for label, direction, where in directions:
            self._button(
                label, 2, f"Move {where} until it touches something", partial(_snap, direction)
            )
        self._button("Put down", 4, "Lower it until it stands (B)", PutDown)

    def _alignment(self) -> None:
        self._gui.add_html(all_of(box(head("Align"))))
        icon = viser.Icon
        for edge, drawn, what in (
            ("left", icon.LAYOUT_ALIGN_LEFT, "left edges"),
            ("center_x", icon.LAYOUT_ALIGN_CENTER, "middles, in a column"),
            ("right", icon.LAYOUT_ALIGN_RIGHT, "right edges"),
            ("top", icon.LAYOUT_ALIGN_TOP, "far edges"),
            ("center_y", icon.LAYOUT_ALIGN_MIDDLE, "middles, in a row"),
            ("bottom", icon.LAYOUT_ALIGN_BOTTOM, "near edges"),
        ):
            self._button("", 2, f"Align {what}", lambda names, e=edge: Align(names, e), icon=drawn)
        self._button("Even gaps ↔", 6, "Distribute along x", lambda names: Distribute(names, "x"))
        self._button("Even gaps ↕", 6, "Distribute along y", lambda names: Distribute(names, "y"))

    def _button(self, label: str, width: int, hint: str, command: Any, **options: Any) -> None:
        button = quiet_button(self._gui, label, width=width, hint=hint, **options)
        self._actions.clicked(button, self._actions.with_selection(command))


def _snap(direction: Direction, names: tuple[str, ...]) -> SnapToContact:
    return SnapToContact(names, direction)
