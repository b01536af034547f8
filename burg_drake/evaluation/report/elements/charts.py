"""The report's charts: stacked bars, intervals and histograms as HTML and inline SVG.

Colours come from the style sheet: a part or series names its CSS class.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.evaluation.report.elements.blocks import Html, element, join

WIDTH, HEIGHT = 320, 190
LEFT, RIGHT, TOP, BOTTOM = 34, 4, 16, 36
BEYOND, GAP = 14, 22
"""Size and margins of a histogram in SVG units; width and distance of the bar beyond its axis."""
BINS = 20


@dataclass(frozen=True)
class BarPart:
    """A segment of a stacked bar.

    Attributes:
        count: its length.
        style: CSS class of its colour.
        tip: shown where the pointer rests.
    """

    count: int
    style: str
    tip: str


@dataclass(frozen=True, eq=False)
class Series:
    """Values of a histogram that share a colour.

    Attributes:
        values: (N,) finite values.
        style: CSS class.
        name: for the tip.
    """

    values: Array
    style: str
    name: str


def stacked_bar(parts: Sequence[BarPart], whole: int) -> Html:
    """A bar whose segments are shares of `whole`; wide segments carry their count."""
    segments = [
        element(
            "span",
            f"{part.count:,}" if part.count >= 0.055 * whole else "",
            class_=f"part {part.style}",
            style=f"flex-grow:{part.count}",
            title=part.tip,
        )
        for part in parts
        if part.count
    ]
    return element("div", *segments, class_="bar")


def interval_mark(share: float, low: float, high: float) -> Html:
    """A point with its interval on an axis from 0 to 1."""

    def x(value: float) -> str:
        return f"{4 + 112 * value:.1f}"

    return element(
        "svg",
        element("line", x1=x(0), x2=x(1), y1=8, y2=8, class_="axis"),
        *(element("line", x1=x(v), x2=x(v), y1=5, y2=11, class_="axis") for v in (0, 0.5, 1)),
        element("line", x1=x(low), x2=x(high), y1=8, y2=8, class_="whisker"),
        element("circle", cx=x(share), cy=8, r=3.5, class_="dot"),
        viewBox="0 0 120 16",
        class_="interval",
        role="img",
        aria_label=f"{100 * share:.1f} %, between {100 * low:.0f} and {100 * high:.0f} %",
    )


def histogram(series: Sequence[Series], *, title: str, unit: str, focus: Array) -> Html:
    """Stacked histogram from zero. What lies beyond the axis is counted in a bar of its own, which
    the height of the others does not depend on.

    Args:
        series: drawn from the axis upward in this order.
        title, unit: of the horizontal axis.
        focus: values that the axis is fitted to, all but the largest hundredth.
    """
    top = float(np.quantile(focus, 0.99)) if len(focus) else 0.0
    step = nice_step(top / 6 if top > 0.0 else 0.2)
    end = step * max(1, math.ceil(top / step + 1e-9))
    edges = np.linspace(0.0, end, BINS + 1)
    counts = np.array([np.histogram(s.values, edges)[0] for s in series]).reshape(-1, BINS)
    beyond = [int((s.values > end).sum()) for s in series]
    highest = max(1, int(counts.sum(axis=0).max(initial=0)))
    bars = []
    for k in range(BINS):
        place = _x(edges[k], end) + 0.5, _x(edges[k + 1], end) - 0.5
        label = f"{edges[k]:g} to {edges[k + 1]:g} {unit}"
        bars += _stack(series, counts[:, k].tolist(), place, highest, label)
    if sum(beyond):
        place = WIDTH - RIGHT - BEYOND, WIDTH - RIGHT
        scale = max(highest, sum(beyond))
        bars += _stack(series, beyond, place, scale, f"above {end:g} {unit}")
        y = f"{_y(sum(beyond), scale) - 4:.1f}"
        bars.append(element("text", sum(beyond), x=WIDTH - RIGHT, y=y, class_="end"))
        more = f">{end:g}"
        y = f"{HEIGHT - BOTTOM + 14}"
        bars.append(element("text", more, x=WIDTH - RIGHT, y=y, class_="end"))
    return element(
        "svg",
        element("text", title, x=LEFT, y=HEIGHT - 4, class_="title"),
        *_vertical_axis(highest),
        *bars,
        *_horizontal_axis(end, step),
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        class_="histogram",
        role="img",
        aria_label=f"Histogram of {title}",
    )


def nice_step(rough: float) -> float:
    """The smallest of 1, 2 or 5 times a power of ten that is not below `rough` (> 0)."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= rough * (1 - 1e-9))


def _y(count: float, highest: int) -> float:
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * count / highest


def _x(value: float, end: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT - BEYOND - GAP) * value / end


def _stack(
    series: Sequence[Series],
    counts: Sequence[int],
    place: tuple[float, float],
    highest: int,
    label: str,
) -> list[Html]:
    """The bars of one bin, one on the other."""
    bars, below = [], 0
    left, right = place
    for s, count in zip(series, counts, strict=True):
        if count:
            y, foot = _y(below + count, highest), _y(below, highest)
            bars.append(
                element(
                    "rect",
                    element("title", f"{s.name}: {count}, {label}"),
                    x=f"{left:.2f}",
                    y=f"{y:.2f}",
                    width=f"{right - left:.2f}",
                    height=f"{foot - y:.2f}",
                    class_=s.style,
                )
            )
        below += count
    return bars


def _vertical_axis(highest: int) -> list[Html]:
    step = max(1, round(nice_step(highest / 3)))
    marks = []
    for count in range(0, highest + 1, step):
        y = f"{_y(count, highest):.1f}"
        style = "axis" if count == 0 else "grid"
        marks.append(
            element("line", x1=LEFT, x2=WIDTH - RIGHT - BEYOND - GAP, y1=y, y2=y, class_=style)
        )
        marks.append(element("text", count, x=LEFT - 5, y=y, dy="0.35em", class_="end"))
    return marks


def _horizontal_axis(end: float, step: float) -> list[Html]:
    y = HEIGHT - BOTTOM + 14
    return [
        element("text", f"{k * step:.6g}", x=f"{_x(k * step, end):.1f}", y=y, class_="middle")
        for k in range(round(end / step) + 1)
    ]


def legend(entries: Sequence[tuple[str, str]]) -> Html:
    """CSS classes of colours with what they stand for."""
    keys = [element("span", element("i", class_=style), join(name)) for style, name in entries]
    return element("p", *keys, class_="legend")
