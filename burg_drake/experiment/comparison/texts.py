"""Columns of texts as numbers, for a million rows: distinct texts with an index of each row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.experiment.comparison.arrays import Flags, Rows, Values

SAMPLE = 4096
"""Rows that are looked at first; where they have all texts, nothing needs sorting."""
_KEYS = np.random.default_rng(1).integers(1, 1 << 63, 4096).astype(np.uint64) | np.uint64(1)


def text_keys(texts: NDArray[np.str_]) -> NDArray[np.uint64]:
    """A number for each text that is the same for the same text, whatever the column's width, and
    in all likelihood another one for another text."""
    texts = np.ascontiguousarray(texts, dtype=np.str_)
    keys = np.zeros(len(texts), dtype=np.uint64)
    if not texts.dtype.itemsize or not len(texts):
        return keys
    characters = texts.view(np.uint32).reshape(len(texts), -1)
    for plane in range(4):  # of characters' bytes; nearly all texts have the first one alone
        if plane == 0 or characters.max() >= 1 << 8 * plane:
            keys += _byte_keys((characters >> np.uint32(8 * plane)).astype(np.uint8), plane)
    return keys


def _byte_keys(letters: NDArray[np.uint8], plane: int) -> NDArray[np.uint64]:
    """Sums of words of eight bytes, each times a number of its own."""
    words = np.zeros((len(letters), -(-letters.shape[1] // 8) * 8), dtype=np.uint8)
    words[:, : letters.shape[1]] = letters
    keys = np.zeros(len(letters), dtype=np.uint64)
    for k, word in enumerate(words.view(np.uint64).T):
        keys += word * _KEYS[(4 * k + plane) % len(_KEYS)]
    return keys


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

    def __getitem__(self, row: int) -> str:
        return self.names[self.index[row]]

    def where(self, wanted: list[bool]) -> Flags:
        """(N,) truth values from one for each name."""
        return np.array(wanted, dtype=bool)[self.index]
