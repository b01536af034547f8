"""Columns of few different texts as numbers: counting a million rows then takes milliseconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, listing


def member_codes(values: NDArray[np.str_], members: Sequence[str]) -> NDArray[np.int8]:
    """Place of each value (N,) among the members, by one comparison of all rows a member.

    Args:
        values: (N,) texts.
        members: what they can be, at most 127.

    Raises:
        InvalidInputError: a value is none of them.
    """
    codes = np.full(len(values), -1, dtype=np.int8)
    left = len(values)
    for place, member in enumerate(members):
        if not left:
            break
        mine = values == str(member)
        codes[mine] = place
        left -= int(np.count_nonzero(mine))
    if left:
        strange = sorted({str(value) for value in values[codes < 0]})
        raise InvalidInputError(
            f"{listing(strange)}: expected one of {listing(list(map(str, members)))}"
        )
    return codes


@dataclass(frozen=True, eq=False)
class Texts:
    """A column of texts, each different one once.

    Attributes:
        codes: (N,) which text each row has.
        names: the texts.
    """

    codes: NDArray[np.integer]
    names: Sequence[str]

    def most_common(self, rows: NDArray[np.int64], most: int) -> tuple[tuple[str, int], ...]:
        """The most frequent texts of some rows, with how often; empty ones do not count."""
        counts = np.bincount(self.codes[rows], minlength=len(self.names))
        ranked = np.argsort(-counts, kind="stable").tolist()
        found = [(self.names[k], int(counts[k])) for k in ranked if counts[k] and self.names[k]]
        return tuple(found[:most])


def texts_of(values: NDArray[np.str_]) -> Texts:
    """A column (N,) of few different texts."""
    texts = values.tolist()
    places = {name: place for place, name in enumerate(dict.fromkeys(texts))}
    codes = np.fromiter(map(places.__getitem__, texts), dtype=np.int64, count=len(texts))
    return Texts(codes, tuple(places))
