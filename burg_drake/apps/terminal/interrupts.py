"""How verbs end that run until told to: by Ctrl-C or SIGTERM, and without losing anything."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from typing import NoReturn

LOOK = 0.5
"""Between two looks of a process that waits for its end [s]."""


def wait_for_interrupt() -> NoReturn:
    """Waits, in the main thread, for Ctrl-C; see `terminated_as_interrupted`.

    The system may deliver a signal in any thread. Python handles it in the main thread, which that
    does not wake: a wait without end would sleep on.

    Raises:
        KeyboardInterrupt: that is how it ends.
    """
    while True:
        time.sleep(LOOK)


@contextlib.contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM ends as Ctrl-C does, so that what is open is finished."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Ignores Ctrl-C while the last results are written: an interrupt would lose them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
