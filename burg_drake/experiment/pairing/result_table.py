"""Rows of results with their texts as numbers, as far as comparisons need them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.evaluation.records import TEXT, Columns
from burg_drake.evaluation.store import StoredRows
from burg_drake.experiment.pairing.text_codes import Factor, Ids
from burg_drake.experiment.statistics import Rows, Values

ID = "id"


class Stored(Mapping[str, Values]):
    """Columns of numbers in the columnar store, read as they are asked for."""

    def __init__(self, rows: StoredRows, names: Sequence[str]) -> None:
        """Of some names."""
        self._rows, self._names = rows, tuple(names)
        self._read: dict[str, Values] = {}

    def __getitem__(self, name: str) -> Values:
        if name not in self._read:
            self._read[name] = self._rows.column(name)
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def same(self, other: Stored, name: str) -> bool:
        """Whether a column of both is the same, without reading it."""
        return bool(self._rows.table.column(name).equals(other._rows.table.column(name)))


@dataclass(frozen=True, eq=False)
class ResultTable:
    """N rows of results.

    Attributes:
        id: (N,) of the grasps.
        texts: other columns of texts by name.
        numbers: (N,) columns of numbers by name.
    """

    id: Ids
    texts: Mapping[str, Factor]
    numbers: Mapping[str, Values]

    def __len__(self) -> int:
        return len(self.id)

    @classmethod
    def of_columns(cls, columns: Columns, names: Sequence[str]) -> ResultTable:
        """From columns in memory."""
        others = [name for name in names if name != ID]
        return cls(
            Ids(columns[ID]),
            {name: Factor.of(columns[name]) for name in others if name in TEXT},
            {name: columns[name] for name in others if name not in TEXT},
        )

    @classmethod
    def of_rows(cls, rows: StoredRows, names: Sequence[str]) -> ResultTable:
        """From the columnar store, which has texts as numbers already."""
        others = [name for name in names if name != ID]
        return cls(
            Ids(rows.table.column(ID)),
            {name: Factor.of_codes(*rows.codes(name)) for name in others if name in TEXT},
            Stored(rows, [name for name in others if name not in TEXT]),
        )

    def same(self, other: ResultTable, name: str) -> bool:
        """Whether a column of numbers is known to be the same in both."""
        one, two = self.numbers, other.numbers
        return isinstance(one, Stored) and isinstance(two, Stored) and one.same(two, name)

    def take(self, rows: Rows, numbers: Sequence[str]) -> ResultTable:
        """Some rows with some columns of numbers; the table itself if they are all of it, in
        order."""
        if len(rows) == len(self) and np.array_equal(rows, np.arange(len(self))):
            return self
        return ResultTable(
            self.id.take(rows),
            {name: factor.take(rows) for name, factor in self.texts.items()},
            {name: self.numbers[name][rows] for name in numbers},
        )
