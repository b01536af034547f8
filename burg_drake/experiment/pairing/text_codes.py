"""Columns of texts as numbers, for a million rows: distinct texts with an index of each row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.experiment.statistics import Flags, Rows, Values

SAMPLE = 4096
"""Rows that are looked at first; where they have all texts, nothing needs sorting."""
_KEYS = np.random.default_rng(1).integers(1, 1 << 63, 4096).astype(np.uint64) | np.uint64(1)
_MASKS = np.array([(1 << 8 * k) - 1 for k in range(9)], dtype=np.uint64)
"""Of the first so many bytes of a word."""


def text_keys(texts: NDArray[np.str_]) -> NDArray[np.uint64]:
    """A number for each text that is the same for the same text, whatever the column's width, and
    in all likelihood another one for another text."""
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
        keys += word * _KEYS[k % len(_KEYS)]
    return keys


def stored_keys(column: Any) -> NDArray[np.uint64]:
    """As `text_keys`, of an Arrow column of texts without nulls; none of them becomes an object."""
    found = [np.zeros(0, dtype=np.uint64), *(_chunk_keys(chunk) for chunk in column.chunks)]
    return np.concatenate(found)


def _chunk_keys(chunk: Any) -> NDArray[np.uint64]:
    """Sums of words of eight bytes, each times a number of its own."""
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
        keys += (words[at] & _MASKS[(length - 8 * k).clip(0, 8)]) * _KEYS[k % len(_KEYS)]
    return keys


@dataclass(frozen=True, eq=False)
class Ids:
    """A column of N texts that all differ; they become objects when they are asked for.

    Attributes:
        column: array of texts, or an Arrow column of them.
        rows: (N,) places in it; None for all of it.
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
        """(N,) numbers; see `text_keys`."""
        stored = not isinstance(self.column, np.ndarray)
        keys = stored_keys(self.column) if stored else text_keys(self.column)
        return keys if self.rows is None else keys[self.rows]

    def same(self, other: Ids) -> bool:
        """Whether both columns have the same texts in the same order; they may be found to differ
        only because they are not kept alike."""
        if self.rows is not None or other.rows is not None:
            return False
        arrays = [isinstance(column, np.ndarray) for column in (self.column, other.column)]
        if all(arrays):
            return np.array_equal(self.column, other.column)
        return not any(arrays) and bool(self.column.equals(other.column))

    def take(self, rows: Values) -> Ids:
        """The column of some rows, as indices or truth values."""
        rows = np.flatnonzero(rows) if rows.dtype == bool else rows
        return Ids(self.column, rows if self.rows is None else self.rows[rows])


@dataclass(frozen=True, eq=False)
class Factor:
    """A column of N texts that has few different ones.

    Attributes:
        names: the different texts, in alphabetical order.
        index: (N,) which of them each row has.
    """

    names: tuple[str, ...]
    index: NDArray[np.intp]

    @classmethod
    def of(cls, texts: NDArray[np.str_]) -> Factor:
        """Finds the different texts."""
        texts = np.asarray(texts, dtype=np.str_)
        if texts.ndim == 1 and len(texts) and texts.strides[0] == 0:  # one text, broadcast
            return cls((str(texts[0]),), np.zeros(len(texts), dtype=np.intp))
        keys = text_keys(texts)
        known, first = np.unique(keys[:SAMPLE], return_index=True)
        index = np.searchsorted(known, keys).clip(max=max(len(known) - 1, 0))
        if not np.array_equal(known[index], keys) if len(keys) else False:
            known, first, index = np.unique(keys, return_index=True, return_inverse=True)
        return cls._sorted(texts[first], index)

    @classmethod
    def of_codes(cls, codes: Rows, names: Sequence[str]) -> Factor:
        """From (N,) numbers and the texts that they stand for; -1 stands for an empty one."""
        empty = codes < 0
        if not empty.any():
            return cls._sorted(np.array(names, dtype=np.str_), codes)
        known = list(names) if "" in names else [*names, ""]
        return cls._sorted(np.array(known), np.where(empty, known.index(""), codes))

    @classmethod
    def _sorted(cls, names: NDArray[np.str_], index: Rows) -> Factor:
        order = np.argsort(names)
        rank = np.empty(len(order), dtype=np.intp)
        rank[order] = np.arange(len(order))
        return cls(tuple(names[order].tolist()), rank[index] if len(index) else index)

    def take(self, rows: Values) -> Factor:
        """The column of some rows."""
        return Factor(self.names, self.index[rows])

    def same(self, other: Factor) -> bool:
        """Whether both columns have the same texts in the same order."""
        return self.names == other.names and np.array_equal(self.index, other.index)

    def __getitem__(self, row: int) -> str:
        text: str = self.names[self.index[row]]
        return text

    def where(self, wanted: list[bool]) -> Flags:
        """(N,) truth values from one for each name."""
        return np.array(wanted, dtype=bool)[self.index]
