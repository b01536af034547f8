"""Tables of `burg-drake grasps stats`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

from burg_drake.apps.number_tables import (
    QUANTILES as SHOWN_QUANTILES,
)
from burg_drake.apps.number_tables import new_table, print_numbers, print_table
from burg_drake.grasping.comparison import (
    QUANTILES,
    Comparison,
    Distribution,
    ObjectComparison,
    ObjectSummary,
    SetSummary,
)
from burg_drake.grasping.coverage import Share
from burg_drake.grasping.pose_search import Tolerance
from burg_drake.grasping.ranking import FRICTION_NEEDED, Ranking

MOST_VALUES = 6
"""Different values of a text column that are printed."""

ALL = "all"

Row = TypeVar("Row")


def print_summary(title: str, summary: SetSummary, notes: Sequence[str] = ()) -> None:
    """Prints the figures of one set: by object, then by column.

    Args:
        title: names the set.
        summary: its figures.
        notes: what was left behind as it was read.
    """
    table = new_table(title, "object", "grasps", "inst.", "equal", "width\n[mm]", "score")
    table.add_column("nearest\n[mm]", justify="right", no_wrap=True)
    for name, one in _with_all(summary.objects, summary.overall):
        table.add_row(name or "-", *_object_cells(one))
    print_table(table)
    print("Means of width, score, and combined distance to the nearest other grasp.")
    numbers = {name: values for name, values in summary.numbers.items() if values.count}
    print_numbers("", {name: (of.count, _figures(of)) for name, of in numbers.items()})
    for name, share in summary.truths.items():
        print(f"{name}: {share.count:,} of {share.total:,} ({_share(share)})")
    for name, counts in summary.texts.items():
        if 1 < len(counts) < summary.overall.grasps or name == "outcome":
            print(f"{name}: {_occurrences(counts)}")
    for note in notes:
        print(note)


def print_comparison(comparison: Comparison) -> None:
    """Prints how two sets compare, by object."""
    table = new_table("A and B", "object", "A", "B", "A has\nB near", "B has\nA near")
    for head in ("A to B\n[mm]", "95 %\n[mm]", "shift\n[mm]", "turn\n[deg]", "B to A\n[mm]"):
        table.add_column(head, justify="right", no_wrap=True)
    for name, one in _with_all(comparison.objects, comparison.overall):
        table.add_row(name or "-", *_comparison_cells(one))
    print_table(table)
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
    table = new_table(f"scores judged by {ranking.column}", *heads)
    rows = zip(
        ranking.criteria, ranking.good, ranking.average_precision, top.by_criterion, strict=True
    )
    for name, good, ap, ap_top in rows:
        table.add_row(name, f"{good:,} of {ranking.grasps:,}", _figure(ap, 3), _figure(ap_top, 3))
    print_table(table)
    print(
        f"AP is precision over recall. GraspNet-1Billion's AP of the top {length} is {top.ap:.3f};"
        f" it would be {top.attainable:.3f} if all {len(top.kept)} grasps that suppression leaves"
        " were good."
    )
    if ranking.colliding is not None:
        print(f"{ranking.colliding:,} collide, counted as bad.")
    elif ranking.column == FRICTION_NEEDED:
        print("Collisions unknown, not counted: no column `clearance`, `screened` or `outcome`.")


def _with_all(objects: dict[str, Row], overall: Row) -> list[tuple[str, Row]]:
    """Rows by object, and one of all if there are several."""
    rows = list(objects.items())
    return rows if len(rows) == 1 else [*rows, (ALL, overall)]


def _figures(values: Distribution) -> dict[str, float]:
    """Mean and quantiles by name."""
    shown = {f"{q:.0%}": values.quantiles[QUANTILES.index(q)] for q in SHOWN_QUANTILES}
    return {"mean": values.mean, **shown}


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
