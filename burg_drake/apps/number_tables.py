"""Tables of numbers for the terminal: in the units that people think in, and none of them cut."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich import box
from rich.console import Console
from rich.table import Table

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)

SPARE = ("5%", "95%")
"""Columns that a narrow terminal does without."""

UNITS = {
    **dict.fromkeys(("x", "y", "z", "width", "pregrasp_width"), "mm"),
    **dict.fromkeys(("clearance", "arm_clearance", "contact_offset", "slide"), "mm"),
    **dict.fromkeys(("load_margin", "gravity_margin"), "weights"),
    **dict.fromkeys(("antipodal_angle", "joint_excess"), "deg"),
    "patch_area": "mm2",
}
"""What columns of grasps are printed in; others as they are."""

IN_SI = {"": 1.0, "weights": 1.0, "mm": 1e-3, "mm2": 1e-6, "deg": math.radians(1.0)}

WIDEST = 10_000
"""Characters of a line that no table needs."""


def print_numbers(title: str, rows: Mapping[str, tuple[int, Mapping[str, float]]]) -> None:
    """Prints figures of columns of grasps; a narrow terminal gets fewer of them.

    Args:
        title: of the table.
        rows: by column, how many of its values are known, and figures by name in SI units; the
            same names in every row.
    """
    if not rows:
        return
    heads = list(next(iter(rows.values()))[1])
    table = _filled(title, heads, rows)
    if _width(table) > Console().width:
        table = _filled(title, [head for head in heads if head not in SPARE], rows)
    print_table(table)


def new_table(title: str, first: str, *others: str) -> Table:
    """An empty table; all columns but the first are of numbers."""
    table = Table(
        box=box.SIMPLE_HEAD, title=title or None, title_justify="left", padding=(0, 1, 0, 0)
    )
    table.add_column(first, no_wrap=True)
    for head in others:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def print_table(table: Table) -> None:
    """Prints a table, rather in lines that are too long than with cells that are cut."""
    width = max(Console().width, _width(table))
    Console(markup=False, highlight=False, width=width).print(table)


def short(value: float) -> str:
    """Three digits of a number, in at most eight characters."""
    if math.isnan(value):
        return "-"
    text = f"{value:.2e}" if 0.0 < abs(value) < 1e-3 else f"{value:.3g}"
    digits, e, exponent = text.partition("e")
    return f"{digits}e{int(exponent)}" if e else text


def _filled(
    title: str, heads: list[str], rows: Mapping[str, tuple[int, Mapping[str, float]]]
) -> Table:
    table = new_table(title, "column", "known", *heads)
    for name, (known, figures) in rows.items():
        unit = UNITS.get(name, "")
        label = f"{name} ({unit})" if unit else name
        cells = (short(figures[head] / IN_SI[unit]) for head in heads)
        table.add_row(label, f"{known:,}", *cells)
    return table


def _width(table: Table) -> int:
    return Console(markup=False, width=WIDEST).measure(table).maximum
