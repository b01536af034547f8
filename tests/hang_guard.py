"""How long tests wait for other threads, processes and browsers: for as long as it takes.

A machine with much else to do is slow, and no failure; what never comes is one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

HANG_GUARD = 300.0
"""After this a test counts as hanging [s]: many times what any wait takes on an idle machine."""


def until(condition: Callable[[], T], what: str = "", seconds: float = HANG_GUARD) -> T:
    """Waits until a condition is true, and returns what it is then.

    Args:
        condition: asked again and again.
        what: is waited for, for the message.
        seconds: less where a test tries again what may have been too early.
    """
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, f"waited {seconds:g} s in vain: {what}"
        time.sleep(0.005)
    return found
