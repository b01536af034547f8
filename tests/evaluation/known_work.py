"""Work of known outcome for the workers of a cluster, in a module that children import."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import InvalidInputError

FILE = "content.txt"
"""That the bundle has."""


@dataclass(frozen=True)
class Known:
    """What a call gets.

    Attributes:
        number: of it.
        fault: what it does in place of an answer, if anything; `parent` ends the worker, `once`
            does when the log has the number once.
        pause: before the answer [s].
        log: gets a line with the number and the process at the start of each call.
    """

    number: int
    fault: str = ""
    pause: float = 0.0
    log: Path | None = None


def square(work: Known, folder: Path) -> tuple[int, str]:
    """The square of the number, and what the bundle has."""
    if work.log is not None:
        with work.log.open("a") as file:
            file.write(f"{work.number} {os.getpid()}\n")
    if work.fault == "refuse":
        raise InvalidInputError(f"no square of {work.number}")
    if work.fault == "raise":
        raise ZeroDivisionError("by nothing")
    if work.fault == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    if work.fault == "parent" or (work.fault == "once" and _times(work) == 1):
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60.0)
    time.sleep(work.pause)
    return work.number**2, (folder / FILE).read_text()


def _times(work: Known) -> int:
    """How often it was begun."""
    assert work.log is not None
    lines = work.log.read_text().splitlines()
    return sum(line.split()[0] == str(work.number) for line in lines)
