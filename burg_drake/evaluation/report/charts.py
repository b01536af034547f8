"""Charts of the report as HTML and inline SVG: stacked bars, intervals, histograms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, format_count, format_number
from burg_drake.visualization import Html, element, join


class HistogramLayout:
    """Histogram layout."""

    width = 320  # SVG units, as all lengths here.
    height = 190
    left = 34  # Margin.
    right = 4  # Margin.
    top = 16  # Margin.
    bottom = 36  # Margin.
    overflow_width = 14  # Width of the bar for values beyond the axis.
    overflow_gap = 22  # Distance of this bar from the axis.
    bins = 20  # Number of bins along the axis.


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
    edges = np.linspace(0.0, end, HistogramLayout.bins + 1)
    counts = np.array([np.histogram(s.values, edges)[0] for s in series]).reshape(
        -1, HistogramLayout.bins
    )
    beyond = [int((s.values > end).sum()) for s in series]
    highest = max(1, int(counts.sum(axis=0).max(initial=0)))
    bars = []
    for k in range(HistogramLayout.bins):
        place = _axis_x(edges[k], end) + 0.5, _axis_x(edges[k + 1], end) - 0.5
        label = f"{edges[k]:g} to {edges[k + 1]:g} {unit}"
        bars += _stacked_bars(series, counts[:, k].tolist(), place, highest, label)
    if sum(beyond):
        place = (
            HistogramLayout.width - HistogramLayout.right - HistogramLayout.overflow_width,
            HistogramLayout.width - HistogramLayout.right,
        )
        scale = max(highest, sum(beyond))
        bars += _stacked_bars(series, beyond, place, scale, f"above {end:g} {unit}")
        y = f"{_bar_y(sum(beyond), scale) - 4:.1f}"
        bars.append(
            element(
                "text",
                sum(beyond),
                x=HistogramLayout.width - HistogramLayout.right,
                y=y,
                class_="end",
            )
        )
        more = f">{end:g}"
        y = f"{HistogramLayout.height - HistogramLayout.bottom + 14}"
        bars.append(
            element(
                "text", more, x=HistogramLayout.width - HistogramLayout.right, y=y, class_="end"
            )
        )
    return element(
        "svg",
        element(
            "text", title, x=HistogramLayout.left, y=HistogramLayout.height - 4, class_="title"
        ),
        *_vertical_axis(highest),
        *bars,
        *_horizontal_axis(end, step),
        viewBox=f"0 0 {HistogramLayout.width} {HistogramLayout.height}",
        class_="histogram",
        role="img",
        aria_label=f"Histogram of {title}",
    )


def nice_step(rough: float) -> float:
    """The smallest of 1, 2 or 5 times a power of ten that is not below `rough` (> 0)."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= rough * (1 - 1e-9))


def _bar_y(count: float, highest: int) -> float:
    return (
        HistogramLayout.height
        - HistogramLayout.bottom
        - (HistogramLayout.height - HistogramLayout.bottom - HistogramLayout.top) * count / highest
    )


def _axis_x(value: float, end: float) -> float:
    return (
        HistogramLayout.left
        + (
            HistogramLayout.width
            - HistogramLayout.left
            - HistogramLayout.right
            - HistogramLayout.overflow_width
            - HistogramLayout.overflow_gap
        )
        * value
        / end
    )


def _stacked_bars(
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
            y, foot = _bar_y(below + count, highest), _bar_y(below, highest)
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
        y = f"{_bar_y(count, highest):.1f}"
        style = "axis" if count == 0 else "grid"
        marks.append(
            element(
                "line",
                x1=HistogramLayout.left,
                x2=HistogramLayout.width
                - HistogramLayout.right
                - HistogramLayout.overflow_width
                - HistogramLayout.overflow_gap,
                y1=y,
                y2=y,
                class_=style,
            )
        )
        marks.append(
            element("text", count, x=HistogramLayout.left - 5, y=y, dy="0.35em", class_="end")
        )
    return marks


def _horizontal_axis(end: float, step: float) -> list[Html]:
    y = HistogramLayout.height - HistogramLayout.bottom + 14
    return [
        element("text", f"{k * step:.6g}", x=f"{_axis_x(k * step, end):.1f}", y=y, class_="middle")
        for k in range(round(end / step) + 1)
    ]


def legend(entries: Sequence[tuple[str, str]]) -> Html:
    """CSS classes of colours with what they stand for."""
    keys = [element("span", element("i", class_=style), join(name)) for style, name in entries]
    return element("p", *keys, class_="legend")


class MirroredLayout:
    """Mirrored layout."""

    width = 340  # SVG units, as all lengths here.
    left = 34  # Margin.
    right = 8  # Margin.
    head = 34  # Height of title and upper text.
    half = 76  # Height of either half of the chart.
    bar = 62  # Height of the highest bar.
    line = 16  # Height of a line of text.
    overflow_width = 16  # Width of the bars for values beyond the axis.
    overflow_gap = 20  # Distance of these bars from the axis.


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
        return (
            MirroredLayout.left
            + (
                MirroredLayout.width
                - MirroredLayout.left
                - MirroredLayout.right
                - MirroredLayout.overflow_width
                - MirroredLayout.overflow_gap
            )
            * value
            / self.end
        )

    @property
    def edges(self) -> Array:
        return np.linspace(0.0, self.end, HistogramLayout.bins + 1)


def mirrored_histogram(
    success: Series,
    failures: Sequence[Series],
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
    base = MirroredLayout.head + MirroredLayout.half
    low = base + (MirroredLayout.half if len(failed) else 0)
    height = low + MirroredLayout.line + (MirroredLayout.line if len(failed) else 0)
    upper = [
        *_half_bars([success], axis, base, -1),
        *_median_mark(success.values, axis, base, base - MirroredLayout.half),
    ]
    lower = [*_half_bars(failures, axis, base, 1), *_median_mark(failed, axis, base, low)]
    texts = [element("text", f"{title} [{unit}]", x=0, y=12, class_="title")]
    texts.append(_series_text(success.name, success.values, unit, MirroredLayout.head - 6))
    if len(failed):
        texts.append(
            _series_text(f"not {success.name}", failed, unit, low + 2 * MirroredLayout.line - 3)
        )
    spoken = f"Histogram of {title}: {_series_description(success.name, success.values, unit)}"
    spoken += f"; {_series_description(f'not {success.name}', failed, unit)}" if len(failed) else ""
    return element(
        "svg",
        *texts,
        *_axis_ticks(
            axis, base, low, beyond=any((s.values > axis.end).any() for s in (success, *failures))
        ),
        *upper,
        *lower,
        element(
            "line",
            x1=MirroredLayout.left,
            x2=f"{axis.x(axis.end):.1f}",
            y1=base,
            y2=base,
            class_="axis",
        ),
        *(_limit_mark(limit, axis, unit, low) if limit else []),
        viewBox=f"0 0 {MirroredLayout.width} {height}",
        class_="histogram",
        role="img",
        aria_label=spoken,
    )


def _make_axis(focus: Array, limit: Limit | None) -> _Axis:
    top = float(np.quantile(focus, 0.99)) if len(focus) else 0.0
    top = max(top, limit.value * 1.1) if limit else top
    step = nice_step(top / 5 if top > 0.0 else 0.2)
    return _Axis(step * max(1, math.ceil(top / step + 1e-9)), step)


def _half_bars(series: Sequence[Series], axis: _Axis, base: float, sign: int) -> list[Html]:
    """Bars of one half; `sign` is 1 downward."""
    edges = axis.edges
    inside = [np.histogram(s.values, edges)[0] for s in series]
    beyond = [int((s.values > axis.end).sum()) for s in series]
    heights = [[*counts.tolist(), more] for counts, more in zip(inside, beyond, strict=True)]
    highest = max((sum(column) for column in zip(*heights, strict=True)), default=0)
    if not highest:
        return []
    bars: list[Html] = []
    for k, column in enumerate(zip(*heights, strict=True)):
        left, right = _bar_range(axis, k)
        where = (
            f"above {axis.end:g}"
            if k == HistogramLayout.bins
            else f"{edges[k]:g} to {edges[k + 1]:g}"
        )
        below = 0
        for s, n in zip(series, column, strict=True):
            if n:
                near, far = (MirroredLayout.bar * m / highest for m in (below, below + n))
                y = base + near if sign > 0 else base - far
                tip = element("title", f"{s.name}: {n}, {where}")
                place = {"x": f"{left:.2f}", "y": f"{y:.2f}"}
                span = {"width": f"{right - left:.2f}", "height": f"{far - near:.2f}"}
                bars.append(element("rect", tip, **place, **span, class_=s.style))
            below += n
        if k == HistogramLayout.bins and below:
            y = base + sign * (MirroredLayout.bar * below / highest + 3) + (8 if sign > 0 else 0)
            bars.append(element("text", format_count(below), x=right, y=f"{y:.1f}", class_="end"))
    y = base + sign * MirroredLayout.bar
    bars.append(
        element(
            "text", format_count(highest), x=MirroredLayout.left - 4, y=y, dy="0.35em", class_="end"
        )
    )
    return bars


def _bar_range(axis: _Axis, k: int) -> tuple[float, float]:
    """Left and right of the bar of a bin; that beyond the axis is the last one."""
    if k == HistogramLayout.bins:
        return (
            MirroredLayout.width - MirroredLayout.right - MirroredLayout.overflow_width,
            MirroredLayout.width - MirroredLayout.right,
        )
    left, right = axis.edges[k : k + 2].tolist()
    return axis.x(left) + 0.5, axis.x(right) - 0.5


def _median_mark(values: Array, axis: _Axis, base: float, end: float) -> list[Html]:
    if not len(values):
        return []
    median = float(np.median(values))
    x = f"{axis.x(median) if median <= axis.end else MirroredLayout.width - MirroredLayout.right - MirroredLayout.overflow_width / 2:.1f}"
    return [element("line", x1=x, x2=x, y1=base, y2=end, class_="median")]


def _axis_ticks(axis: _Axis, base: float, low: float, *, beyond: bool) -> list[Html]:
    marks = []
    if beyond:
        end = {"x": MirroredLayout.width - MirroredLayout.right, "y": low + MirroredLayout.line - 3}
        marks.append(element("text", f">{axis.end:g}", **end, class_="end"))
    for k in range(round(axis.end / axis.step) + 1):
        x = f"{axis.x(k * axis.step):.1f}"
        marks.append(
            element("line", x1=x, x2=x, y1=base - MirroredLayout.half, y2=low, class_="grid")
        )
        text = f"{k * axis.step:.6g}"
        marks.append(element("text", text, x=x, y=low + MirroredLayout.line - 3, class_="middle"))
    return marks


def _limit_mark(limit: Limit, axis: _Axis, unit: str, low: float) -> list[Html]:
    x = f"{axis.x(limit.value):.1f}"
    text = f"{limit.name} {limit.value:g} {unit}"
    return [
        element("line", x1=x, x2=x, y1=MirroredLayout.head - 2, y2=low, class_="limit"),
        element(
            "text",
            text,
            x=f"{axis.x(limit.value) - 4:.1f}",
            y=MirroredLayout.head + 9,
            class_="end strong",
        ),
    ]


def _series_text(name: str, values: Array, unit: str, y: float) -> Html:
    return element(
        "text", _series_description(name, values, unit), x=MirroredLayout.left, y=y, class_="strong"
    )


def _series_description(name: str, values: Array, unit: str) -> str:
    if not len(values):
        return f"{name}: none"
    median = float(np.median(values))
    decimals = 2 if abs(median) < 10.0 else 1 if abs(median) < 100.0 else 0
    space = "" if unit == "°" else " "
    middle = f"{format_number(median, decimals)}{space}{unit}"
    return f"{name}: {format_count(len(values))}, median {middle}"
