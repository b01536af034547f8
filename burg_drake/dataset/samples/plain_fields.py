"""Values of JSON that comes from outside, checked one by one; messages name place and key."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from burg_drake.core import Array, DocumentError, InvalidInputError, check_pose, nearest, quoted

LARGEST = 1 << 53
"""Whole numbers up to it are the same in every JSON."""
LARGEST_NUMBER = 1e300
"""Below the largest that there is, so that what is computed with it stays finite."""


class PlainFields:
    """The values of a JSON mapping.

    Attributes:
        where: it is, for messages.
    """

    def __init__(self, values: Any, names: Iterable[str], where: str) -> None:
        """Takes a mapping that has exactly these names.

        Raises:
            DocumentError: it has not.
        """
        self.where = where
        if not isinstance(values, dict):
            raise DocumentError(f"{where}: {quoted(values)} is not a mapping")
        names = list(names)
        for name in values:
            if name not in names:
                raise DocumentError(f"{where}: unknown key {quoted(name)}; {nearest(name, names)}")
        for name in names:
            if name not in values:
                raise DocumentError(f"{where}: key {name!r} is missing")
        self._values = values

    def within(self, name: str, names: Iterable[str]) -> PlainFields:
        """A mapping in this one."""
        return PlainFields(self._values[name], names, f"{self.where}: {name}")

    def each(self, name: str, names: Iterable[str]) -> list[PlainFields]:
        """The mappings of a list."""
        names, where = list(names), f"{self.where}: {name}"
        return [
            PlainFields(item, names, f"{where}[{i}]") for i, item in enumerate(self._list(name))
        ]

    def text(self, name: str) -> str:
        """A text."""
        value = self._values[name]
        if not isinstance(value, str) or "\0" in value:
            raise self.wrong(name, "a text")
        return value

    def texts(self, name: str) -> list[str]:
        """A list of texts."""
        values = self._list(name)
        if not all(isinstance(value, str) for value in values):
            raise self.wrong(name, "a list of texts")
        return values

    def whole(self, name: str, low: int = 0, high: int = LARGEST) -> int:
        """A whole number in this range."""
        value = self._values[name]
        if type(value) is not int or not low <= value <= high:
            raise self.wrong(name, f"a whole number from {low} to {high}")
        return value

    def wholes(self, name: str, count: int) -> tuple[int, ...] | None:
        """So many whole numbers, or None for null."""
        values = self._values[name]
        if values is None:
            return None
        good = isinstance(values, list) and len(values) == count
        if not good or any(type(value) is not int or abs(value) > LARGEST for value in values):
            raise self.wrong(name, f"{count} whole numbers, or null")
        return tuple(values)

    def number(self, name: str, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number in this range."""
        value = self._values[name]
        if not _is_number(value) or not low <= value <= high:
            among = "" if low == -math.inf else f" from {low:g} to {high:g}"
            raise self.wrong(name, f"a finite number{among}")
        return float(value)

    def numbers(self, name: str, count: int | None = None) -> tuple[float, ...]:
        """Finite numbers, so many if that is given."""
        values = self._list(name)
        if len(values) != (len(values) if count is None else count) or not all(
            map(_is_number, values)
        ):
            raise self.wrong(name, f"a list of {'' if count is None else f'{count} '}numbers")
        return tuple(map(float, values))

    def pose(self, name: str) -> Array:
        """A (4, 4) pose, as four lists of four numbers."""
        rows = self._list(name)
        if not all(isinstance(row, list) and all(map(_is_number, row)) for row in rows):
            raise self.wrong(name, "a pose, four lists of four numbers")
        try:
            return check_pose(rows, name)
        except ValueError as error:  # rows of different lengths, too
            raise DocumentError(f"{self.where}: {name} is not a pose: {error}") from error

    def mapping(self, name: str) -> dict[str, Any]:
        """A mapping, with whatever it holds."""
        value = self._values[name]
        if not isinstance(value, dict):
            raise self.wrong(name, "a mapping")
        return value

    def is_null(self, name: str) -> bool:
        """There is nothing under this name."""
        return self._values[name] is None

    def wrong(self, name: str, expected: str) -> DocumentError:
        """The error about a value that is not what is expected."""
        value = quoted(self._values[name])
        return DocumentError(f"{self.where}: {name} is {value}; expected {expected}")

    def refused(self, error: InvalidInputError) -> DocumentError:
        """An error about what was made of the values, with the place."""
        return DocumentError(f"{self.where}: {error}")

    def _list(self, name: str) -> list[Any]:
        value = self._values[name]
        if not isinstance(value, list):
            raise self.wrong(name, "a list")
        return value


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) < LARGEST_NUMBER
