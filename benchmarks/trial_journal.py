"""Trials that were executed, a row a line, so that a study that was interrupted goes on."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Protocol, TypeVar

Row = dict[str, Any]


class Keyed(Protocol):
    """A trial that its row is found by."""

    @property
    def key(self) -> str:
        """Tells trials apart."""
        ...


T = TypeVar("T", bound=Keyed)


class TrialJournal:
    """Rows of trials, by key.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, Row] = {}
        for line in path.read_text().splitlines() if path.exists() else ():
            try:
                row = json.loads(line)
            except json.JSONDecodeError:  # the last line of an interrupted run, or an empty one
                continue
            self.rows[row["key"]] = row

    def complete(
        self,
        pool: ProcessPoolExecutor,
        runs: Iterable[T],
        chunked: Callable[[Sequence[T]], Iterable[list[T]]],
        execute: Callable[[list[T]], list[Row]],
    ) -> None:
        """Executes the trials that are missing, and writes them down as they come.

        Args:
            pool: of workers.
            runs: all trials.
            chunked: cuts trials into what a worker executes before it reports.
            execute: executes one of these pieces; its rows have the trials' `key`.
        """
        missing = [run for run in runs if run.key not in self.rows]
        start, done = time.monotonic(), 0
        with self.path.open("a") as file:
            file.write("\n")  # after an interruption the last line may have no end
            for future in as_completed([pool.submit(execute, some) for some in chunked(missing)]):
                for row in future.result():
                    self.rows[row["key"]] = row
                    file.write(json.dumps(row) + "\n")
                    done += 1
                file.flush()
                left = (time.monotonic() - start) * (len(missing) / done - 1.0)
                print(f"\r{done} of {len(missing)} trials, {left / 60:.0f} min left ", end="")
        if missing:
            print()
