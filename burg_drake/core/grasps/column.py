"""A column of a table: its unit and what its values mean."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

TEXT: Final = ""
"""Unit of what is not a number."""
PLAIN: Final = "1"
"""Unit of numbers without one: ratios, counts, labels."""
SHOWN_UNITS: Mapping[str, tuple[str, float]] = {
    "m": ("mm", 1e3),
    "rad": ("°", 180 / math.pi),
    "m2": ("mm²", 1e6),
    "N": ("N", 1.0),
    "s": ("s", 1.0),
}
"""Units for people by that of a column, and how many of them it is."""


@dataclass(frozen=True)
class Column:
    """Meaning of a column, and how people read its numbers.

    Attributes:
        unit: `TEXT`, `PLAIN`, or a unit such as m, rad, N, s; `g` is the standard gravity of
            9.81 m/s2, and `weights` are those of the object.
        description: what its values are, in which frame.
        own_unit: for people, where it is not the usual one of its unit, and the factor to it.
        title: what people call it in a line or the head of a table; its name if empty.
        axis: what they call it at an axis, where there is room for more; the title if empty.
        digits: decimals of its numbers in the unit for people.
    """

    unit: str
    description: str
    own_unit: tuple[str, float] | None = None
    title: str = ""
    axis: str = ""
    digits: int = 1

    @property
    def shown(self) -> tuple[str, float]:
        """The unit in which people read it, empty if there is none, and the factor to it."""
        return self.own_unit or SHOWN_UNITS.get(self.unit, ("", 1.0))
