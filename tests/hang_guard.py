"""How long tests wait for other threads, processes and browsers: for as long as it takes.

A machine with much else to do is slow, and no failure; what never comes is one. Which of the two it
is shows in the processor time of the test's processes: what is under way uses some, however slowly.
"""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

HANG_GUARD = 900.0
"""After this a test counts as hanging, whatever it does [s]."""
STALL_WINDOW = 120.0
"""A test hangs if its processes use hardly any processor time for so long [s]."""
STALL_CPU_SHARE = 0.04
"""Share of one core: waiting, and a page on which nothing happens, use less; on a machine with ten
times as much to do as it can, work gets more."""
SHORT_WAIT = 5.0
"""So long waits [s] are not looked into."""


def until(condition: Callable[[], T], what: str = "", seconds: float = HANG_GUARD) -> T:
    """Waits until a condition is true, and returns what it is then.

    Args:
        condition: asked again and again, more and more rarely.
        what: is waited for, for the message.
        seconds: less where a test tries again what may have been too early.
    """
    start = time.monotonic()
    window, before = start, None
    while not (found := condition()):
        now = time.monotonic()
        assert now < start + seconds, f"waited {seconds:g} s in vain: {what}"
        if before is None and now > start + SHORT_WAIT:
            window, before = now, processor_times()
        elif before is not None and now > window + STALL_WINDOW:
            after = processor_times()
            used = sum(max(after[pid] - before.get(pid, 0.0), 0.0) for pid in after)
            assert used > STALL_CPU_SHARE * (now - window), (
                f"waited {now - start:.0f} s in vain, and in the last {now - window:.0f} s the"
                f" processes of this test used {used:.0f} s of processor time: {what}"
            )
            window, before = now, after
        time.sleep(min(0.005 + 0.01 * (now - start), 0.5))
    return found


def processor_times() -> dict[int, float]:
    """Of this process and of all that it has started and that still run, by their ids [s]."""
    lines = subprocess.run(
        ["ps", "-A", "-o", "pid=,ppid=,time="], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    rows = [(int(pid), int(parent), used) for pid, parent, used in map(str.split, lines)]
    family: set[int] = set()
    children = {os.getpid()}
    while children:
        family |= children
        children = {pid for pid, parent, _ in rows if parent in family} - family
    return {pid: _seconds(used) for pid, _, used in rows if pid in family}


def _seconds(text: str) -> float:
    """Of a time as `ps` writes it: `[[days-]hours:]minutes:seconds`."""
    days, _, clock = text.rpartition("-")
    total = 86400.0 * float(days or 0)
    for k, part in enumerate(reversed(clock.split(":"))):
        total += 60.0**k * float(part)
    return total
