"""Rows of results with their texts as numbers, as far as comparisons need them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.evaluation.part_store import Rows as StoredRows
from burg_drake.evaluation.table import TEXT, Columns
from burg_drake.experiment.comparison.arrays import Rows, Values
from burg_drake.experiment.comparison.texts import Factor

ID = "id"


@dataclass(frozen=True, eq=False)
class Table:
    """N rows of results.

    Attributes:
        id: (N,) of the grasps.
        texts: other columns of texts by name.
        numbers: (N,) columns of numbers by name.
    """

    id: Values
    texts: Mapping[str, Factor]
    numbers: Mapping[str, Values]

    def __len__(self) -> int:
        return len(self.id)

    @classmethod
    def of_columns(cls, columns: Columns, names: Sequence[str]) -> Table:
        """From columns in memory."""
        others = [name for name in names if name != ID]
        return cls(
            columns[ID],
            {name: Factor.of(columns[name]) for name in others if name in TEXT},
            {name: columns[name] for name in others if name not in TEXT},
        )

    @classmethod
    def of_rows(cls, rows: StoredRows, names: Sequence[str]) -> Table:
        """From the columnar store, which has texts as numbers already."""
        others = [name for name in names if name != ID]
        return cls(
            rows.column(ID),
            {name: Factor.of_codes(*rows.codes(name)) for name in others if name in TEXT},
            {name: rows.column(name) for name in others if name not in TEXT},
        )

    def take(self, rows: Rows) -> Table:
        """Some rows; the table itself if they are all of it, in order."""
        if len(rows) == len(self) and np.array_equal(rows, np.arange(len(self))):
            return self
        return Table(
            self.id[rows],
            {name: factor.take(rows) for name, factor in self.texts.items()},
            {name: values[rows] for name, values in self.numbers.items()},
        )
