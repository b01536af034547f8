"""Charts as SVG: intervals of rates, histograms, ranked rates, and round steps of axes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Indices, format_count, format_number, format_percent
from burg_drake.visualization.html_page import (
    Child,
    Html,
    element,
    svg_line,
    svg_rectangle,
    svg_text,
)


def nice_step(rough: float, multiples: Sequence[float] = (1.0, 2.0, 5.0, 10.0)) -> float:
    """Smallest step >= `rough` (> 0) of the form multiple times power of ten."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(f * power for f in multiples if f * power >= rough * (1 - 1e-9))


def _chart(width: float, height: float, label: str, *shapes: Child, style: str) -> Html:
    view = f"0 0 {width} {height}"
    return element("svg", *shapes, viewBox=view, class_=style, role="img", aria_label=label)


def interval_mark(share: float, low: float, high: float) -> Html:
    """Mark of a rate with its confidence interval on an axis from 0 to 1."""

    def x(value: float) -> float:
        return round(4 + 112 * value, 1)

    return _chart(
        120,
        16,
        f"{100 * share:.1f} %, between {100 * low:.0f} and {100 * high:.0f} %",
        svg_line(x(0), 8, x(1), 8, "axis"),
        *(svg_line(x(v), 5, x(v), 11, "axis") for v in (0, 0.5, 1)),
        svg_line(x(low), 8, x(high), 8, "whisker"),
        element("circle", cx=x(share), cy=8, r=3.5, class_="dot"),
        style="interval",
    )


HISTOGRAM_BINS = 20


class _Layout:
    """Positions and lengths in a mirrored histogram, in SVG units."""

    left = 34  # Start of the axis.
    axis = 262  # Length of the axis.
    overflow = (316, 332)  # Left and right edge of the bars for values beyond the axis.
    width = 340
    head = 34  # Height of title and upper text.
    half = 76  # Height of either half of the chart.
    bar = 62  # Height of the highest bar.
    line = 16  # Height of a line of text.
    base = head + half  # Boundary of the halves.


@dataclass(frozen=True, eq=False)
class HistogramSeries:
    """Values of a histogram that share a colour.

    Attributes:
        values: (N,) finite values.
        style: CSS class.
        name: name in the tooltip.
    """

    values: Array
    style: str
    name: str


@dataclass(frozen=True)
class Limit:
    """A limit of a margin that decides the outcome.

    Attributes:
        value: value on the axis.
        name: name of the limit.
    """

    value: float
    name: str


@dataclass(frozen=True)
class _Axis:
    """The horizontal axis of a mirrored histogram, from zero."""

    end: float
    step: float

    def x(self, value: float) -> float:
        return _Layout.left + _Layout.axis * value / self.end


def mirrored_histogram(
    success: HistogramSeries,
    failures: Sequence[HistogramSeries],
    *,
    title: str,
    unit: str,
    limit: Limit | None = None,
) -> Html:
    """Histogram of a margin from zero, successes upward and failures downward. Each half has its
    own scale, with the largest count on the left; an extra bar counts values beyond the axis.
    Without failures there is no lower half.

    Args:
        success: margins of successes; the axis covers them up to their 99th percentile.
        failures: margins of failures, stacked from the axis in this order.
        title, unit: title and unit of the horizontal axis.
        limit: limit to draw as a line; the axis always includes it.
    """
    failed = np.concatenate([np.empty(0), *(s.values for s in failures)])
    axis = _fit_axis(success.values if len(success.values) else failed, limit)
    foot = _Layout.base + (_Layout.half if len(failed) else 0)
    above = _series_text(success.name, success.values, unit)
    shapes = [
        svg_text(f"{title} [{unit}]", 0, 12, "title"),
        svg_text(above, _Layout.left, _Layout.head - 6, "strong"),
    ]
    texts = [above]
    height = foot + _Layout.line
    if len(failed):
        texts.append(_series_text(f"not {success.name}", failed, unit))
        height += _Layout.line
        shapes.append(svg_text(texts[1], _Layout.left, height - 3, "strong"))
    beyond = any((s.values > axis.end).any() for s in (success, *failures))
    shapes += _axis_ticks(axis, foot, beyond=beyond)
    shapes += [*_half_bars([success], axis, -1), *_median_mark(success.values, axis, -1)]
    shapes += [*_half_bars(failures, axis, 1), *_median_mark(failed, axis, 1)]
    shapes.append(
        svg_line(_Layout.left, _Layout.base, _Layout.left + _Layout.axis, _Layout.base, "axis")
    )
    if limit:
        x, text = axis.x(limit.value), f"{limit.name} {limit.value:g} {unit}"
        shapes.append(svg_line(x, _Layout.head - 2, x, foot, "limit"))
        shapes.append(svg_text(text, x - 4, _Layout.head + 9, "end strong"))
    label = f"Histogram of {title}: {'; '.join(texts)}"
    return _chart(_Layout.width, height, label, *shapes, style="histogram")


def _fit_axis(focus: Array, limit: Limit | None) -> _Axis:
    top = float(np.quantile(focus, 0.99)) if len(focus) else 0.0
    top = max(top, limit.value * 1.1) if limit else top
    step = nice_step(top / 5 if top > 0.0 else 0.2)
    return _Axis(step * max(1, math.ceil(top / step + 1e-9)), step)


def _half_bars(series: Sequence[HistogramSeries], axis: _Axis, sign: int) -> list[Html]:
    """Bars of one half; `sign` is 1 downward."""
    edges = np.linspace(0.0, axis.end, HISTOGRAM_BINS + 1)
    heights = [
        [*np.histogram(s.values, edges)[0].tolist(), int((s.values > axis.end).sum())]
        for s in series
    ]
    columns = list(zip(*heights, strict=True))
    highest = max(map(sum, columns), default=0)
    if not highest:
        return []
    ranges = [(axis.x(a) + 0.5, axis.x(b) - 0.5) for a, b in itertools.pairwise(edges)]
    places = [f"{a:g} to {b:g}" for a, b in itertools.pairwise(edges)]
    bars: list[Html] = []
    for (left, right), place, column in zip(
        [*ranges, _Layout.overflow], [*places, f"above {axis.end:g}"], columns, strict=True
    ):
        end = _Layout.base
        for s, count in zip(series, column, strict=True):
            height = _Layout.bar * count / highest
            if count:
                y = end if sign > 0 else end - height
                tip = element("title", f"{s.name}: {count}, {place}")
                bars.append(svg_rectangle(left, y, right - left, height, tip, class_=s.style))
            end += sign * height
    if overflowed := sum(columns[-1]):  # the number beyond the last bar's end
        y = end + 3 * sign + (8 if sign > 0 else 0)
        bars.append(svg_text(format_count(overflowed), _Layout.overflow[1], y, "end"))
    x, y = _Layout.left - 4, _Layout.base + sign * _Layout.bar
    return [*bars, svg_text(format_count(highest), x, y, "end", dy="0.35em")]


def _median_mark(values: Array, axis: _Axis, sign: int) -> list[Html]:
    if not len(values):
        return []
    median = float(np.median(values))
    x = axis.x(median) if median <= axis.end else sum(_Layout.overflow) / 2
    return [svg_line(x, _Layout.base, x, _Layout.base + sign * _Layout.half, "median")]


def _axis_ticks(axis: _Axis, foot: float, *, beyond: bool) -> list[Html]:
    y = foot + _Layout.line - 3
    marks = [svg_text(f">{axis.end:g}", _Layout.overflow[1], y, "end")] if beyond else []
    for k in range(round(axis.end / axis.step) + 1):
        x = axis.x(k * axis.step)
        marks.append(svg_line(x, _Layout.base - _Layout.half, x, foot, "grid"))
        marks.append(svg_text(f"{k * axis.step:.6g}", x, y, "middle"))
    return marks


def _series_text(name: str, values: Array, unit: str) -> str:
    if not len(values):
        return f"{name}: none"
    median = float(np.median(values))
    decimals = 2 if abs(median) < 10.0 else 1 if abs(median) < 100.0 else 0
    space = "" if unit == "°" else " "
    middle = f"{format_number(median, decimals)}{space}{unit}"
    return f"{name}: {format_count(len(values))}, median {middle}"


@dataclass(frozen=True)
class RankedShare:
    """Success rate of a scene.

    Attributes:
        name: name of the scene.
        successes, trials: numbers of successes and trials.
        interval: confidence interval of the rate.
    """

    name: str
    successes: int
    trials: int
    interval: tuple[float, float]

    @property
    def share(self) -> float:
        """Successes over trials; requires trials."""
        return self.successes / self.trials


def ranked_chart(ranked: Sequence[RankedShare]) -> Html:
    """Chart of success rates with their intervals, a dot per scene, the worst on the left. Scenes
    without trials have an empty column."""
    left, right, top, bottom = 44, 474, 8, 164  # Edges of the plot [SVG units].
    max_named = 200  # With more scenes, dots have no tooltips with names.

    def y(share: float) -> float:
        return round(bottom - (bottom - top) * share, 1)

    step = (right - left) / max(len(ranked), 1)
    tried = [(left + (k + 0.5) * step, item) for k, item in enumerate(ranked) if item.trials]
    shapes: list[Child] = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        shapes.append(svg_line(left, y(share), right, y(share), "grid"))
        shapes.append(svg_text(f"{100 * share:.0f} %", left - 6, y(share), "end", dy="0.35em"))
    if tried:
        whiskers = "".join(
            f"M{x:.1f} {y(item.interval[0])}V{y(item.interval[1])}" for x, item in tried
        )
        width = f"stroke-width:{min(max(0.5 * step, 0.5), 2.5):.2f}"
        shapes.append(element("path", d=whiskers, class_="whiskers", style=width))
    radius = round(min(max(0.35 * step, 0.8), 3.2), 1)
    for x, item in tried:
        tip = f"{item.name}: {item.successes} of {item.trials}, {format_percent(item.share)}"
        title = [element("title", tip)] if len(tried) <= max_named else []
        place = {"cx": round(x, 1), "cy": y(item.share), "r": radius}
        shapes.append(element("circle", *title, **place, class_="dot"))
    shapes.append(
        svg_text(f"{format_count(len(ranked))} scenes, worst to best", left, 184, "title")
    )
    shares = [item.share for _, item in tried]
    rates = "nothing was executed"
    if shares:
        rates = f"from {format_percent(min(shares))} to {format_percent(max(shares))}"
    label = f"Success when executed of {len(ranked)} scenes: {rates}"
    return _chart(480, 190, label, *shapes, style="histogram ranked")


CHART_FILE_STYLE = """
text { font: 11px system-ui, sans-serif; fill: #5b656e; }
.title { font-size: 13px; font-weight: bold; fill: #1d2328; }
.middle { text-anchor: middle; } .end { text-anchor: end; }
.paper { fill: #ffffff; } .bar { fill: #31688e; } .axis { stroke: #5b656e; }
"""
"""Style of charts in files of their own."""


def histogram_file(
    values: Sequence[float], title: str, unit: str, *, limits: tuple[float, float] | None = None
) -> str:
    """Histogram of values.

    Args:
        values: values in the unit to show.
        title: text above the bars.
        unit: text below the bars.
        limits: ends of the axis; minimum and maximum of the values if None.

    Returns:
        An SVG document.
    """
    data = np.asarray(values, dtype=float)
    lower, upper = limits or (0.0, 1.0)
    if limits is None and data.size:
        lower, upper = float(data.min()), float(data.max())
    if upper - lower < 1e-9:
        lower, upper = lower - 0.5, upper + 0.5
    counts = np.histogram(data, np.linspace(lower, upper, HISTOGRAM_BINS + 1))[0]
    step = nice_step((upper - lower) / 6, (1.0, 2.0, 2.5, 5.0, 10.0))
    first, last = math.ceil(lower / step - 1e-9), math.floor(upper / step + 1e-9)
    labels = [k * step for k in range(first, last + 1)]
    return _bar_file(counts, title, unit, [((x - lower) / (upper - lower), x) for x in labels])


def bars_of_counts_file(values: Sequence[int], title: str, unit: str) -> str:
    """Bar chart of integers: how often each number from 0 to the largest occurs.

    Returns:
        An SVG document.
    """
    counts = np.bincount(np.asarray(values, dtype=int), minlength=2)
    step = 1 + (len(counts) - 1) // 12
    ticks = [((k + 0.5) / len(counts), float(k)) for k in range(0, len(counts), step)]
    return _bar_file(counts, title, unit, ticks)


def _bar_file(counts: Indices, title: str, unit: str, ticks: list[tuple[float, float]]) -> str:
    """SVG document of bars, with ticks at fractions of the axis."""
    width, height = 360, 200  # Pixels.
    left, right, top, base = 46, 346, 30, 160  # Edges of the bars [pixel].
    step = (right - left) / len(counts)
    max_count = max(1, int(counts.max(initial=0)))
    shapes = [
        svg_rectangle(0, 0, width, height, class_="paper"),
        svg_text(title, left, 18, "title"),
    ]
    for k, count in enumerate(counts.tolist()):
        bar_height = (base - top) * count / max_count
        shapes.append(
            svg_rectangle(
                left + step * k + 0.5, base - bar_height, step - 1.0, bar_height, class_="bar"
            )
        )
    shapes.append(svg_line(left, base, right, base, "axis"))
    for share, value in ticks:
        shapes.append(svg_text(f"{value:g}", left + (right - left) * share, base + 15, "middle"))
    shapes.append(svg_text(unit, (left + right) / 2, height - 8, "middle"))
    shapes += [
        svg_text(f"{max_count:,}", left - 6, top + 8, "end"),
        svg_text("0", left - 6, base, "end"),
    ]
    return element(
        "svg",
        element("style", Html(CHART_FILE_STYLE)),
        *shapes,
        xmlns="http://www.w3.org/2000/svg",
        width=width,
        height=height,
        viewBox=f"0 0 {width} {height}",
    )
