"""Fields that are typed in: what stands there counts once the user is done, and then the field
shows again what is so."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

import viser

TYPING_DELAY, NAME_TYPING_DELAY = 0.8, 2.0
"""After the last key in a field before it counts [s], unless Enter or another action ends the
typing; words mean something else before they are complete."""
CROSSING_TIME = 2.0
"""What is typed so soon after the field was set may have crossed that on its way [s]."""


class AskForAction(Protocol):
    """Has something done; see `ActionQueue.ask`."""

    def __call__(
        self,
        action: Callable[[], Any],
        client: viser.ClientHandle | None = None,
        *,
        key: str = "",
        after: float = 0.0,
    ) -> None: ...


class TypedField:
    """A field that is typed in.

    Args:
        handle: of viser; it sends each key.
        ask: has an action done; that of `PageActions`.
        action: done with what was typed.
        after: the last key [s].

    Attributes:
        handle: of viser.
    """

    def __init__(
        self, handle: Any, ask: AskForAction, action: Callable[[Any], Any], after: float
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
            self.handle.value = _other(value)  # viser sends nothing if it believes that it is so
        if self.handle.value != value:
            self.handle.value = value
            self._set_at = time.monotonic()
        self._crossed = False

    def _take(self, number: int, value: Any) -> None:
        self._taken = number
        self._action(value)


def _other(value: Any) -> Any:
    if isinstance(value, str):
        return value + " "
    return tuple(v + 1.0 for v in value) if isinstance(value, tuple) else value + 1.0
