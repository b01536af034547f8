"""Rows of several runs as they lie in the columnar store."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.store.part_file import as_codes, as_numpy


@dataclass(frozen=True, eq=False)
class StoredRows:
    """Judged grasps of several runs, one after the other, in the order of their candidates.

    Attributes:
        table: Arrow table.
        counts: (S,) how many rows each run has.
    """

    table: Any
    counts: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.counts.sum())

    def column(self, name: str) -> NDArray[Any]:
        """A column as `table.Columns` has it."""
        return as_numpy(name, self.table.column(name))

    def codes(self, name: str) -> tuple[NDArray[np.int64], list[str]]:
        """A column of texts as numbers, and the texts that they stand for."""
        return as_codes(self.table.column(name))

    def columns(self, names: Iterable[str]) -> Columns:
        """Several columns."""
        return {name: self.column(name) for name in names}

    @property
    def run(self) -> NDArray[np.int64]:
        """(N,) which run each row is of, by its place."""
        return np.repeat(np.arange(len(self.counts)), self.counts)
