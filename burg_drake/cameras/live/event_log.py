"""Lines about what happens in a live view: each is told once, and the last ones are kept."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

KEPT = 50


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Attributes:
        number: counts events.
        text: one line.
        bad: something went wrong.
    """

    number: int
    text: str
    bad: bool = False


class EventLog:
    """Events, from any thread.

    Args:
        on_event: called with each as it happens.
    """

    def __init__(self, on_event: Callable[[Event], None] = lambda event: None) -> None:
        self._on_event = on_event
        self._lock = threading.Lock()
        self._events: deque[Event] = deque(maxlen=KEPT)
        self._count = 0

    def add(self, text: str, *, bad: bool = False) -> None:
        """Adds an event."""
        with self._lock:
            self._count += 1
            event = Event(self._count, text, bad)
            self._events.append(event)
            self._on_event(event)

    def after(self, number: int) -> list[Event]:
        """Those of the last `KEPT` with a higher number, oldest first."""
        with self._lock:
            return [event for event in self._events if event.number > number]
