"""The panel that fills the board at random, or clears it."""

from __future__ import annotations

from typing import Any

import viser

from burg_drake.compose.commands import MAX_OBJECTS, Clear, RandomConfiguration
from burg_drake.compose.editing import SessionView
from burg_drake.scene.document import LAYOUTS
from burg_drake.ui.widgets import PageActions, confirm, counted, quiet_button

MAX_SEED = 2**31 - 1


class FillPanel:
    """Puts objects on the board at random, or takes all away.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._actions = actions
        icon = viser.Icon
        with gui.add_folder("Random configuration"):
            self._count = gui.add_number(
                "Objects", 0, min=0, max=MAX_OBJECTS, step=1, hint="0: those that are on the board"
            )
            self._layout = gui.add_dropdown("Layout", LAYOUTS)
            self._seed: Any = gui.add_number(
                "Seed", 1, min=0, max=MAX_SEED, step=1, hint="Of the next configuration"
            )
            actions.clicked(
                quiet_button(gui, "Shuffle", width=6, icon=icon.ARROWS_SHUFFLE), self._shuffle
            )
            self._clear = actions.clicked_by(
                quiet_button(gui, "Clear scene", width=6, icon=icon.TRASH), self._ask_to_clear
            )

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        self._clear.disabled = not view.instances

    def _ask_to_clear(self, client: viser.ClientHandle | None) -> None:
        session = self._actions.session
        count = len(session.view.instances)
        if client is not None and count:
            confirm(
                self._actions,
                client,
                "Clear the scene?",
                f"This takes {counted(count, 'object')} off the board. Undo (Ctrl+Z) brings"
                " everything back.",
                "Clear it",
                lambda: session.do(Clear()),
            )

    def _shuffle(self) -> None:
        seed = self._seed.value
        self._seed.value = min(seed + 1, MAX_SEED)  # also if there is no room this time
        self._actions.session.do(
            RandomConfiguration(seed, self._count.value or None, self._layout.value)
        )
