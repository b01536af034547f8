"""Histograms with what succeeded above the axis and what did not below it, each with its median."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.core.terminal import format_count, format_number
from burg_drake.evaluation.report.elements.blocks import Html, element
from burg_drake.evaluation.report.elements.charts import BINS, Series, nice_step

WIDTH = 340
LEFT, RIGHT = 34, 8
"""Size and margins of a chart in SVG units."""
HEAD, HALF, BAR, LINE = 34, 76, 62, 16
"""Heights: title and upper text, either half of the chart, its highest bar, a line of text."""
BEYOND, GAP = 16, 20
"""Width and distance of the bars beyond the axis."""


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
        return LEFT + (WIDTH - LEFT - RIGHT - BEYOND - GAP) * value / self.end

    @property
    def edges(self) -> Array:
        return np.linspace(0.0, self.end, BINS + 1)


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
    axis = _axis(success.values if len(success.values) else failed, limit)
    base = HEAD + HALF
    low = base + (HALF if len(failed) else 0)
    height = low + LINE + (LINE if len(failed) else 0)
    upper = [*_bars([success], axis, base, -1), *_median(success.values, axis, base, base - HALF)]
    lower = [*_bars(failures, axis, base, 1), *_median(failed, axis, base, low)]
    texts = [element("text", f"{title} [{unit}]", x=0, y=12, class_="title")]
    texts.append(_text(success.name, success.values, unit, HEAD - 6))
    if len(failed):
        texts.append(_text(f"not {success.name}", failed, unit, low + 2 * LINE - 3))
    spoken = f"Histogram of {title}: {_spoken(success.name, success.values, unit)}"
    spoken += f"; {_spoken(f'not {success.name}', failed, unit)}" if len(failed) else ""
    return element(
        "svg",
        *texts,
        *_ticks(
            axis, base, low, beyond=any((s.values > axis.end).any() for s in (success, *failures))
        ),
        *upper,
        *lower,
        element("line", x1=LEFT, x2=f"{axis.x(axis.end):.1f}", y1=base, y2=base, class_="axis"),
        *(_limit(limit, axis, unit, low) if limit else []),
        viewBox=f"0 0 {WIDTH} {height}",
        class_="histogram",
        role="img",
        aria_label=spoken,
    )


def _axis(focus: Array, limit: Limit | None) -> _Axis:
    top = float(np.quantile(focus, 0.99)) if len(focus) else 0.0
    top = max(top, limit.value * 1.1) if limit else top
    step = nice_step(top / 5 if top > 0.0 else 0.2)
    return _Axis(step * max(1, math.ceil(top / step + 1e-9)), step)


def _bars(series: Sequence[Series], axis: _Axis, base: float, sign: int) -> list[Html]:
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
        left, right = _place(axis, k)
        where = f"above {axis.end:g}" if k == BINS else f"{edges[k]:g} to {edges[k + 1]:g}"
        below = 0
        for s, n in zip(series, column, strict=True):
            if n:
                near, far = (BAR * m / highest for m in (below, below + n))
                y = base + near if sign > 0 else base - far
                tip = element("title", f"{s.name}: {n}, {where}")
                place = {"x": f"{left:.2f}", "y": f"{y:.2f}"}
                span = {"width": f"{right - left:.2f}", "height": f"{far - near:.2f}"}
                bars.append(element("rect", tip, **place, **span, class_=s.style))
            below += n
        if k == BINS and below:
            y = base + sign * (BAR * below / highest + 3) + (8 if sign > 0 else 0)
            bars.append(element("text", format_count(below), x=right, y=f"{y:.1f}", class_="end"))
    y = base + sign * BAR
    bars.append(element("text", format_count(highest), x=LEFT - 4, y=y, dy="0.35em", class_="end"))
    return bars


def _place(axis: _Axis, k: int) -> tuple[float, float]:
    """Left and right of the bar of a bin; that beyond the axis is the last one."""
    if k == BINS:
        return WIDTH - RIGHT - BEYOND, WIDTH - RIGHT
    left, right = axis.edges[k : k + 2].tolist()
    return axis.x(left) + 0.5, axis.x(right) - 0.5


def _median(values: Array, axis: _Axis, base: float, end: float) -> list[Html]:
    if not len(values):
        return []
    median = float(np.median(values))
    x = f"{axis.x(median) if median <= axis.end else WIDTH - RIGHT - BEYOND / 2:.1f}"
    return [element("line", x1=x, x2=x, y1=base, y2=end, class_="median")]


def _ticks(axis: _Axis, base: float, low: float, *, beyond: bool) -> list[Html]:
    marks = []
    if beyond:
        end = {"x": WIDTH - RIGHT, "y": low + LINE - 3}
        marks.append(element("text", f">{axis.end:g}", **end, class_="end"))
    for k in range(round(axis.end / axis.step) + 1):
        x = f"{axis.x(k * axis.step):.1f}"
        marks.append(element("line", x1=x, x2=x, y1=base - HALF, y2=low, class_="grid"))
        text = f"{k * axis.step:.6g}"
        marks.append(element("text", text, x=x, y=low + LINE - 3, class_="middle"))
    return marks


def _limit(limit: Limit, axis: _Axis, unit: str, low: float) -> list[Html]:
    x = f"{axis.x(limit.value):.1f}"
    text = f"{limit.name} {limit.value:g} {unit}"
    return [
        element("line", x1=x, x2=x, y1=HEAD - 2, y2=low, class_="limit"),
        element("text", text, x=f"{axis.x(limit.value) - 4:.1f}", y=HEAD + 9, class_="end strong"),
    ]


def _text(name: str, values: Array, unit: str, y: float) -> Html:
    return element("text", _spoken(name, values, unit), x=LEFT, y=y, class_="strong")


def _spoken(name: str, values: Array, unit: str) -> str:
    if not len(values):
        return f"{name}: none"
    median = float(np.median(values))
    decimals = 2 if abs(median) < 10.0 else 1 if abs(median) < 100.0 else 0
    space = "" if unit == "°" else " "
    middle = f"{format_number(median, decimals)}{space}{unit}"
    return f"{name}: {format_count(len(values))}, median {middle}"
