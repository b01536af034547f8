"""The top of the page: which scene it is, whether it is saved, how it stands, undo and redo."""

from __future__ import annotations

from collections import Counter
from typing import Any

import viser

from burg_drake.compose.editing import SessionView
from burg_drake.ui.widgets import (
    STATUS_STYLES,
    KeysDialog,
    PageActions,
    all_of,
    box,
    notice,
    quiet,
    quiet_button,
    status_chip,
    title,
)
from burg_drake.visualization.style import Html, element


class SummaryPanel:
    """Says how the scene is, and takes steps back.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
        keys: the list of mouse and keys.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions, keys: KeysDialog) -> None:
        icon, session = viser.Icon, actions.session
        self._text = gui.add_html("")
        self._dismiss = actions.clicked(quiet_button(gui, "I have read this"), self._read)
        self._undo = actions.clicked(
            quiet_button(gui, "Undo", width=4, icon=icon.ARROW_BACK_UP), session.undo
        )
        self._redo = actions.clicked(
            quiet_button(gui, "Redo", width=4, icon=icon.ARROW_FORWARD_UP), session.redo
        )
        actions.clicked_by(
            quiet_button(gui, "Keys", width=4, icon=icon.KEYBOARD, hint="Mouse and keys (H)"),
            keys.toggle,
        )
        self._session = session

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        text = all_of(box(*_summary(view)))
        if self._text.content != text:
            self._text.content = text
        self._dismiss.visible = bool(view.notices)
        for button, label, verb in (
            (self._undo, view.undo_label, "Undo"),
            (self._redo, view.redo_label, "Redo"),
        ):
            _set_enabled(button, label, verb)

    def _read(self) -> None:
        for line in self._session.view.notices:
            self._session.dismiss(line)


def _set_enabled(button: Any, label: str | None, verb: str) -> None:
    button.disabled = label is None
    button.hint = f"{verb}: {label}" if label else f"Nothing to {verb.lower()}"


def _summary(view: SessionView) -> list[Html]:
    count: Counter[str] = Counter(view.status.values())
    state = "saved" if view.saved else "not saved"
    where = view.path.name if view.path else "no file yet"
    chips = [status_chip(status, count[status]) for status in STATUS_STYLES if count[status]]
    return [
        title(view.document.name),
        quiet(f"{where}, {state}"),
        element("div", *(chips or [quiet("The board is empty.")])),
        *(notice(line) for line in view.notices),
    ]
