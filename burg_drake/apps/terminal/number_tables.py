"""Figures of columns of grasps, in the units that people think in."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.console import Console

from burg_drake.core.grasps import PLAIN, describe
from burg_drake.core.terminal import TextTable, format_count, format_number

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)

SPARE = ("5%", "95%")
"""Columns that a narrow terminal does without."""

SHOWN = {"m": ("mm", 1e-3), "m2": ("mm2", 1e-6), "rad": ("deg", math.radians(1.0))}
"""What SI units are printed in, and how large that is; others as they are."""


NumberRows = Mapping[str, tuple[int, Mapping[str, float]]]


def print_numbers(title: str, rows: NumberRows, frame: str = "object") -> None:
    """Prints figures of columns of grasps; a narrow terminal gets fewer of them.

    Args:
        title: of the table.
        rows: by column, how many of its values are known, and figures by name in SI units; the
            same names in every row.
        frame: what x, y and z are measured in.
    """
    if not rows:
        return
    heads = list(next(iter(rows.values()))[1])
    table = number_table(title, heads, rows, frame)
    if table.width > Console().width:
        table = number_table(title, [head for head in heads if head not in SPARE], rows, frame)
    table.show()


def number_table(
    title: str, heads: list[str], rows: NumberRows, frame: str = "object"
) -> TextTable:
    """The table of some of the figures; see `print_numbers`."""
    table = TextTable(title).names("column").numbers("known", *heads)
    if {"x", "y", "z"} & set(rows):
        where = "the frame of its object" if frame == "object" else f"the {frame} frame"
        table.caption = f"x, y, z: the grasp frame's origin in {where}"
    for name, (known, figures) in rows.items():
        column = describe(name)
        unit, size = SHOWN.get(column.unit, (column.unit, 1.0)) if column else ("", 1.0)
        label = f"{name} [{unit}]" if unit not in ("", PLAIN) else name
        table.row(
            label, format_count(known), *(format_number(figures[head] / size) for head in heads)
        )
    return table
