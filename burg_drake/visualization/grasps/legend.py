"""What the colours of drawn grasps stand for: entries of a page's legend."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import PLAIN, TEXT, GraspSet, describe
from burg_drake.visualization.grasps.groups import (
    GraspGroup,
    NumberGroups,
    all_alike,
    bin_key,
    by_name,
    by_number,
)
from burg_drake.visualization.grasps.mesh import grasp_path
from burg_drake.visualization.style import BINS, ColorBar, ColorScale, LegendEntry, hex_color

TOO_CLOSE = 0.08
"""Ticks that are nearer to an end of the bar, as a share of it, make room for the end's number."""


def color_by(
    grasps: GraspSet, column: str | None = None, limits: Sequence[float] | None = None
) -> tuple[tuple[GraspGroup, ...], list[ColorBar | LegendEntry]]:
    """Colours for grasps, and what they stand for.

    Args:
        grasps: (N,).
        column: one of the set's; None for the outcome, else the score, whatever there is.
        limits: lower and upper end of the colours of numbers; they follow from these if None.

    Returns:
        The grasps in groups of one colour each, and the legend.

    Raises:
        UnknownNameError: there is no such column; the message names the nearest.
        InvalidInputError: the limits do not rise, or are given for a column of names.
    """
    name = column or default_column(grasps)
    values = None if name is None else grasps.column(name)
    if name is not None and values is not None and values.dtype.kind in "fiu":
        numbers = by_number(values, None if limits is None else (limits[0], limits[1]))
        return numbers.groups, number_legend(with_unit(name), numbers)
    if limits is not None:
        what = "all grasps have one colour" if name is None else f"column {name!r} has names"
        raise InvalidInputError(f"a range of colours is for numbers; {what}")
    if values is None:
        groups = all_alike(len(grasps))
    else:
        truths = values.dtype.kind == "b"
        groups = by_name((np.where(values, "yes", "no") if truths else values).tolist())
    return groups, [*group_entries(groups)]


def default_column(grasps: GraspSet) -> str | None:
    """What grasps are best coloured by; None where nothing is known of them."""
    if "outcome" in grasps.columns:
        return "outcome"
    return "score" if np.isfinite(grasps.score).any() else None


def with_unit(name: str) -> str:
    """A column's name for people, with its unit if that is known."""
    column = describe(name)
    if column is None or column.unit in (TEXT, PLAIN):
        return name
    return f"{name} [{column.unit.replace('m2', 'm²')}]"


def group_entries(groups: Iterable[GraspGroup]) -> list[LegendEntry]:
    """A switch for each label, with the number of grasps."""
    by_label: dict[str, list[GraspGroup]] = {}
    for group in groups:
        by_label.setdefault(group.label, []).append(group)
    return [
        LegendEntry(
            f"{label} ({sum(len(g.members) for g in members)})",
            hex_color(members[0].rgba[:3]),
            tuple(grasp_path(g.key) for g in members),
        )
        for label, members in by_label.items()
    ]


def number_legend(title: str, grouped: NumberGroups) -> list[ColorBar | LegendEntry]:
    """The colour bar of a number, and a switch for the grasps where it is not known.

    Args:
        title: what the number is.
        grouped: the grasps by it.
    """
    below, above = grouped.beyond
    notes = [f"{count} {side} the range" for count, side in ((below, "below"), (above, "above"))]
    bar = ColorBar(
        title=title,
        colors=tuple(hex_color(color) for color in grouped.scale.colors()),
        counts=tuple(int(count) for count in grouped.counts),
        ticks=_ticks(grouped.scale, grouped.beyond),
        paths=tuple(grasp_path(bin_key(k)) for k in range(BINS)),
        note=", ".join(n for n, count in zip(notes, grouped.beyond, strict=True) if count),
    )
    return [bar, *group_entries(g for g in grouped.groups if g.key == "unknown")]


def _ticks(scale: ColorScale, beyond: tuple[int, int]) -> tuple[tuple[float, str], ...]:
    """Both ends of a bar, and the round numbers between them."""
    span = scale.upper - scale.lower
    inner = [(t, (t - scale.lower) / span) for t in scale.ticks()]
    ticks = [(place, _text(t, span)) for t, place in inner if TOO_CLOSE < place < 1 - TOO_CLOSE]
    ends = [_text(scale.lower, span), _text(scale.upper, span)]
    if beyond[0]:
        ends[0] = f"≤ {ends[0]}"
    if beyond[1]:
        ends[1] = f"≥ {ends[1]}"
    return ((0.0, ends[0]), *ticks, (1.0, ends[1]))


def _text(value: float, span: float) -> str:
    """A number with as many digits as tell it from others on a bar that is `span` long."""
    if abs(value) < 1e-9 * span:
        return "0"
    digits = max(4, int(np.ceil(np.log10(abs(value) / span))) + 2)
    return f"{value:.{min(digits, 15)}g}"
