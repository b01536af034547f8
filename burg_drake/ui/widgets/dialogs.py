"""Questions to one page before something is done that cannot be undone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from burg_drake.ui.widgets.buttons import quiet_button, strong_button
from burg_drake.ui.widgets.page_actions import PageActions
from burg_drake.ui.widgets.texts import all_of, box


def confirm(
    actions: PageActions,
    client: viser.ClientHandle,
    title: str,
    text: str,
    label: str,
    action: Callable[[], Any],
) -> None:
    """Asks a page whether something shall be done.

    Args:
        actions: of the page.
        client: the page.
        title: of the question.
        text: what would be lost.
        label: of the button that does it.
        action: what it does.
    """
    gui = client.gui
    modal = gui.add_modal(title)
    with modal:
        gui.add_html(all_of(box(text)))
        yes = strong_button(gui, label, width=6, color="red")
        no = quiet_button(gui, "Cancel", width=6)

    def go_on() -> None:
        modal.close()
        action()

    actions.clicked(yes, go_on)
    actions.clicked(no, modal.close)
