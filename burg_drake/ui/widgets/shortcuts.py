"""Keys, each with what it does: one table for the page and the overlay that lists them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal
from weakref import WeakKeyDictionary

import viser

from burg_drake.ui.widgets.buttons import quiet_button
from burg_drake.ui.widgets.page_actions import PageActions
from burg_drake.ui.widgets.texts import all_of, box, table
from burg_drake.visualization.style import element

Modifier = Literal["cmd/ctrl", "shift", "cmd/ctrl+shift"]


@dataclass(frozen=True)
class Shortcut:
    """A key.

    Attributes:
        name: what of the page it calls.
        key: as viser calls it.
        modifier: held meanwhile, or None.
        label: what it does, for people.
    """

    name: str
    key: str
    modifier: Modifier | None
    label: str

    @property
    def keys(self) -> str:
        """Such as `Ctrl+Z`."""
        parts = [] if self.modifier is None else self.modifier.split("+")
        return "+".join([_SPOKEN.get(part, part) for part in (*parts, self.key)])


_SPOKEN = {
    "cmd/ctrl": "Ctrl",
    "shift": "Shift",
    "escape": "Esc",
    "delete": "Del",
    "backspace": "Backspace",
    "arrowleft": "←",
    "arrowright": "→",
    "arrowup": "↑",
    "arrowdown": "↓",
    "pageup": "Page↑",
    "pagedown": "Page↓",
}

SHORTCUTS: tuple[Shortcut, ...] = (
    Shortcut("undo", "Z", "cmd/ctrl", "Undo"),
    Shortcut("redo", "Z", "cmd/ctrl+shift", "Redo"),
    Shortcut("redo", "Y", "cmd/ctrl", "Redo"),
    Shortcut("save", "S", "cmd/ctrl", "Save the scene"),
    Shortcut("all", "A", "cmd/ctrl", "Select all objects"),
    Shortcut("none", "escape", None, "Select nothing, cancel a drag, or close this list"),
    Shortcut("delete", "delete", None, "Delete what is selected"),
    Shortcut("delete", "backspace", None, "Delete what is selected"),
    Shortcut("duplicate", "D", "cmd/ctrl", "Duplicate what is selected"),
    Shortcut("left", "arrowleft", None, "Move 5 mm to the left"),
    Shortcut("right", "arrowright", None, "Move 5 mm to the right"),
    Shortcut("far", "arrowup", None, "Move 5 mm away"),
    Shortcut("near", "arrowdown", None, "Move 5 mm nearer"),
    Shortcut("left_finely", "arrowleft", "shift", "Move 1 mm to the left"),
    Shortcut("right_finely", "arrowright", "shift", "Move 1 mm to the right"),
    Shortcut("far_finely", "arrowup", "shift", "Move 1 mm away"),
    Shortcut("near_finely", "arrowdown", "shift", "Move 1 mm nearer"),
    Shortcut("up", "pageup", None, "Move 5 mm up"),
    Shortcut("down", "pagedown", None, "Move 5 mm down"),
    Shortcut("up_finely", "pageup", "shift", "Move 1 mm up"),
    Shortcut("down_finely", "pagedown", "shift", "Move 1 mm down"),
    Shortcut("turn_left", "Q", None, "Turn by 15° counter-clockwise"),
    Shortcut("turn_right", "E", None, "Turn by 15° clockwise"),
    Shortcut("next_pose", "P", None, "Next stable pose"),
    Shortcut("axes", "X", None, "Arrows along the board, or along the object"),
    Shortcut("snap", "G", None, "Snap to the grid"),
    Shortcut("put_down", "B", None, "Put down until it stands"),
    Shortcut("settle", "S", "shift", "Settle in physics"),
    Shortcut("top", "T", None, "View from above"),
    Shortcut("front", "F", None, "View from the front"),
    Shortcut("colors", "C", None, "Next colours"),
    Shortcut("help", "H", None, "List these keys"),
)

MOUSE: tuple[tuple[str, str], ...] = (
    ("Click", "Select an object; on free space: none"),
    ("Ctrl+click", "Add an object to the selection, or remove it"),
    ("Shift+drag on free space", "Select all in a rectangle"),
    ("Drag an object", "Move it, and all that is selected with it, over the board"),
    ("Shift+drag an object", "Turn it about the vertical"),
    ("Drag an arrow or a ring", "Move or turn what is selected along it or about it"),
    ("Drag on free space, wheel, right drag", "Rotate, zoom and shift the view"),
)

ActionCall = Callable[[viser.ClientHandle | None], Any]


def register(gui: viser.GuiApi, actions: PageActions, calls: dict[str, ActionCall]) -> None:
    """Makes the keys work, and lists them in viser's palette of commands (Ctrl+K).

    Args:
        gui: of viser.
        actions: what may be done.
        calls: by the names of `SHORTCUTS`; each gets the page that the key was pressed on.
    """
    for shortcut in SHORTCUTS:
        call = calls[shortcut.name]
        command = gui.add_command(
            shortcut.label,
            hotkey=shortcut.key,  # type: ignore[arg-type]
            modifier=shortcut.modifier,
        )

        @command.on_trigger
        async def _(event: Any, call: ActionCall = call) -> None:
            actions.submit(lambda: call(event.client), event.client)

    typed = gui.add_command("Take what was typed", hotkey="enter", modifier="alt+shift")

    @typed.on_trigger  # by first_page.js; any action makes what was typed before it count
    async def _(event: Any) -> None:
        actions.submit(lambda: None, event.client)


class KeysDialog:
    """Lists mouse and keys on pages; viser gives its dialogs no way to be closed.

    Args:
        actions: what may be done.
    """

    def __init__(self, actions: PageActions) -> None:
        self._actions = actions
        self._open: WeakKeyDictionary[viser.ClientHandle, Any] = WeakKeyDictionary()

    def toggle(self, client: viser.ClientHandle | None) -> None:
        """Shows the list on a page, or closes it."""
        if client is None or self.close(client):
            return
        modal = self._open[client] = client.gui.add_modal("Mouse and keys")
        with modal:
            button = quiet_button(client.gui, "Close", hint="Close (H or Esc)")
            client.gui.add_html(overlay_text())
        self._actions.clicked(button, lambda: self.close(client))

    def close(self, client: viser.ClientHandle) -> bool:
        """Closes the list on a page; False if it shows none."""
        modal = self._open.pop(client, None)
        if modal is not None:
            modal.close()
        return modal is not None


def overlay_text() -> str:
    """The list as HTML."""

    def key(text: str) -> Any:
        return element("span", text, class_="bd-key")

    keys: dict[str, list[str]] = {}
    for shortcut in SHORTCUTS:
        keys.setdefault(shortcut.label, []).append(shortcut.keys)
    rows = [(key(how), what) for how, what in MOUSE]
    rows += [(key(" or ".join(how)), what) for what, how in keys.items()]
    return all_of(box(table(("Do", "What happens"), rows)))
