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
    """A queued action.

    Attributes:
        action: action to run.
        client: page that submitted it and is told of errors.
        key: a new action replaces the last queued one if that has the same key.
        due: when it may run if no other action follows [s of the monotonic clock].
        wait_for_typing: whether it may run before delayed actions, without hurrying them.
    """

    action: Action
    client: Any
    key: str
    due: float
    wait_for_typing: bool


class ActionQueue:
    """Runs actions in order, in its own thread.

    Args:
        on_error: called with the page that submitted the action, and a one-line error message.
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
        client: Any = None,
        *,
        key: str = "",
        after: float = 0.0,
        wait_for_typing: bool = False,
    ) -> None:
        """Appends an action.

        Args:
            action: action to run; its result is dropped.
            client: page that is told of errors.
            key: the action replaces the last queued one if that has the same key; of a drag, for
                example, only the last position counts.
            after: time to wait for a newer action of the same key [s]; a following action ends it.
            wait_for_typing: for actions that only update the display: delayed actions before it
                keep waiting.
        """
        queued = _QueuedAction(action, client, key, time.monotonic() + after, wait_for_typing)
        with self._condition:
            if self._closed:
                return
            waiting = [a for a in self._waiting if wait_for_typing or not a.wait_for_typing]
            if key and waiting and waiting[-1].key == key:
                self._waiting.remove(waiting[-1])
            self._waiting.append(queued)
            self._condition.notify_all()

    def idle(self, timeout: float) -> bool:
        """Waits until all actions are done; False if not within `timeout` [s]."""
        with self._condition:
            return self._condition.wait_for(lambda: not self._waiting and not self._busy, timeout)

    def close(self) -> None:
        """Ends the thread after all queued actions."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while (queued := self._wait_for_next()) is not None:
            try:
                queued.action()
            except BurgError as error:
                self._on_error(queued.client, str(error))
            except Exception as error:  # the page goes on after any error of an action
                _log.exception("an action of the setup page failed")
                self._on_error(queued.client, f"that failed unexpectedly: {error!r}")

    def _wait_for_next(self) -> _QueuedAction | None:
        """Waits for the next action that may run; None after `close`."""
        with self._condition:
            self._busy = False
            self._condition.notify_all()
            while True:
                now = time.monotonic()
                if (ready := self._first_ready(now)) is not None:
                    self._busy = True
                    self._waiting.remove(ready)
                    return ready
                if self._closed:
                    return None
                self._condition.wait(min((a.due - now for a in self._waiting), default=None))

    def _first_ready(self, now: float) -> _QueuedAction | None:
        """The first action that may run at time `now`; None if there is none."""
        delays_end = self._closed or len([a for a in self._waiting if not a.wait_for_typing]) > 1
        for queued in self._waiting:
            if queued.due <= now or (delays_end and not queued.wait_for_typing) or self._closed:
                return queued
        return None


TYPING_DELAY = 0.8
"""Seconds after the last key until a number counts, unless Enter ends the typing."""
NAME_TYPING_DELAY = 2.0  # Seconds after the last key until a name counts.
CROSSING_TIME = 2.0
"""Seconds after a field was set during which typed values sent earlier may still arrive."""


class TypedField:
    """A field for typing.

    Args:
        handle: handle of viser; it sends the value after each key.
        submit: submits an action; `PageActions.submit`.
        action: called with the typed value.
        after: delay after the last key [s].

    Attributes:
        handle: handle of viser.
    """

    def __init__(
        self, handle: Any, submit: Callable[..., None], action: Callable[[Any], Any], after: float
    ) -> None:
        self.handle = handle
        self._action = action
        self._typed = self._applied = 0
        self._set_at = -CROSSING_TIME
        self._crossed = False

        @handle.on_update
        async def _(event: Any) -> None:
            if event.client_id is None:  # changed by this program
                return
            self._typed += 1
            self._crossed |= time.monotonic() - self._set_at < CROSSING_TIME
            number, value = self._typed, event.target.value
            submit(
                lambda: self._apply(number, value),
                event.client,
                key=f"typed {id(self)}",
                after=after,
            )

    def show(self, value: Any) -> None:
        """Shows the current value, unless the user is still typing."""
        if self._applied != self._typed:
            return
        if self.handle.value == value and self._crossed:
            # viser sends nothing if the value is the same as the last that it knows
            self.handle.value = _different_value(value)
        if self.handle.value != value:
            self.handle.value = value
            self._set_at = time.monotonic()
        self._crossed = False

    def _apply(self, number: int, value: Any) -> None:
        self._applied = number
        self._action(value)


def _different_value(value: Any) -> Any:
    if isinstance(value, str):
        return value + " "
    return tuple(v + 1.0 for v in value) if isinstance(value, tuple) else value + 1.0


WARNING_DURATION = 12.0  # Seconds that a warning or an error stays on the page.


class PageActions:
    """Connects controls of panels with actions on the session, and shows messages.

    Args:
        server: server that shows the messages.
        session: the scene.

    Attributes:
        queue: runs all actions.
        submit: appends an action to the queue, with the page that is told of errors.
        on_refused: called after an action that failed, so that fields show the current values.
    """

    def __init__(self, server: viser.ViserServer, session: ComposeSession) -> None:
        self.session = session
        self.queue = ActionQueue(self._show_error)
        self.submit = self.queue.submit
        self.on_refused: Callable[[], None] = lambda: None
        self._server = server
        self._messages: WeakKeyDictionary[viser.ClientHandle, list[Any]] = WeakKeyDictionary()

    def on_click(self, button: Any, action: Callable[[], Any]) -> Any:
        """Submits an action at each click of a button; returns the button."""
        return self.on_page_click(button, lambda client: action())

    def on_page_click(self, button: Any, action: Callable[[viser.ClientHandle | None], Any]) -> Any:
        """Like `on_click`, for an action that takes the page that was clicked on."""

        @button.on_click
        async def _(event: Any) -> None:
            self.submit(lambda: action(event.client), event.client)

        return button

    def on_choice(self, field: Any, action: Callable[[Any], Any], *, key: str = "") -> Any:
        """Submits an action for each value that a user sets in a field; returns the field.

        Args:
            field: field of viser.
            action: called with the value.
            key: see `ActionQueue.submit`.
        """

        @field.on_update
        async def _(event: Any) -> None:
            if event.client_id is None:  # changed by this program
                return
            value = event.target.value
            self.submit(lambda: action(value), event.client, key=key)

        return field

    def typed_field(
        self, field: Any, action: Callable[[Any], Any], *, after: float = TYPING_DELAY
    ) -> TypedField:
        """Like `on_choice`, for typing: acts `after` the last key, or when typing ends."""
        return TypedField(field, self.submit, action, after)

    def show_message(self, client: viser.ClientHandle | None, line: str, title: str = "") -> None:
        """Shows a message on a page; on every page if `client` is None."""
        self._show(client, title or "Done", line, "green", 5.0)

    def show_warning(self, client: viser.ClientHandle | None, line: str, title: str = "") -> None:
        """Shows a warning on a page; on every page if `client` is None."""
        self._show(client, title or "Please note", line, "orange", WARNING_DURATION)

    def _show_error(self, client: viser.ClientHandle | None, line: str) -> None:
        self._show(client, "That cannot be done", line, "red", WARNING_DURATION)
        self.on_refused()

    def _show(
        self, client: viser.ClientHandle | None, title: str, line: str, color: Any, seconds: float
    ) -> None:
        max_messages = 3  # Messages on a page at a time; new ones replace the oldest.
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
