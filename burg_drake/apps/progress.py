"""Progress on a terminal: what is done, how fast, how long it still takes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def object_progress(total: int) -> Iterator[Callable[[str, str, int, int], None]]:
    """A bar for library builds on standard error; off a terminal one line for each object.

    Yields:
        What `build_library` calls after each object.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda name, state, done, count: print(
            f"[{done}/{count}] {name}: {state}", file=sys.stderr, flush=True
        )
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeElapsedColumn(), console=console, transient=True) as bar:
        task = bar.add_task("building", total=total)

        def progress(name: str, state: str, done: int, count: int) -> None:
            bar.update(task, completed=done, total=count, description=f"{name} {state}")

        yield progress
