"""How panels reach the session: every click and every field becomes an action in one queue."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import viser

from burg_drake.compose import ComposeSession
from burg_drake.compose.commands import Command
from burg_drake.ui.widgets.action_queue import ActionQueue
from burg_drake.ui.widgets.typed_field import TYPING_DELAY, TypedField

MESSAGE_DURATION, WARNING_DURATION = 5.0, 12.0
"""Messages stay for that time [s]: those that tell what was done, those that tell what failed."""
MAX_MESSAGES = 3
"""On a page at a time: older ones make room, so that a new one is never out of view."""


class PageActions:
    """What panels may do.

    Args:
        server: to show messages with.
        session: the scene.

    Attributes:
        queue: in which all actions are done.
        on_refused: called after an action that was refused: fields show again what is so.
    """

    def __init__(self, server: viser.ViserServer, session: ComposeSession) -> None:
        self.session = session
        self.queue = ActionQueue(self._refused)
        self.on_refused: Callable[[], None] = lambda: None
        self._server = server
        self._told: WeakKeyDictionary[viser.ClientHandle, list[Any]] = WeakKeyDictionary()

    def submit(
        self,
        action: Callable[[], Any],
        client: viser.ClientHandle | None = None,
        *,
        key: str = "",
        after: float = 0.0,
        wait_for_typing: bool = False,
    ) -> None:
        """Has something done; see `ActionQueue.submit`."""
        self.queue.submit(action, client, key=key, after=after, wait_for_typing=wait_for_typing)

    def do(self, command: Command, client: viser.ClientHandle | None = None) -> None:
        """Has a step taken."""
        self.submit(lambda: self.session.do(command), client)

    def with_selection(self, command: Callable[[tuple[str, ...]], Command]) -> Callable[[], Any]:
        """An action that takes a step with whatever is selected when it is done."""
        return lambda: self.session.do(command(self.session.view.selection))

    def clicked(self, button: Any, action: Callable[[], Any]) -> Any:
        """Has something done at each click of a button; gives the button."""
        return self.clicked_by(button, lambda client: action())

    def clicked_by(self, button: Any, action: Callable[[viser.ClientHandle | None], Any]) -> Any:
        """The same, of an action that needs to know whose page it was."""

        @button.on_click
        async def _(event: Any) -> None:
            self.submit(lambda: action(event.client), event.client)

        return button

    def chosen(self, field: Any, action: Callable[[Any], Any], *, key: str = "") -> Any:
        """Has something done with each value that a user gives a field; gives the field.

        Args:
            field: of viser.
            action: gets the value.
            key: see `ActionQueue.submit`.
        """

        @field.on_update
        async def _(event: Any) -> None:
            if event.client_id is None:  # it was this program
                return
            value = event.target.value
            self.submit(lambda: action(value), event.client, key=key)

        return field

    def typed(
        self, field: Any, action: Callable[[Any], Any], *, after: float = TYPING_DELAY
    ) -> TypedField:
        """The same of a field that is typed in: `after` the last key, or when typing ends."""
        return TypedField(field, self.submit, action, after)

    def show_message(self, client: viser.ClientHandle | None, line: str, title: str = "") -> None:
        """Shows a page what was done; every page if `client` is None."""
        self._show(client, title or "Done", line, "green", MESSAGE_DURATION)

    def show_warning(self, client: viser.ClientHandle | None, line: str, title: str = "") -> None:
        """Shows a page what it should know."""
        self._show(client, title or "Please note", line, "orange", WARNING_DURATION)

    def _refused(self, client: viser.ClientHandle | None, line: str) -> None:
        self._show(client, "That cannot be done", line, "red", WARNING_DURATION)
        self.on_refused()

    def _show(
        self, client: viser.ClientHandle | None, title: str, line: str, color: Any, seconds: float
    ) -> None:
        clients = [client] if client is not None else self._server.get_clients().values()
        for each in clients:
            shown = self._told.setdefault(each, [])
            for same in [note for note in shown if note.body == line]:
                same.remove()
                shown.remove(same)
            shown.append(
                each.add_notification(title, line, auto_close_seconds=seconds, color=color)
            )
            while len(shown) > MAX_MESSAGES:
                shown.pop(0).remove()
