"""Arrays in files, whose shape, type and size are compared before any of their data is read."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.errors import InvalidInputError

ArrayShape = tuple[int, ...]

MOST_GRASPS = 5_000_000
"""Of one file. The largest sets that are known have two million grasps for all of their objects."""

MOST_BYTES = 3 << 30
"""Of memory for the arrays of one file. A million grasps with 100 columns of numbers take 1.0 GiB
of it; what computes with them takes about as much again."""

NUMBERS = "fiub"
"""Kinds of numbers and truth values, as `numpy.dtype.kind` has them."""

TYPES = {
    "f": "floating-point numbers",
    "fiu": "numbers",
    NUMBERS: "numbers or truth values",
    "U": "text",
    NUMBERS + "U": "numbers, truth values or text",
}
"""Kinds in words."""


class ReadBudget:
    """Memory that the arrays of a file may still take.

    Attributes:
        path: of the file.
        left: bytes.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.left = MOST_BYTES

    def require(self, where: str, nbytes: int) -> None:
        """Refuses an array that takes more than is left.

        Raises:
            InvalidInputError: it does.
        """
        if nbytes > self.left:
            raise InvalidInputError(
                f"{where} would take {_size(nbytes)} of memory; all arrays of a file"
                f" together may take {_size(MOST_BYTES)}"
            )

    def take(self, where: str, nbytes: int) -> None:
        """The same, and counts what is not refused."""
        self.require(where, nbytes)
        self.left -= nbytes


@dataclass(frozen=True)
class StoredArray:
    """What a file says of an array, none of whose data is read yet.

    Attributes:
        where: file and name, for messages.
        shape: of the array.
        kind: `numpy.dtype.kind` of its values when they are read.
        type: its type, for messages.
        itemsize: bytes of memory that a value takes; 0 where only the values tell.
        load: reads the data.
        allowance: of the file.
    """

    where: str
    shape: ArrayShape
    kind: str
    type: str
    itemsize: int
    load: Callable[[], NDArray[Any]]
    allowance: ReadBudget

    def read(self, kinds: str, *shapes: ArrayShape) -> NDArray[Any]:
        """The data, if it is what is expected.

        Args:
            kinds: allowed ones; a key of `TYPES`.
            shapes: allowed ones; none for any.

        Raises:
            InvalidInputError: other values or another shape, or too much of either.
        """
        if self.kind not in kinds:
            raise InvalidInputError(
                f"{self.where} has values of type {self.type}; expected {TYPES[kinds]}"
            )
        if shapes and self.shape not in shapes:
            expected = " or ".join(map(str, shapes))
            raise InvalidInputError(f"{self.where} has shape {self.shape}; expected {expected}")
        self.allowance.take(self.where, self.itemsize * math.prod(self.shape))
        return self.load()

    def rows(self, *shape: int) -> int:
        """How many grasps there are if the array has a value of this shape for each.

        Raises:
            InvalidInputError: it has another shape, or too many values.
        """
        if len(self.shape) != len(shape) + 1 or self.shape[1:] != shape:
            expected = "".join(f", {size}" for size in shape) or ","
            raise InvalidInputError(f"{self.where} has shape {self.shape}; expected (N{expected})")
        require_grasps(self.where, self.shape[0])
        return self.shape[0]


def require_grasps(where: str, n: int) -> None:
    """Refuses more grasps than a file may have.

    Raises:
        InvalidInputError: there are too many.
    """
    if n > MOST_GRASPS:
        raise InvalidInputError(
            f"{where} has {n:,} grasps; a file may have at most {MOST_GRASPS:,}; split it"
        )


def text_array(where: str, texts: list[str], allowance: ReadBudget) -> NDArray[np.str_]:
    """(N,) texts, which numpy keeps as long as the longest one.

    Raises:
        InvalidInputError: they take too much memory.
    """
    allowance.require(where, 4 * len(texts) * max(map(len, texts), default=0))
    return np.array(texts, dtype=str)


def _size(nbytes: int) -> str:
    return f"{nbytes / 2**30:.3g} GiB"
