"""A column of a table: its unit and what its values mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

TEXT: Final = ""
"""Unit of what is not a number."""
PLAIN: Final = "1"
"""Unit of numbers without one: ratios, counts, labels."""


@dataclass(frozen=True)
class Column:
    """Meaning of a column.

    Attributes:
        unit: `TEXT`, `PLAIN`, or a unit such as m, rad, N, s; `g` is the standard gravity of
            9.81 m/s2, and `weights` are those of the object.
        description: what its values are, in which frame.
    """

    unit: str
    description: str
