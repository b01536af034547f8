"""The panel of the display: colours of objects, markers, and where the camera looks from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from burg_drake.ui.view import Coloring, PageViews
from burg_drake.ui.widgets import PageActions, quiet_button

COLORINGS: dict[str, Coloring] = {
    "as they look": "objects",
    "by status": "status",
    "random": "random",
}


class DisplayPanel:
    """Chooses how the scene is drawn.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
        views: of all pages.
        on_change: called when something is to be drawn differently.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        actions: PageActions,
        views: PageViews,
        on_change: Callable[[], None],
    ) -> None:
        self._views = views
        self._on_change = on_change
        icon = viser.Icon
        with gui.add_folder("Display"):
            self._colors: Any = gui.add_dropdown("Objects", tuple(COLORINGS))
            self._markers = gui.add_checkbox("Markers", True)
            for field in (self._colors, self._markers):
                actions.chosen(field, lambda value: on_change())
            actions.clicked_by(
                quiet_button(gui, "From above", width=6, icon=icon.ARROW_BAR_DOWN, hint="View (T)"),
                self.look_from_above,
            )
            actions.clicked_by(
                quiet_button(
                    gui, "From the front", width=6, icon=icon.PERSPECTIVE, hint="View (F)"
                ),
                self.look_from_front,
            )

    @property
    def coloring(self) -> Coloring:
        """Which colours objects have."""
        return COLORINGS.get(self._colors.value, "objects")

    @property
    def markers(self) -> bool:
        """Whether markers are drawn on the board."""
        return bool(self._markers.value)

    def next_colors(self) -> None:
        """Goes on to the next colours."""
        names = tuple(COLORINGS)
        self._colors.value = names[(names.index(self._colors.value) + 1) % len(names)]
        self._on_change()

    def look_from_above(self, client: viser.ClientHandle | None) -> None:
        """Brings a page's camera above the board."""
        if client is not None:
            self._views.look(client, above=True)

    def look_from_front(self, client: viser.ClientHandle | None) -> None:
        """Brings a page's camera in front of the board."""
        if client is not None:
            self._views.look(client, above=False)
