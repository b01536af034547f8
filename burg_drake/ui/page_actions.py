"""Actions of pages: clicks and typed values go through one queue and are executed in order."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import viser

from burg_drake.compose import ComposeSession
from burg_drake.core import BurgError

Action = Callable[[], Any]
ErrorCallback = Callable[[Any, str], None]

_log = logging.getLogger("burg_drake")


@dataclass(frozen=True, eq=False)
class _QueuedAction:
    """An action that waits.

    Attributes:
        action: to run.
        who: asked for it, and hears of its errors.
        key: a newer action of the same key takes the place of one that is still the last to wait.
        due: when it may run if nothing waits behind it [s of the monotonic clock].
        wait_for_typing: it hurries none that waits before it, but runs before that.
    """

    action: Action
    who: Any
    key: str
    due: float
    wait_for_typing: bool


class ActionQueue:
    """Runs actions in a thread of its own.

    Args:
        on_error: gets who asked, and one line that says what went wrong.
    """

    def __init__(self, on_error: ErrorCallback) -> None:
        self._on_error = on_error
        self._waiting: deque[_QueuedAction] = deque()
        self._condition = threading.Condition()
        self._busy = False
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="setup-page", daemon=True)
        self._thread.start()

    def submit(
        self,
        action: Action,
        who: Any = None,
        *,
        key: str = "",
        after: float = 0.0,
        wait_for_typing: bool = False,
    ) -> None:
        """Puts an action last.

        Args:
            action: to run; what it returns is dropped.
            who: asks, and is told of errors.
            key: it replaces an action of the same key that nothing waits behind, as of a drag only
                the last position counts.
            after: it waits that long for a newer one of its key [s], but never holds up others.
            wait_for_typing: it only shows what is so, and does not hurry those that wait before it.
        """
        asked = _QueuedAction(action, who, key, time.monotonic() + after, wait_for_typing)
        with self._condition:
            if self._closed:
                return
            waiting = [a for a in self._waiting if wait_for_typing or not a.wait_for_typing]
            if key and waiting and waiting[-1].key == key:
                self._waiting.remove(waiting[-1])
            self._waiting.append(asked)
            self._condition.notify_all()

    def idle(self, timeout: float) -> bool:
        """Waits until nothing is left to do; False if that takes longer than `timeout` [s]."""
        with self._condition:
            return self._condition.wait_for(lambda: not self._waiting and not self._busy, timeout)

    def close(self) -> None:
        """Ends the thread once all that was asked for is done."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while (asked := self._next()) is not None:
            try:
                asked.action()
            except BurgError as error:
                self._on_error(asked.who, str(error))
            except Exception as error:  # the page goes on, whatever one action stumbled over
                _log.exception("an action of the setup page failed")
                self._on_error(asked.who, f"that failed unexpectedly: {error!r}")

    def _next(self) -> _QueuedAction | None:
        """The next action, as soon as it may run; None at the end."""
        with self._condition:
            self._busy = False
            self._condition.notify_all()
            while True:
                now = time.monotonic()
                if (ready := self._ready(now)) is not None:
                    self._busy = True
                    self._waiting.remove(ready)
                    return ready
                if self._closed:
                    return None
                self._condition.wait(min((a.due - now for a in self._waiting), default=None))

    def _ready(self, now: float) -> _QueuedAction | None:
        """The first that may run at a time."""
        hurried = self._closed or len([a for a in self._waiting if not a.wait_for_typing]) > 1
        for asked in self._waiting:
            if asked.due <= now or (hurried and not asked.wait_for_typing) or self._closed:
                return asked
        return None


TYPING_DELAY = 0.8
"""Seconds after the last key until a number counts, unless Enter ends the typing."""
NAME_TYPING_DELAY = 2.0  # Seconds after the last key until a name counts.
CROSSING_TIME = 2.0
"""Seconds after a field was set in which typed values may have been sent before."""


class TypedField:
    """A field that is typed in.

    Args:
        handle: of viser; it sends each key.
        ask: has an action done; `PageActions.submit`.
        action: done with what was typed.
        after: the last key [s].

    Attributes:
        handle: of viser.
    """

    def __init__(
        self, handle: Any, ask: Callable[..., None], action: Callable[[Any], Any], after: float
    ) -> None:
        self.handle = handle
        self._action = action
        self._typed = self._taken = 0
        self._set_at = -CROSSING_TIME
        self._crossed = False

        @handle.on_update
        async def _(event: Any) -> None:
            if event.client_id is None:  # it was this program
                return
            self._typed += 1
            self._crossed |= time.monotonic() - self._set_at < CROSSING_TIME
            number, value = self._typed, event.target.value
            ask(
                lambda: self._take(number, value),
                event.client,
                key=f"typed {id(self)}",
                after=after,
            )

    def show(self, value: Any) -> None:
        """Shows what is so, unless the user is still typing."""
        if self._taken != self._typed:
            return
        if self.handle.value == value and self._crossed:
            # viser sends nothing if it believes that it is so
            self.handle.value = _different_value(value)
        if self.handle.value != value:
            self.handle.value = value
            self._set_at = time.monotonic()
        self._crossed = False

    def _take(self, number: int, value: Any) -> None:
        self._taken = number
        self._action(value)


def _different_value(value: Any) -> Any:
    if isinstance(value, str):
        return value + " "
    return tuple(v + 1.0 for v in value) if isinstance(value, tuple) else value + 1.0


WARNING_DURATION = 12.0  # Seconds that a warning or an error stays on the page.


class PageActions:
    """What panels may do.

    Args:
        server: to show messages with.
        session: the scene.

    Attributes:
        queue: in which all actions are done.
        submit: puts an action into it, with the page that hears of errors.
        on_refused: called after an action that was refused: fields show again what is so.
    """

    def __init__(self, server: viser.ViserServer, session: ComposeSession) -> None:
        self.session = session
        self.queue = ActionQueue(self._show_error)
        self.submit = self.queue.submit
        self.on_refused: Callable[[], None] = lambda: None
        self._server = server
        self._messages: WeakKeyDictionary[viser.ClientHandle, list[Any]] = WeakKeyDictionary()

    def on_click(self, button: Any, action: Callable[[], Any]) -> Any:
        """Has something done at each click of a button; gives the button."""
        return self.on_page_click(button, lambda client: action())

    def on_page_click(self, button: Any, action: Callable[[viser.ClientHandle | None], Any]) -> Any:
        """The same, of an action that needs to know whose page it was."""

        @button.on_click
        async def _(event: Any) -> None:
            self.submit(lambda: action(event.client), event.client)

        return button

    def on_choice(self, field: Any, action: Callable[[Any], Any], *, key: str = "") -> Any:
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

    def typed_field(
        self, field: Any, action: Callable[[Any], Any], *, after: float = TYPING_DELAY
    ) -> TypedField:
        """The same of a field that is typed in: `after` the last key, or when typing ends."""
        return TypedField(field, self.submit, action, after)

    def show_message(self, client: viser.ClientHandle | None, line: str, title: str = "") -> None:
        """Shows a page what was done; every page if `client` is None."""
        self._show(client, title or "Done", line, "green", 5.0)

    def show_warning(self, client: viser.ClientHandle | None, line: str, title: str = "") -> None:
        """Shows a page what it should know."""
        self._show(client, title or "Please note", line, "orange", WARNING_DURATION)

    def _show_error(self, client: viser.ClientHandle | None, line: str) -> None:
        self._show(client, "That cannot be done", line, "red", WARNING_DURATION)
        self.on_refused()

    def _show(
        self, client: viser.ClientHandle | None, title: str, line: str, color: Any, seconds: float
    ) -> None:
        max_messages = 3  # Messages on a page at a time; the oldest make room for a new one.
        clients = [client] if client is not None else self._server.get_clients().values()
        for each in clients:
            shown = self._messages.setdefault(each, [])
            for same in [note for note in shown if note.body == line]:
                same.remove()
                shown.remove(same)
            shown.append(
                each.add_notification(title, line, auto_close_seconds=seconds, color=color)
            )
            while len(shown) > max_messages:
                shown.pop(0).remove()
