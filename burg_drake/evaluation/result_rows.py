"""Results of a run in little memory: repeated and missing values take no room."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Verdict
from burg_drake.evaluation.candidates import Candidates
from burg_drake.evaluation.results_table import (
    TEXT_COLUMNS,
    Columns,
    ColumnValues,
    TextValues,
    arrange_columns,
    code_texts,
    grasp_columns,
)
from burg_drake.evaluation.trial_origin import TrialOrigin

CHUNK_ROWS = 1 << 14
"""Rows per chunk of a table in memory."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ResultRows(Mapping[str, ColumnValues]):
    """Table of judged grasps, N rows in the order of the candidates. Columns are made on access.

    Attributes:
        candidates: all grasps of the run.
        candidate_rows: (N,) rows of the judged candidates.
        chunks: packed values of `CHUNK_ROWS` rows each, by column; None for columns that are
            computed from the candidates.
    """

    candidates: Candidates
    candidate_rows: NDArray[np.int64]
    chunks: Sequence[Mapping[str, ColumnValues | TextValues | None]]

    @classmethod
    def of(
        cls,
        candidates: Candidates,
        candidate_rows: NDArray[np.int64],
        verdicts_of: Callable[[NDArray[np.int64]], Sequence[Verdict]],
        origin: TrialOrigin,
        *,
        instances: Sequence[str],
        joints: int = 0,
    ) -> ResultRows:
        """Makes the table.

        Args:
            candidates: the grasps.
            candidate_rows: (N,) rows of the judged candidates, ascending.
            verdicts_of: reads the verdicts on the candidates in given rows.
            origin, instances, joints: see `make_columns`.
        """
        chunks = []
        for begin in range(0, max(1, len(candidate_rows)), CHUNK_ROWS):
            rows = candidate_rows[begin : begin + CHUNK_ROWS]
            columns = arrange_columns(
                dict.fromkeys(grasp_columns(candidates, rows[:0])),
                verdicts_of(rows),
                origin,
                instances=instances,
                joints=joints,
            )
            kept = {n: None if values is None else _pack(values) for n, values in columns.items()}
            chunks.append(kept)
        return cls(candidates=candidates, candidate_rows=candidate_rows, chunks=chunks)

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.candidate_rows)

    def __len__(self) -> int:
        return len(self.chunks[0])

    def __iter__(self) -> Iterator[str]:
        return iter(self.chunks[0])

    def __getitem__(self, name: str) -> ColumnValues:
        parts = [self._cells(k, name) for k in range(len(self.chunks))]
        if len(parts) > 1 and all(values.strides == (0,) for values in parts):
            first = parts[0][:1]
            if all((values[:1] == first).all() for values in parts):
                return np.broadcast_to(first[0], len(self.candidate_rows))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def codes(self, name: str) -> TextValues:
        """A column of texts as codes, and the texts in order of occurrence."""
        codes: dict[str, int] = {}
        found = []
        for k, chunk in enumerate(self.chunks):
            kept = chunk[name]
            values = kept if isinstance(kept, TextValues) else code_texts(self._cells(k, name))
            merged = [codes.setdefault(text, len(codes)) for text in values.names]
            found.append(np.array(merged, dtype=np.min_scalar_type(len(codes)))[values.codes])
        return TextValues(np.concatenate(found), tuple(codes))

    @property
    def run(self) -> NDArray[np.int64]:
        """(N,) zeros, as all rows belong to one run; see `StoredRows.run`."""
        return np.broadcast_to(np.int64(0), self.count)

    def is_text(self, name: str) -> bool:
        """Whether a column holds texts."""
        kept = self.chunks[0][name]
        return isinstance(kept, TextValues) or self._cells(0, name).dtype.kind == "U"

    def column(self, name: str) -> ColumnValues:
        """A column; NaN or empty texts if the table lacks it."""
        if name in self:
            return self[name]
        return np.full(self.count, "" if name in TEXT_COLUMNS else np.nan)

    def columns(self, names: Sequence[str], rows: NDArray[np.int64] | None = None) -> Columns:
        """Several columns, of all rows or of the given ones (M,)."""
        return {name: self[name] if rows is None else self.cells(name, rows) for name in names}

    def cells(self, name: str, rows: NDArray[np.int64]) -> ColumnValues:
        """A column at the given rows (M,)."""
        rows = np.asarray(rows, dtype=np.int64)
        if self.chunks[0][name] is None:
            return grasp_columns(self.candidates, self.candidate_rows[rows], [name])[name]
        chunk = rows // CHUNK_ROWS
        order = np.argsort(chunk, kind="stable")
        parts = [
            self._cells(k, name)[rows[order[chunk[order] == k]] - k * CHUNK_ROWS]
            for k in np.unique(chunk).tolist()
        ]
        found = np.concatenate(parts) if parts else self._cells(0, name)[:0]
        return found[np.argsort(order, kind="stable")]

    def parts(self) -> Iterator[Columns]:
        """Yields the table chunk by chunk."""
        for k, chunk in enumerate(self.chunks):
            yield {name: self._cells(k, name) for name in chunk}

    def _cells(self, k: int, name: str) -> ColumnValues:
        """A column of a chunk."""
        kept = self.chunks[k][name]
        if kept is None:
            rows = self.candidate_rows[k * CHUNK_ROWS : (k + 1) * CHUNK_ROWS]
            return grasp_columns(self.candidates, rows, [name])[name]
        if isinstance(kept, TextValues):
            texts: ColumnValues = np.array(kept.names, dtype=np.str_)[kept.codes]
            return texts
        return kept


def _pack(values: ColumnValues) -> ColumnValues | TextValues:
    """Packs a column: a constant is stored once, and so is each distinct text."""
    if not len(values) or values.strides == (0,):
        return values
    if values.dtype.kind == "U":
        found = code_texts(values)
        return TextValues(found.codes.astype(np.min_scalar_type(len(found.names))), found.names)
    if values.tobytes() == values[:1].tobytes() * len(values):
        return np.broadcast_to(values[0].copy(), len(values))
    return values
