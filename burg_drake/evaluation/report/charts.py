"""Charts of the report as HTML and inline SVG: stacked bars, intervals, histograms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, format_count, format_number
from burg_drake.visualization import Html, element, join


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


def legend(entries: Sequence[tuple[str, str]]) -> Html:
    """CSS classes of colours with what they stand for."""
    keys = [element("span", element("i", class_=style), join(name)) for style, name in entries]
    return element("p", *keys, class_="legend")


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


def nice_step(rough: float) -> float:
    """The smallest of 1, 2 or 5 times a power of ten that is not below `rough` (> 0)."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= rough * (1 - 1e-9))


HISTOGRAM_BINS = 20  # Along the axis.


class _Layout:
    """Lengths in a mirrored histogram, in SVG units."""

    left = 34  # Where the axis begins.
    axis = 262  # Length of the axis.
    overflow = (316, 332)  # Left and right edge of the bars for values beyond the axis.
    width = 340
    head = 34  # Height of title and upper text.
    half = 76  # Height of either half of the chart.
    bar = 62  # Height of the highest bar.
    line = 16  # Height of a line of text.


@dataclass(frozen=True, eq=False)
class HistogramSeries:
    """Values of a histogram that share a colour.

    Attributes:
        values: (N,) finite values.
        style: CSS class.
        name: for the tip.
    """

    values: Array
    style: str
    name: str


@dataclass(frozen=True)
class Limit:
    """A value that decides about an outcome.

    Attributes:
        value: on the axis.
        name: what it stands for.
    """

    value: float
    name: str


@dataclass(frozen=True)
class _Axis:
    end: float
    step: float

    def x(self, value: float) -> float:
        return _Layout.left + _Layout.axis * value / self.end

    @property
    def edges(self) -> Array:
        return np.linspace(0.0, self.end, HISTOGRAM_BINS + 1)


def mirrored_histogram(
    success: HistogramSeries,
    failures: Sequence[HistogramSeries],
    *,
    title: str,
    unit: str,
    limit: Limit | None = None,
) -> Html:
    """The distribution of a margin from zero, successes upward and failures downward. Each half
    has its own scale, whose largest count stands on the left; what lies beyond the axis is counted
    in a bar of its own. Without failures there is no lower half.

    Args:
        success: values of what succeeded; the axis is fitted to all but their largest hundredth.
        failures: others, stacked from the axis in this order.
        title, unit: of the horizontal axis.
        limit: drawn as a line, and always on the axis.
    """
    failed = np.concatenate([s.values for s in failures]) if failures else np.empty(0)
    axis = _make_axis(success.values if len(success.values) else failed, limit)
    base = _Layout.head + _Layout.half
    low = base + (_Layout.half if len(failed) else 0)
    height = low + _Layout.line * (2 if len(failed) else 1)
    texts = [_series_text(success.name, success.values, unit)]
    places = [_Layout.head - 6]
    if len(failed):
        texts.append(_series_text(f"not {success.name}", failed, unit))
        places.append(low + 2 * _Layout.line - 3)
    beyond = any((s.values > axis.end).any() for s in (success, *failures))
    return element(
        "svg",
        element("text", f"{title} [{unit}]", x=0, y=12, class_="title"),
        *(
            element("text", text, x=_Layout.left, y=y, class_="strong")
            for text, y in zip(texts, places, strict=True)
        ),
        *_axis_ticks(axis, base, low, beyond=beyond),
        *_half_bars([success], axis, base, -1),
        *_median_mark(success.values, axis, base, base - _Layout.half),
        *_half_bars(failures, axis, base, 1),
        *_median_mark(failed, axis, base, low),
        element(
            "line", x1=_Layout.left, x2=f"{axis.x(axis.end):.1f}", y1=base, y2=base, class_="axis"
        ),
        *(_limit_mark(limit, axis, unit, low) if limit else []),
        viewBox=f"0 0 {_Layout.width} {height}",
        class_="histogram",
        role="img",
        aria_label=f"Histogram of {title}: {'; '.join(texts)}",
    )


def _make_axis(focus: Array, limit: Limit | None) -> _Axis:
    top = float(np.quantile(focus, 0.99)) if len(focus) else 0.0
    top = max(top, limit.value * 1.1) if limit else top
    step = nice_step(top / 5 if top > 0.0 else 0.2)
    return _Axis(step * max(1, math.ceil(top / step + 1e-9)), step)


def _half_bars(
    series: Sequence[HistogramSeries], axis: _Axis, base: float, sign: int
) -> list[Html]:
    """Bars of one half; `sign` is 1 downward."""
    edges = axis.edges
    heights = [
        [*np.histogram(s.values, edges)[0].tolist(), int((s.values > axis.end).sum())]
        for s in series
    ]
    columns = list(zip(*heights, strict=True))
    highest = max(map(sum, columns), default=0)
    if not highest:
        return []
    bars: list[Html] = []
    for k, column in enumerate(columns):
        left, right = _bar_range(axis, k)
        overflow = k == HISTOGRAM_BINS
        where = f"above {axis.end:g}" if overflow else f"{edges[k]:g} to {edges[k + 1]:g}"
        below = 0
        for s, n in zip(series, column, strict=True):
            if n:
                near, far = (_Layout.bar * m / highest for m in (below, below + n))
                y = base + near if sign > 0 else base - far
                tip = element("title", f"{s.name}: {n}, {where}")
                place = {"x": f"{left:.2f}", "y": f"{y:.2f}"}
                span = {"width": f"{right - left:.2f}", "height": f"{far - near:.2f}"}
                bars.append(element("rect", tip, **place, **span, class_=s.style))
            below += n
        if overflow and below:
            y = base + sign * (_Layout.bar * below / highest + 3) + (8 if sign > 0 else 0)
            bars.append(element("text", format_count(below), x=right, y=f"{y:.1f}", class_="end"))
    x, y = _Layout.left - 4, base + sign * _Layout.bar
    return [*bars, element("text", format_count(highest), x=x, y=y, dy="0.35em", class_="end")]


def _bar_range(axis: _Axis, k: int) -> tuple[float, float]:
    """Left and right of the bar of a bin; that beyond the axis is the last one."""
    if k == HISTOGRAM_BINS:
        return _Layout.overflow
    left, right = axis.edges[k : k + 2].tolist()
    return axis.x(left) + 0.5, axis.x(right) - 0.5


def _median_mark(values: Array, axis: _Axis, base: float, end: float) -> list[Html]:
    if not len(values):
        return []
    median = float(np.median(values))
    x = f"{axis.x(median) if median <= axis.end else sum(_Layout.overflow) / 2:.1f}"
    return [element("line", x1=x, x2=x, y1=base, y2=end, class_="median")]


def _axis_ticks(axis: _Axis, base: float, low: float, *, beyond: bool) -> list[Html]:
    marks = []
    if beyond:
        end = {"x": _Layout.overflow[1], "y": low + _Layout.line - 3}
        marks.append(element("text", f">{axis.end:g}", **end, class_="end"))
    for k in range(round(axis.end / axis.step) + 1):
        x = f"{axis.x(k * axis.step):.1f}"
        marks.append(element("line", x1=x, x2=x, y1=base - _Layout.half, y2=low, class_="grid"))
        text = f"{k * axis.step:.6g}"
        marks.append(element("text", text, x=x, y=low + _Layout.line - 3, class_="middle"))
    return marks


def _limit_mark(limit: Limit, axis: _Axis, unit: str, low: float) -> list[Html]:
    x, x_text = f"{axis.x(limit.value):.1f}", f"{axis.x(limit.value) - 4:.1f}"
    text = f"{limit.name} {limit.value:g} {unit}"
    return [
        element("line", x1=x, x2=x, y1=_Layout.head - 2, y2=low, class_="limit"),
        element("text", text, x=x_text, y=_Layout.head + 9, class_="end strong"),
    ]


def _series_text(name: str, values: Array, unit: str) -> str:
    if not len(values):
        return f"{name}: none"
    median = float(np.median(values))
    decimals = 2 if abs(median) < 10.0 else 1 if abs(median) < 100.0 else 0
    space = "" if unit == "°" else " "
    middle = f"{format_number(median, decimals)}{space}{unit}"
    return f"{name}: {format_count(len(values))}, median {middle}"
