"""Tables of results with texts as integer codes, and matching of grasps between two tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.evaluation import TEXT_COLUMNS, Columns, StoredRows
from burg_drake.experiment.comparison.confusion_matrix import Flags, Rows, Values

_HASH_FACTORS = np.random.default_rng(1).integers(1, 1 << 63, 4096).astype(np.uint64) | np.uint64(1)
"""Odd random factors by which the eight-byte words of a text are multiplied."""
_BYTE_MASKS = np.array([(1 << 8 * k) - 1 for k in range(9)], dtype=np.uint64)
"""Masks of the first 0 to 8 bytes of a word."""


def text_keys(texts: NDArray[np.str_]) -> NDArray[np.uint64]:
    """A hash of each text, independent of the column's width."""
    texts = np.ascontiguousarray(texts, dtype=np.str_)
    keys = np.zeros(len(texts), dtype=np.uint64)
    if not texts.dtype.itemsize or not len(texts):
        return keys
    letters: Values = texts.view(np.uint32).reshape(len(texts), -1)
    if letters.max() >= 128:
        letters = np.char.encode(texts, "utf-8").view(np.uint8).reshape(len(texts), -1)
    words = np.zeros((len(letters), -(-letters.shape[1] // 8) * 8), dtype=np.uint8)
    words[:, : letters.shape[1]] = letters
    for k, word in enumerate(words.view(np.uint64).T):
        keys += word * _HASH_FACTORS[k % len(_HASH_FACTORS)]
    return keys


def stored_keys(column: Any) -> NDArray[np.uint64]:
    """Hashes as by `text_keys` for an Arrow column of texts without nulls, without conversion to
    Python objects.
    """
    found = [np.zeros(0, dtype=np.uint64), *(_chunk_keys(chunk) for chunk in column.chunks)]
    return np.concatenate(found)


def _chunk_keys(chunk: Any) -> NDArray[np.uint64]:
    """Sums of the texts' eight-byte words, each multiplied by its own factor."""
    _, places, data = chunk.buffers()
    keys = np.zeros(len(chunk), dtype=np.uint64)
    if not len(chunk) or data is None:
        return keys
    kind = np.int64 if str(chunk.type).startswith("large") else np.int32
    place = np.frombuffer(places, dtype=kind)[chunk.offset : chunk.offset + len(chunk) + 1]
    begin, length = place[:-1], np.diff(place)
    text = np.frombuffer(data, dtype=np.uint8)[place[0] : place[-1]]
    padded = np.zeros(len(text) + 8, dtype=np.uint8)
    padded[: len(text)] = text
    words = np.ndarray(len(text) + 1, dtype=np.uint64, buffer=padded.data, strides=(1,))
    for k in range(-(-int(length.max()) // 8)):
        at = np.minimum(begin - place[0] + 8 * k, len(text))
        keys += (words[at] & _BYTE_MASKS[(length - 8 * k).clip(0, 8)]) * _HASH_FACTORS[
            k % len(_HASH_FACTORS)
        ]
    return keys


@dataclass(frozen=True, eq=False)
class IdColumn:
    """A column of N different texts; a text becomes a Python object when it is accessed.

    Attributes:
        column: array or Arrow column of texts.
        rows: (N,) indices into the column; None for all of it.
    """

    column: Any
    rows: Rows | None = None

    def __len__(self) -> int:
        return len(self.column if self.rows is None else self.rows)

    def __getitem__(self, row: int) -> str:
        found = self.column[row if self.rows is None else int(self.rows[row])]
        return str(found.as_py() if hasattr(found, "as_py") else found)

    @property
    def keys(self) -> NDArray[np.uint64]:
        """(N,) hashes of the texts; see `text_keys`."""
        stored = not isinstance(self.column, np.ndarray)
        keys = stored_keys(self.column) if stored else text_keys(self.column)
        return keys if self.rows is None else keys[self.rows]

    def same(self, other: IdColumn) -> bool:
        """Whether both columns are known to have the same texts in the same order. False if they
        are stored differently, whatever their texts.
        """
        if self.rows is not None or other.rows is not None:
            return False
        arrays = [isinstance(column, np.ndarray) for column in (self.column, other.column)]
        if all(arrays):
            return np.array_equal(self.column, other.column)
        return not any(arrays) and bool(self.column.equals(other.column))

    def take(self, rows: Values) -> IdColumn:
        """The column with the selected rows, given as indices or a mask."""
        rows = np.flatnonzero(rows) if rows.dtype == bool else rows
        return IdColumn(self.column, rows if self.rows is None else self.rows[rows])


@dataclass(frozen=True, eq=False)
class TextFactor:
    """A column of N texts with few different values.

    Attributes:
        names: the different texts, in alphabetical order.
        index: (N,) index into the names for each row.
    """

    names: tuple[str, ...]
    index: NDArray[np.intp]

    @classmethod
    def of(cls, texts: NDArray[np.str_]) -> TextFactor:
        """Finds the different texts."""
        sample_size = 4096  # If the first rows have all texts, nothing is sorted.
        texts = np.asarray(texts, dtype=np.str_)
        if texts.ndim == 1 and len(texts) and texts.strides[0] == 0:  # one text, broadcast
            return cls((str(texts[0]),), np.zeros(len(texts), dtype=np.intp))
        keys = text_keys(texts)
        known, first = np.unique(keys[:sample_size], return_index=True)
        index = np.searchsorted(known, keys).clip(max=max(len(known) - 1, 0))
        if not np.array_equal(known[index], keys) if len(keys) else False:
            known, first, index = np.unique(keys, return_index=True, return_inverse=True)
        return cls._sorted(texts[first], index)

    @classmethod
    def of_codes(cls, codes: Rows, names: Sequence[str]) -> TextFactor:
        """Builds a column from (N,) codes and the names of the codes; -1 is the empty text."""
        empty = codes < 0
        if not empty.any():
            return cls._sorted(np.array(names, dtype=np.str_), codes)
        known = list(names) if "" in names else [*names, ""]
        return cls._sorted(np.array(known), np.where(empty, known.index(""), codes))

    @classmethod
    def _sorted(cls, names: NDArray[np.str_], index: Rows) -> TextFactor:
        order = np.argsort(names)
        rank = np.empty(len(order), dtype=np.intp)
        rank[order] = np.arange(len(order))
        return cls(tuple(names[order].tolist()), rank[index] if len(index) else index)

    def take(self, rows: Values) -> TextFactor:
        """The column with the selected rows."""
        return TextFactor(self.names, self.index[rows])

    def same(self, other: TextFactor) -> bool:
        """Whether both columns have the same texts in the same order."""
        return self.names == other.names and np.array_equal(self.index, other.index)

    def __getitem__(self, row: int) -> str:
        text: str = self.names[self.index[row]]
        return text

    def count(self, rows: Flags) -> dict[str, int]:
        """Counts of the texts of some rows, the most frequent first."""
        return dict(Counter(self.names[k] for k in self.index[rows].tolist()).most_common())

    def where(self, wanted: list[bool]) -> Flags:
        """(N,) mask from a truth value for each name."""
        return np.array(wanted, dtype=bool)[self.index]


class StoredNumbers(dict[str, Values]):
    """Columns of numbers in the columnar store, each read on first access."""

    def __init__(self, rows: StoredRows) -> None:
        super().__init__()
        self._rows = rows

    def __missing__(self, name: str) -> Values:
        self[name] = self._rows.column(name)
        return self[name]

    def same(self, other: StoredNumbers, name: str) -> bool:
        """Whether a column is known to be equal in both stores, without reading it."""
        return bool(self._rows.table.column(name).equals(other._rows.table.column(name)))


@dataclass(frozen=True, eq=False)
class ResultTable:
    """N rows of results.

    Attributes:
        id: (N,) ids of the grasps.
        texts: other columns of texts by name.
        numbers: (N,) columns of numbers by name.
    """

    id: IdColumn
    texts: Mapping[str, TextFactor]
    numbers: Mapping[str, Values]

    def __len__(self) -> int:
        return len(self.id)

    @classmethod
    def of_columns(cls, columns: Columns, names: Sequence[str]) -> ResultTable:
        """Builds a table from columns in memory."""
        others = [name for name in names if name != "id"]
        return cls(
            IdColumn(columns["id"]),
            {n: TextFactor.of(columns[n]) for n in others if n in TEXT_COLUMNS},
            {n: columns[n] for n in others if n not in TEXT_COLUMNS},
        )

    @classmethod
    def of_rows(cls, rows: StoredRows, names: Sequence[str]) -> ResultTable:
        """Builds a table from the columnar store, which stores texts as codes."""
        others = [name for name in names if name != "id"]
        return cls(
            IdColumn(rows.table.column("id")),
            {n: TextFactor.of_codes(*rows.codes(n)) for n in others if n in TEXT_COLUMNS},
            StoredNumbers(rows),
        )

    def same(self, other: ResultTable, name: str) -> bool:
        """Whether a column of numbers is known to be equal in both tables."""
        one, two = self.numbers, other.numbers
        return (
            isinstance(one, StoredNumbers)
            and isinstance(two, StoredNumbers)
            and one.same(two, name)
        )

    def take(self, rows: Rows, numbers: Sequence[str]) -> ResultTable:
        """The selected rows with the given columns of numbers; the table itself if all rows are
        selected in order.
        """
        if len(rows) == len(self) and np.array_equal(rows, np.arange(len(self))):
            return self
        return ResultTable(
            self.id.take(rows),
            {name: factor.take(rows) for name, factor in self.texts.items()},
            {name: self.numbers[name][rows] for name in numbers},
        )


GRASP_KEY_COLUMNS: tuple[str, ...] = ("scene_content", "id")  # Columns that identify a grasp.
GRASP_CONTENT_COLUMNS: tuple[str, ...] = ("x", "y", "z", "qw", "qx", "qy", "qz", "width")
"""Columns of pose and width, which define a grasp together with its instance."""


@dataclass(frozen=True, eq=False)
class Match:
    """Rows of the grasps that two tables have in common.

    Attributes:
        first, second: (N,) rows in each table.
        other_content: number of grasps that share only their id.
        only_first, only_second: number of grasps in one table alone.
    """

    first: Rows
    second: Rows
    other_content: int
    only_first: int
    only_second: int


def match_rows(first: ResultTable, second: ResultTable) -> Match:
    """Finds the grasps that two tables have in common; of duplicate rows the first one counts."""
    tolerance = 1e-9  # Metres, or 1 for quaternions: tables may have been stored as text.
    scenes, other_scenes = first.texts["scene_content"], second.texts["scene_content"]
    if first.id.same(second.id) and scenes.same(other_scenes):
        one = other = np.arange(len(first))
    else:
        _, one, other = np.intersect1d(_row_keys(first), _row_keys(second), return_indices=True)
        order = np.argsort(one)
        one, other = one[order], other[order]
    same = np.ones(len(one), dtype=bool)
    same_rows = one is other
    for name in GRASP_CONTENT_COLUMNS:
        if same_rows and first.same(second, name):
            continue
        a, b = first.numbers[name][one], second.numbers[name][other]
        same &= (np.abs(a - b) <= tolerance) | (np.isnan(a) & np.isnan(b))
    lengths = len(first) - len(one), len(second) - len(other)
    return Match(one[same], other[same], int((~same).sum()), *lengths)


def _row_keys(table: ResultTable) -> Values:
    scene_factor = np.uint64(0x9E3779B97F4A7C15)  # Makes keys of different scenes differ.
    scenes = table.texts["scene_content"]
    return table.id.keys + (text_keys(np.array(scenes.names)) * scene_factor)[scenes.index]
