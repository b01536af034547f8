"""The panel that fills the board at random, or clears it."""

from __future__ import annotations

import viser

from burg_drake.compose.placing import Clear
from burg_drake.compose.view import View
from burg_drake.ui.buttons import quiet_button
from burg_drake.ui.page_actions import PageActions


class FillPanel:
    """Puts objects on the board at random, or takes all away.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        with gui.add_folder("Objects"):
            self._clear = actions.clicked(
                quiet_button(gui, "Clear scene", icon=viser.Icon.TRASH),
                lambda: actions.session.do(Clear()),
            )

    def show(self, view: View) -> None:
        """Brings the panel to a view."""
        self._clear.disabled = not view.instances
