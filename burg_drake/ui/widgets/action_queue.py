"""What pages ask for, done one after another in the order of asking.

The server's event loop only puts actions here, so that it never waits for a check or a file, and
what two pages do at once cannot get mixed up.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

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
            last = self._last(wait_for_typing=wait_for_typing)
            if key and last is not None and last.key == key:
                self._waiting.remove(last)
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

    def _last(self, *, wait_for_typing: bool) -> _QueuedAction | None:
        """The last action that waits; the last that is not patient for those that are not."""
        return next(
            (a for a in reversed(self._waiting) if wait_for_typing or not a.wait_for_typing), None
        )

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
