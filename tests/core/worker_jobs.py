"""What the tests of the pool have done in workers; a module of its own, because they import it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import InvalidInputError, report_progress


def square(x: int) -> int:
    return x * x


def slow(x: int, seconds: float = 60.0) -> int:
    time.sleep(seconds)
    return x


def spin() -> None:
    while True:
        pass


def check_file(path: Path) -> None:
    """Takes a while; refuses a file that is called `bad`, and notes the others."""
    time.sleep(0.05)
    if path.name == "bad":
        raise InvalidInputError("bad cannot be used")
    path.write_text("checked")


def count_checked(path: Path) -> int:
    """How many files beside this one are checked by now."""
    return len(list(path.parent.iterdir()))


def refuse(what: str) -> None:
    raise InvalidInputError(f"{what} cannot be used")


class NeedsTwo(Exception):
    """Cannot be unpickled."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} and {two}")


def raise_unusual() -> None:
    raise NeedsTwo("this", "that")


def unpicklable_result() -> Callable[[], None]:
    return lambda: None


class Evil:
    """Cannot be read where it arrives."""

    def __reduce__(self) -> Any:
        return (_raise, ("not here",))


def _raise(text: str) -> None:
    if "pytest" in sys.modules:
        raise ValueError(text)


def evil_result() -> Evil:
    return Evil()


def die(number: int = signal.SIGSEGV) -> None:
    os.kill(os.getpid(), number)


def die_once(file: Path, number: int = signal.SIGKILL) -> int:
    """Ends its process, unless it has done so before; returns the process identifier."""
    if not file.exists():
        file.touch()
        os.kill(os.getpid(), number)
    return os.getpid()


def die_at(bad: int, x: int, log: Path) -> int:
    with log.open("a") as file:
        file.write(f"{x} {os.getpid()}\n")
    if x == bad:
        die()
    return x


def give_up() -> None:
    raise SystemExit("abort: Failure at plant.cc")


def count_to(n: int) -> int:
    for k in range(n):
        report_progress(k)
    return n


def report_for_ever() -> None:
    while True:
        report_progress("still here")
        time.sleep(0.01)


def start_a_child(file: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as child:
        file.write_text(str(child.pid))


class Counter:
    """What a session builds: tells how often, and by which process."""

    def __init__(self, log: Path, name: str) -> None:
        with log.open("a") as file:
            file.write(f"{name} {os.getpid()}\n")
        self.name = name
        self.count = 0


def add(counter: Counter, x: int) -> tuple[str, int, int]:
    counter.count += x
    return counter.name, counter.count, os.getpid()


def build_and_die(log: Path) -> None:
    with log.open("a") as file:
        file.write("built\n")
    die()


def refuse_to_build() -> None:
    raise InvalidInputError("no such scene")


def mapped_files() -> set[str]:
    """Files that this process has in its memory."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    return {line.split(maxsplit=5)[-1] for line in lines if "/" in line}


def preloaded_in_a_child() -> tuple[str | None, set[str]]:
    """`LD_PRELOAD` of a process that a worker starts, and files in that one's memory."""
    program = (
        "import os; print(os.environ.get('LD_PRELOAD')); print(open('/proc/self/maps').read())"
    )
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    preload = None if output[0] == "None" else output[0]
    return preload, {line.split(maxsplit=5)[-1] for line in output[1:] if "/" in line}


def sums_of_many_arrays() -> bytes:
    """Arithmetic on arrays of all sizes, which come and go."""
    rng, kept, total = np.random.default_rng(1), [], np.zeros(3)
    for k in range(3000):
        kept.append(rng.normal(size=(rng.integers(1, 2000), 3)))
        total += np.exp(kept[k // 2]).sum(axis=0) @ rng.normal(size=(3, 3))
        kept[k // 3] = kept[k // 3][:1].copy()
    return total.tobytes()
