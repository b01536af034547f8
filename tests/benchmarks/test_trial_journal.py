"""A study of trials that was killed goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
from trial_journal import Row, TrialJournal


@dataclass(frozen=True)
class Run:
    """A trial that says its key."""

    key: str


RUNS = [Run(f"run {k}") for k in range(5)]


def pairs(runs: Sequence[Run]) -> Iterable[list[Run]]:
    return (list(runs[k : k + 2]) for k in range(0, len(runs), 2))


class Study:
    """Executes trials, and remembers which."""

    def __init__(self, path: Path) -> None:
        self.journal, self.executed = TrialJournal(path), []

    def execute(self, runs: list[Run]) -> list[Row]:
        self.executed += [run.key for run in runs]
        return [{"key": run.key, "lift": 0.3} for run in runs]

    def complete(self) -> dict[str, Row]:
        with ThreadPoolExecutor(1) as pool:
            self.journal.complete(pool, RUNS, pairs, self.execute)
        return self.journal.rows


def test_all_trials_are_executed_once(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    first = Study(path)
    rows = first.complete()
    assert sorted(first.executed) == sorted(rows) == [run.key for run in RUNS]
    again = Study(path)
    assert again.complete() == rows
    assert again.executed == []


@pytest.mark.parametrize("left", [0, 1, 20, -2, -1])
def test_after_a_kill_within_a_line_only_what_is_missing_is_executed(
    tmp_path: Path, left: int
) -> None:
    """Of the third line a part is left, from nothing to all but its end."""
    path = tmp_path / "trials.jsonl"
    rows = Study(path).complete()
    lines = [line for line in path.read_bytes().splitlines(keepends=True) if line.strip()]
    path.write_bytes(b"".join(lines[:2]) + lines[2][:left])
    kept = {json.loads(line)["key"] for line in lines[: 3 if left == -1 else 2]}
    again = Study(path)
    assert set(again.journal.rows) == kept
    assert again.complete() == rows
    assert set(again.executed) == set(rows) - kept
    assert TrialJournal(path).rows == rows
