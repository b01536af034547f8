"""Tables about sets of grasps: quantiles of columns, summaries, and comparisons of two sets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeVar

from rich.console import Console

from burg_drake import core
from burg_drake.grasping import (
    DISTRIBUTION_QUANTILES,
    FRICTION_NEEDED,
    Distribution,
    Ranking,
    SetComparison,
    SetSummary,
    Tolerance,
)

TABLE_QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)  # Quantiles in tables of grasp columns.


DISPLAY_UNITS = {"m": ("mm", 1e-3), "m2": ("mm2", 1e-6), "rad": ("deg", math.radians(1.0))}
"""Display unit and its size by SI unit; other units are printed unchanged."""


NumberRows = Mapping[str, tuple[int, Mapping[str, float]]]


def print_numbers(title: str, rows: NumberRows, frame: str = "object") -> None:
    """Prints figures of columns of grasps; fewer of them on a narrow terminal.

    Args:
        title: title of the table.
        rows: number of known values and figures by name in SI units, by column; the same names in
            every row.
        frame: frame of x, y and z.
    """
    optional_heads = ("5%", "95%")  # Columns that are left out on a narrow terminal.
    if not rows:
        return
    heads = list(next(iter(rows.values()))[1])
    table = number_table(title, heads, rows, frame)
    if table.width > Console().width:
        table = number_table(
            title, [head for head in heads if head not in optional_heads], rows, frame
        )
    table.show()


def number_table(
    title: str, heads: list[str], rows: NumberRows, frame: str = "object"
) -> core.TextTable:
    """The table with the figures in `heads`; see `print_numbers`."""
    table = core.TextTable(title).names("column").numbers("known", *heads)
    if {"x", "y", "z"} & set(rows):
        where = "the frame of its object" if frame == "object" else f"the {frame} frame"
        table.caption = f"x, y, z: the grasp frame's origin in {where}"
    for name, (known, figures) in rows.items():
        column = core.describe_column(name)
        unit, size = DISPLAY_UNITS.get(column.unit, (column.unit, 1.0)) if column else ("", 1.0)
        label = f"{name} [{unit}]" if unit not in ("", core.DIMENSIONLESS) else name
        table.row(
            label,
            core.format_count(known),
            *(core.format_number(figures[head] / size) for head in heads),
        )
    return table


Row = TypeVar("Row")


def print_summary(
    title: str, summary: SetSummary, notes: Sequence[str] = (), frame: str = "object"
) -> None:
    """Prints the figures of one set: by object, then by column.

    Args:
        title: title of the set.
        summary: figures of the set.
        notes: notes on values that were not read.
        frame: frame of the poses.
    """
    summary_table(title, summary).show()
    numbers = {name: values for name, values in summary.numbers.items() if values.count}
    print_numbers(
        "", {name: (of.count, _mean_and_quantiles(of)) for name, of in numbers.items()}, frame
    )
    for name, share in summary.truths.items():
        print(f"{name}: {share.count:,} of {share.total:,} ({core.format_percent(share.value)})")
    for name, counts in summary.texts.items():
        if 1 < len(counts) < summary.overall.grasps or name == "outcome":
            print(f"{name}: {_value_counts_text(counts)}")
    for note in notes:
        print(note)


def summary_table(title: str, summary: SetSummary) -> core.TextTable:
    """Figures of one set by object."""
    table = core.TextTable(title).names("object").numbers("grasps", "inst.", "equal")
    table.numbers("width\n[mm]", "score", "nearest\n[mm]")
    table.caption = "Means of width, score, and combined distance to the nearest other grasp."
    for name, one in _rows_with_total(summary.objects, summary.overall):
        table.row(
            name or "-",
            core.format_count(one.grasps),
            core.format_count(one.instances or None),
            core.format_count(one.duplicates),
            core.format_number(1e3 * one.width.mean, 1),
            core.format_number(one.score.mean, 3),
            core.format_number(1e3 * one.neighbour.mean, 1),
        )
    return table


def comparison_table(comparison: SetComparison) -> core.TextTable:
    """Table of the comparison of two sets, by object."""
    table = (
        core.TextTable("A and B")
        .names("object")
        .numbers("A", "B", "A has\nB near", "B has\nA near")
    )
    table.numbers("A to B\n[mm]", "95 %\n[mm]", "shift\n[mm]", "turn\n[deg]", "B to A\n[mm]")
    table.caption = (
        f"Near is {_tolerance_text(comparison.tolerance)}. Medians of distances to the nearest"
        " grasp, where a degree counts"
        f" {1e3 * comparison.tolerance.lever * math.radians(1.0):g} mm."
    )
    for name, one in _rows_with_total(comparison.objects, comparison.overall):
        table.row(
            name or "-",
            core.format_count(one.coverage.total),
            core.format_count(one.precision.total),
            core.format_percent(one.coverage.value),
            core.format_percent(one.precision.value),
            core.format_number(1e3 * one.to_grasps.median, 1),
            core.format_number(
                1e3 * one.to_grasps.quantiles[DISTRIBUTION_QUANTILES.index(0.95)], 1
            ),
            core.format_number(1e3 * one.translation.median, 1),
            core.format_number(math.degrees(one.angle.median), 1),
            core.format_number(1e3 * one.to_reference.median, 1),
        )
    return table


def ranking_table(ranking: Ranking) -> core.TextTable:
    """Table of the average precision, by criterion."""
    top = ranking.top
    table = core.TextTable(f"scores judged by {ranking.column}").names("good if")
    table.numbers("good", "AP", f"AP of the top {len(top.precision)}")
    rows = zip(
        ranking.criteria, ranking.good, ranking.average_precision, top.by_criterion, strict=True
    )
    for name, good, ap, ap_top in rows:
        of = f"{core.format_count(good)} of {core.format_count(ranking.grasps)}"
        table.row(name, of, core.format_number(ap, 3), core.format_number(ap_top, 3))
    return table


def print_comparison(comparison: SetComparison) -> None:
    """Prints the comparison of two sets, by object."""
    comparison_table(comparison).show()
    overall = comparison.overall
    print(f"coverage: B has {core.format_percent(overall.coverage.value)} of A")
    print(f"precision: A has {core.format_percent(overall.precision.value)} of B")
    print(f"ids in both: {comparison.shared_ids:,}")


def print_ranking(ranking: Ranking) -> None:
    """Prints average precision, by criterion."""
    ranking_table(ranking).show()
    top = ranking.top
    length = len(top.precision)
    print(
        f"AP is precision over recall. GraspNet-1Billion's AP of the top {length} is {top.ap:.3f};"
        f" it would be {top.attainable:.3f} if all {len(top.kept)} grasps that suppression leaves"
        " were good."
    )
    if ranking.colliding is not None:
        print(f"{ranking.colliding:,} collide, counted as bad.")
    elif ranking.column == FRICTION_NEEDED:
        print("Collisions unknown, not counted: no column `clearance`, `screened` or `outcome`.")


def _rows_with_total(objects: dict[str, Row], overall: Row) -> list[tuple[str, Row]]:
    """Rows by object, and a row of all objects if there are several."""
    rows = list(objects.items())
    return rows if len(rows) == 1 else [*rows, ("all", overall)]


def _mean_and_quantiles(values: Distribution) -> dict[str, float]:
    """Mean and quantiles by name."""
    shown = {f"{q:.0%}": values.quantiles[DISTRIBUTION_QUANTILES.index(q)] for q in TABLE_QUANTILES}
    return {"mean": values.mean, **shown}


def _tolerance_text(tolerance: Tolerance) -> str:
    bounds = []
    if math.isfinite(tolerance.translation):
        bounds.append(f"{1e3 * tolerance.translation:g} mm")
    if tolerance.angle < math.pi:
        bounds.append(f"{math.degrees(tolerance.angle):g} degrees")
    if math.isfinite(tolerance.distance):
        bounds.append(f"{1e3 * tolerance.distance:g} mm combined")
    return "within " + ", ".join(bounds) if bounds else "anything"


def _value_counts_text(counts: dict[str, int]) -> str:
    max_values = 6  # Maximum number of distinct values printed of a text column.
    shown = [f"{name or '(none)'} {count:,}" for name, count in list(counts.items())[:max_values]]
    more = len(counts) - len(shown)
    return ", ".join(shown) + (f" and {more:,} more" if more else "")
