"""Charts of a comparison as inline SVG: shares with intervals over a number."""

from __future__ import annotations

import math
from collections.abc import Callable

from burg_drake.core.terminal import format_number
from burg_drake.evaluation.report.elements import Html, element, nice_step
from burg_drake.experiment.comparison.wording import margin_title
from burg_drake.experiment.statistics import Bin, MarginCalibration

WIDTH, HEIGHT = 330, 210
LEFT, RIGHT, TOP, BOTTOM = 38, 10, 24, 38
"""Size and margins of a plot in SVG units."""


def reliability_plot(found: MarginCalibration, vertical: str) -> Html:
    """Share over a number: a dot with its interval for each bin, the isotonic fit as a line, and
    the share of all together dashed.

    Args:
        found: bins and fit; shares of what the trials stand for, if that is known.
        vertical: what the share is of.
    """
    title, unit, size = margin_title(found.name)
    ends = [size * found.bins[0].low, size * found.bins[-1].high]
    size_of_all = max(abs(end) for end in ends)
    spread = ends[1] - ends[0]
    step = nice_step((spread if spread > 1e-6 * size_of_all else size_of_all or 1.0) / 5)
    low, high = math.floor(ends[0] / step + 1e-9), math.ceil(ends[1] / step - 1e-9)
    low, high = (low, high) if low < high else (low - 1, high + 1)

    def x(value: float) -> float:
        along = (size * value - low * step) / ((high - low) * step)
        return LEFT + (WIDTH - LEFT - RIGHT) * along

    named = f"{title} [{unit}]" if unit else title
    axis = [
        element("text", f"{k * step:.6g}", x=f"{x(k * step / size):.1f}", y=HEIGHT - BOTTOM + 15)
        for k in range(low, high + 1)
    ]
    return element(
        "svg",
        element("text", vertical, x=4, y=12, class_="title"),
        element("text", named, x=WIDTH - RIGHT, y=HEIGHT - 5, class_="title end"),
        *_levels(),
        element("g", *axis, class_="middle"),
        _across((found.weighted or found.share).value),
        _fit(found, x),
        *(part for row in found.bins for part in _dot(row, x, size, unit)),
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        class_="plot",
        role="img",
        aria_label=f"{vertical} over {named}",
    )


def y_of(share: float) -> float:
    """Height of a share."""
    return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - share)


def _levels() -> list[Html]:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = f"{y_of(share):.1f}"
        style = "axis" if share == 0.0 else "grid"
        parts.append(element("line", x1=LEFT, x2=WIDTH - RIGHT, y1=y, y2=y, class_=style))
        label = f"{100 * share:.0f} %" if share in (0.0, 0.5, 1.0) else ""
        parts.append(element("text", label, x=LEFT - 5, y=y, dy="0.35em", class_="end"))
    return parts


def _across(share: float | None) -> Html | None:
    if share is None:
        return None
    y = f"{y_of(share):.1f}"
    return element(
        "g",
        element("line", x1=LEFT, x2=WIDTH - RIGHT, y1=y, y2=y, class_="base"),
        element("title", f"of all: {100 * share:.1f} %"),
    )


def _fit(found: MarginCalibration, x: Callable[[float], float]) -> Html | None:
    """The isotonic fit, which jumps half way between its steps."""
    points, steps = [], found.isotonic
    for k, step in enumerate(steps):
        start = (steps[k - 1].high + step.low) / 2 if k else step.low
        end = (step.high + steps[k + 1].low) / 2 if k + 1 < len(steps) else step.high
        points += [f"{x(value):.1f},{y_of(step.share):.1f}" for value in (start, end)]
    return element("path", d="M" + " L".join(points), class_="fit") if points else None


def _dot(row: Bin, x: Callable[[float], float], size: float, unit: str) -> list[Html]:
    at = row.share if row.weighted is None else row.weighted
    place = f"{x(row.mean):.1f}"
    tip = (
        f"{row.successes} of {row.trials} trials, {format_number(size * row.low)} to"
        f" {format_number(size * row.high)} {unit}".rstrip()
    )
    value, low, high = (f"{y_of(v or 0.0):.1f}" for v in (at.value, at.low, at.high))
    return [
        element(
            "line", element("title", tip), x1=place, x2=place, y1=low, y2=high, class_="whisker"
        ),
        element("circle", element("title", tip), cx=place, cy=value, r=3.5, class_="dot"),
    ]
