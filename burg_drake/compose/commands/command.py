"""What all commands have in common."""

from __future__ import annotations

import math
from typing import Protocol

from burg_drake.compose.document import State, Surroundings
from burg_drake.core import InvalidInputError

MAX_COORDINATE = 100.0
"""Largest coordinate that an object may be given [m]; as the largest side of a board."""


class Command(Protocol):
    """A step that a user takes: a small frozen dataclass."""

    @property
    def label(self) -> str:
        """What it does, for a button that undoes it: `move mug`."""

    def apply(self, state: State, surroundings: Surroundings) -> State:
        """The state after it, with what it changed selected.

        Raises:
            BurgError: it cannot be done; one clear line says why.
        """


def label_of(verb: str, names: tuple[str, ...]) -> str:
    """A label that names what it is about, unless that is much."""
    if not 0 < len(names) <= 2:
        return f"{verb} {len(names)} objects"
    return f"{verb} {' and '.join(names)}"


def require_number(value: float, what: str, lower: float, upper: float, unit: str) -> float:
    """A number from a field.

    Raises:
        InvalidInputError: it is none, not finite, or outside of the range.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not lower <= number <= upper:
        given = f"{value:g}" if isinstance(value, float | int) else repr(value)
        raise InvalidInputError(
            f"{what} is {given}; give a number from {lower:g} to {upper:g} {unit}".rstrip()
        )
    return number
