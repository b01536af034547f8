"""Keyboard shortcuts: the keys, their actions, and the dialog that lists them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal
from weakref import WeakKeyDictionary

import numpy as np
import viser

from burg_drake.compose import (
    ComposeSession,
    Delete,
    Duplicate,
    MoveObjects,
    PutDown,
    SetPose,
    Turn,
    nearest_stable_pose,
)
from burg_drake.core import InvalidInputError
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.panel_parts import html_table, paragraph, text_button
from burg_drake.visualization import element


def selection_actions(session: ComposeSession) -> dict[str, Callable[[], Any]]:
    """Actions of the shortcuts for undo, redo and the selection, by the names of `SHORTCUTS`."""
    # Unit vectors in S by the name of the shortcut.
    directions = {
        "left": (-1.0, 0.0, 0.0),
        "right": (1.0, 0.0, 0.0),
        "far": (0.0, 1.0, 0.0),
        "near": (0.0, -1.0, 0.0),
        "up": (0.0, 0.0, 1.0),
        "down": (0.0, 0.0, -1.0),
    }

    def selected() -> tuple[str, ...]:
        return session.view.selection

    calls: dict[str, Callable[[], Any]] = {
        "undo": session.undo,
        "redo": session.redo,
        "all": lambda: session.select(session.view.instances),
        "delete": lambda: session.do(Delete(selected())),
        "duplicate": lambda: session.do(Duplicate(selected())),
        "put_down": lambda: session.do(PutDown(selected())),
        "turn_left": lambda: session.do(Turn(selected(), 15.0)),
        "turn_right": lambda: session.do(Turn(selected(), -15.0)),
        "next_pose": lambda: set_next_stable_pose(session),
    }
    for name, direction in directions.items():
        for kind, step in ((name, 5e-3), (f"{name}_finely", 1e-3)):
            calls[kind] = partial(shift_selection, session, step * np.array(direction))
    return calls


def shift_selection(session: ComposeSession, offset: Any) -> None:
    """Moves the selected objects by an offset (3,) in S [m]."""
    view = session.view
    X_SO = {name: view.X_SO(name) for name in view.selection}
    for X in X_SO.values():
        X[:3, 3] += offset
    session.do(MoveObjects(X_SO, changes_height=True))


def set_next_stable_pose(session: ComposeSession) -> None:
    """Puts the selected objects, all of one kind, into their next stable pose.

    Raises:
        InvalidInputError: nothing is selected, or the object has no stable poses.
    """
    view = session.view
    if not view.selection:
        raise InvalidInputError("nothing is selected; select an object")
    first = view.selection[0]
    found = nearest_stable_pose(view.state, first)
    if found is None:
        raise InvalidInputError(f"{first!r} has no stable poses")
    count = len(view.state.entry(first).stable_poses)
    session.do(SetPose(view.selection, (found[0] + 1) % count))


Modifier = Literal["cmd/ctrl", "shift", "cmd/ctrl+shift"]


@dataclass(frozen=True)
class Shortcut:
    """A keyboard shortcut.

    Attributes:
        name: name of its action.
        key: name of the key in viser.
        modifier: key to be held down, or None.
        label: description of the action.
    """

    name: str
    key: str
    modifier: Modifier | None
    label: str

    @property
    def keys(self) -> str:
        """Text of the keys, such as `Ctrl+Z`."""
        parts = [] if self.modifier is None else self.modifier.split("+")
        return "+".join([_KEY_NAMES.get(part, part) for part in (*parts, self.key)])


_KEY_NAMES = {
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
"""Names of keys in the list of shortcuts."""

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
"""All shortcuts, for the page and the list of shortcuts."""

MOUSE_ACTIONS: tuple[tuple[str, str], ...] = (
    ("Click", "Select an object; on free space: none"),
    ("Ctrl+click", "Add an object to the selection, or remove it"),
    ("Shift+drag on free space", "Select all in a rectangle"),
    ("Drag an object", "Move it, and all that is selected with it, over the board"),
    ("Shift+drag an object", "Turn it about the vertical"),
    ("Drag an arrow or a ring", "Move or turn what is selected along it or about it"),
    ("Drag on free space, wheel, right drag", "Rotate, zoom and shift the view"),
)
"""Mouse actions in the list of shortcuts."""

ActionCall = Callable[[viser.ClientHandle | None], Any]


def register_shortcuts(
    gui: viser.GuiApi, actions: PageActions, calls: dict[str, ActionCall]
) -> None:
    """Registers the shortcuts, also in viser's command palette (Ctrl+K).

    Args:
        gui: API of viser.
        actions: actions of the page.
        calls: functions by the names of `SHORTCUTS`; each takes the page whose key was pressed.
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

    @typed.on_trigger  # by first_page.js; any action applies the values typed before it
    async def _(event: Any) -> None:
        actions.submit(lambda: None, event.client)


class KeysDialog:
    """Shows the list of mouse actions and shortcuts on pages, with a button to close it.

    Args:
        actions: actions of the page.
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
            button = text_button(client.gui, "Close", hint="Close (H or Esc)")
            client.gui.add_html(shortcut_list_html())
        self._actions.on_click(button, lambda: self.close(client))

    def close(self, client: viser.ClientHandle) -> bool:
        """Closes the list on a page; False if it shows none."""
        modal = self._open.pop(client, None)
        if modal is not None:
            modal.close()
        return modal is not None


def shortcut_list_html() -> str:
    """The list of mouse actions and shortcuts as HTML."""

    def key(text: str) -> Any:
        return element("span", text, class_="bd-key")

    keys: dict[str, list[str]] = {}
    for shortcut in SHORTCUTS:
        keys.setdefault(shortcut.label, []).append(shortcut.keys)
    rows = [(key(how), what) for how, what in MOUSE_ACTIONS]
    rows += [(key(" or ".join(how)), what) for what, how in keys.items()]
    return paragraph(html_table(("Do", "What happens"), rows))
