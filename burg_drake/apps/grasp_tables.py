"""Tables of `burg-drake grasps stats`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

from rich import box
from rich.console import Console
from rich.table import Table

from burg_drake.grasping.comparison import (
    QUANTILES,
    Comparison,
    ObjectComparison,
    ObjectSummary,
    SetSummary,
)
from burg_drake.grasping.coverage import Share
from burg_drake.grasping.pose_search import Tolerance
from burg_drake.grasping.ranking import Ranking

MOST_VALUES = 6
"""Different values of a text column that are printed."""

SHOWN_QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)

ALL = "all"

Row = TypeVar("Row")


def print_summary(title: str, summary: SetSummary, notes: Sequence[str] = ()) -> None:
    """Prints the figures of one set: by object, then by column.

    Args:
        title: names the set.
        summary: its figures.
        notes: what was left behind as it was read.
    """
    table = _table(title, "object", "grasps", "inst.", "equal", "width\n[mm]", "score")
    table.add_column("nearest\n[mm]", justify="right", no_wrap=True)
    for name, one in _with_all(summary.objects, summary.overall):
        table.add_row(name or "-", *_object_cells(one))
    _print(table)
    print("Means of width, score, and combined distance to the nearest other grasp.")
    table = _table("", "column", "grasps", "mean", *(f"{q:.0%}" for q in SHOWN_QUANTILES))
    for name, values in summary.numbers.items():
        if values.count:
            shown = [values.quantiles[QUANTILES.index(q)] for q in SHOWN_QUANTILES]
            table.add_row(name, f"{values.count:,}", *_alike([values.mean, *shown]))
    _print(table)
    for name, share in summary.truths.items():
        print(f"{name}: {share.count:,} of {share.total:,} ({_share(share)})")
    for name, counts in summary.texts.items():
        if 1 < len(counts) < summary.overall.grasps or name == "outcome":
            print(f"{name}: {_occurrences(counts)}")
    for note in notes:
        print(note)


def print_comparison(comparison: Comparison) -> None:
    """Prints how two sets compare, by object."""
    table = _table("A and B", "object", "A", "B", "A has\nB near", "B has\nA near")
    for head in ("A to B\n[mm]", "95 %\n[mm]", "shift\n[mm]", "turn\n[deg]", "B to A\n[mm]"):
        table.add_column(head, justify="right", no_wrap=True)
    for name, one in _with_all(comparison.objects, comparison.overall):
        table.add_row(name or "-", *_comparison_cells(one))
    _print(table)
    overall = comparison.overall
    print(
        f"Near is {_bounds(comparison.tolerance)}. Medians of distances to the nearest grasp, where"
        " a degree counts"
        f" {1e3 * comparison.tolerance.lever * math.radians(1.0):g} mm."
    )
    print(f"coverage: B has {_share(overall.coverage)} of A")
    print(f"precision: A has {_share(overall.precision)} of B")
    print(f"ids in both: {comparison.shared_ids:,}")


def print_ranking(ranking: Ranking) -> None:
    """Prints average precision, by criterion."""
    top = ranking.top
    length = len(top.precision)
    heads = ("good if", "good", "AP", f"AP of the top {length}")
    table = _table(f"scores judged by {ranking.column}", *heads)
    rows = zip(
        ranking.criteria, ranking.good, ranking.average_precision, top.by_criterion, strict=True
    )
    for name, good, ap, ap_top in rows:
        table.add_row(name, f"{good:,} of {ranking.grasps:,}", _figure(ap, 3), _figure(ap_top, 3))
    _print(table)
    print(
        f"AP is precision over recall. GraspNet-1Billion's AP of the top {length} is {top.ap:.3f};"
        f" it would be {top.attainable:.3f} if all {len(top.kept)} grasps that suppression leaves"
        " were good."
    )


def _table(title: str, first: str, *others: str) -> Table:
    table = Table(
        box=box.SIMPLE_HEAD, title=title or None, title_justify="left", padding=(0, 1, 0, 0)
    )
    table.add_column(first, no_wrap=True)
    for head in others:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def _print(table: Table) -> None:
    Console(markup=False, highlight=False).print(table)


def _with_all(objects: dict[str, Row], overall: Row) -> list[tuple[str, Row]]:
    """Rows by object, and one of all if there are several."""
    rows = list(objects.items())
    return rows if len(rows) == 1 else [*rows, (ALL, overall)]


def _object_cells(one: ObjectSummary) -> list[str]:
    return [
        f"{one.grasps:,}",
        str(one.instances or "-"),
        f"{one.duplicates:,}",
        _figure(1e3 * one.width.mean),
        _figure(one.score.mean, 3),
        _figure(1e3 * one.neighbour.mean),
    ]


def _comparison_cells(one: ObjectComparison) -> list[str]:
    return [
        f"{one.coverage.total:,}",
        f"{one.precision.total:,}",
        _share(one.coverage),
        _share(one.precision),
        _figure(1e3 * one.to_grasps.median),
        _figure(1e3 * one.to_grasps.quantiles[QUANTILES.index(0.95)]),
        _figure(1e3 * one.translation.median),
        _figure(math.degrees(one.angle.median)),
        _figure(1e3 * one.to_reference.median),
    ]


def _bounds(tolerance: Tolerance) -> str:
    bounds = []
    if math.isfinite(tolerance.translation):
        bounds.append(f"{1e3 * tolerance.translation:g} mm")
    if tolerance.angle < math.pi:
        bounds.append(f"{math.degrees(tolerance.angle):g} degrees")
    if math.isfinite(tolerance.distance):
        bounds.append(f"{1e3 * tolerance.distance:g} mm combined")
    return "within " + ", ".join(bounds) if bounds else "anything"


def _occurrences(counts: dict[str, int]) -> str:
    shown = [f"{name or '(none)'} {count:,}" for name, count in list(counts.items())[:MOST_VALUES]]
    more = len(counts) - len(shown)
    return ", ".join(shown) + (f" and {more:,} more" if more else "")


def _share(share: Share) -> str:
    return "-" if math.isnan(share.value) else f"{share.value:.1%}"


def _figure(value: float, decimals: int = 1) -> str:
    return "-" if math.isnan(value) else f"{value:.{decimals}f}"


def _alike(values: list[float]) -> list[str]:
    """Numbers with as many decimals as give the largest one three digits."""
    largest = max(abs(value) for value in values)
    exponent = math.floor(math.log10(largest)) if largest else 0
    if not -4 <= exponent <= 6:
        return [f"{value:.2e}" for value in values]
    return [_figure(value, max(0, 2 - exponent)) for value in values]
