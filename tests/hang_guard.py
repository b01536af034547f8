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
STALL_GUARD = 120.0
"""A test counts as hanging after this time [s] in which its processes used hardly any processor."""
STALL_CPU_SHARE = 0.1
"""Share of one core that waiting itself, and a page that shows nothing new, stay below."""
CHECK_INTERVAL = 20.0
"""Between looks at the processor time [s]."""


def until(condition: Callable[[], T], what: str = "", seconds: float = HANG_GUARD) -> T:
    """Waits until a condition is true, and returns what it is then.

    Args:
        condition: asked again and again, more and more rarely.
        what: is waited for, for the message.
        seconds: less where a test tries again what may have been too early.
    """
    start = looked = busy_at = time.monotonic()
    cpu = 0.0
    while not (found := condition()):
        now = time.monotonic()
        assert now < start + seconds, f"waited {seconds:g} s in vain: {what}"
        if now - looked > CHECK_INTERVAL:
            used = processor_time()
            if used - cpu > STALL_CPU_SHARE * (now - looked):
                busy_at = now
            looked, cpu = now, used
            assert now - busy_at < STALL_GUARD, (
                f"waited {now - start:.0f} s in vain, the last {now - busy_at:.0f} s without any"
                f" work done: {what}"
            )
        time.sleep(min(0.005 + 0.01 * (now - start), 0.5))
    return found


def processor_time() -> float:
    """Of this process and all that it has started, which still run [s]."""
    lines = subprocess.run(
        ["ps", "-A", "-o", "pid=,ppid=,time="], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    rows = [line.split() for line in lines]
    family, total = {os.getpid()}, 0.0
    grown = True
    while grown:
        children = {int(pid) for pid, parent, _ in rows if int(parent) in family}
        grown = not children <= family
        family |= children
    for pid, _, used in rows:
        if int(pid) in family:
            total += _seconds(used)
    return total


def _seconds(text: str) -> float:
    """Of a time as `ps` writes it: `[[days-]hours:]minutes:seconds`."""
    days, _, clock = text.rpartition("-")
    total = 86400.0 * float(days or 0)
    for k, part in enumerate(reversed(clock.split(":"))):
        total += 60.0**k * float(part)
    return total
