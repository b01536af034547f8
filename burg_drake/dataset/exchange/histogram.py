"""Histograms as small SVG pictures, which stand alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import Array, Indices
from burg_drake.visualization.style import Child, element

WIDTH, HEIGHT = 360, 200
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 30, 40
"""Room around the bars [pixel]."""
BINS = 20
PAPER, INK, FAINT, BAR = "#ffffff", "#1d2328", "#5b656e", "#31688e"
AXIS_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
"""Steps of an axis, times powers of ten."""


def histogram(
    values: Sequence[float], title: str, unit: str, *, limits: tuple[float, float] | None = None
) -> str:
    """How values are distributed.

    Args:
        values: in the unit to show.
        title: above the bars.
        unit: below them.
        limits: of the axis; those of the values if None.

    Returns:
        An SVG document.
    """
    data = np.asarray(values, dtype=float)
    edges = _edges(data, limits)
    counts = np.histogram(data, edges)[0]
    labels = _ticks(float(edges[0]), float(edges[-1]))
    places = [(x - edges[0]) / (edges[-1] - edges[0]) for x in labels]
    return _chart(counts, title, unit, list(zip(places, labels, strict=True)))


def bars_of_counts(values: Sequence[int], title: str, unit: str) -> str:
    """How often each whole number occurs: a bar for each from 0 to the largest.

    Returns:
        An SVG document.
    """
    counts = np.bincount(np.asarray(values, dtype=int), minlength=2)
    step = 1 + (len(counts) - 1) // 12
    ticks = [((k + 0.5) / len(counts), float(k)) for k in range(0, len(counts), step)]
    return _chart(counts, title, unit, ticks)


def _edges(data: Array, limits: tuple[float, float] | None) -> Array:
    if limits is not None:
        lower, upper = limits
    elif data.size:
        lower, upper = float(data.min()), float(data.max())
    else:
        lower, upper = 0.0, 1.0
    if upper - lower < 1e-9:
        lower, upper = lower - 0.5, upper + 0.5
    return np.linspace(lower, upper, BINS + 1)


def _ticks(lower: float, upper: float, most: int = 6) -> list[float]:
    """Round numbers between two limits."""
    power = 10.0 ** np.floor(np.log10((upper - lower) / most))
    step = next(n * power for n in AXIS_STEPS if (upper - lower) / (n * power) <= most)
    first, last = int(np.ceil(lower / step - 1e-9)), int(np.floor(upper / step + 1e-9))
    return [float(k * step) for k in range(first, last + 1)]


def _chart(counts: Indices, title: str, unit: str, ticks: list[tuple[float, float]]) -> str:
    """Bars, with ticks at shares of the axis."""
    inner, tall = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    most = max(1, int(counts.max(initial=0)))
    parts: list[Child] = [element("rect", width=WIDTH, height=HEIGHT, fill=PAPER)]
    parts.append(_text(LEFT, 18, title, size=13, color=INK, weight="bold"))
    for k, count in enumerate(counts.tolist()):
        high = tall * count / most
        x = LEFT + inner * k / len(counts)
        box = {"x": round(x + 0.5, 2), "y": round(TOP + tall - high, 2)}
        size = {"width": round(inner / len(counts) - 1.0, 2), "height": round(high, 2)}
        parts.append(element("rect", **box, **size, fill=BAR))
    base = TOP + tall
    ends = {"x1": LEFT, "x2": LEFT + inner, "y1": base, "y2": base}
    parts.append(element("line", **ends, stroke=FAINT))
    for share, value in ticks:
        parts.append(_text(LEFT + inner * share, base + 15, f"{value:g}", anchor="middle"))
    parts.append(_text(LEFT + inner / 2, HEIGHT - 8, unit, anchor="middle"))
    parts.append(_text(LEFT - 6, TOP + 8, f"{most:,}", anchor="end"))
    parts.append(_text(LEFT - 6, base, "0", anchor="end"))
    return str(
        element(
            "svg",
            *parts,
            xmlns="http://www.w3.org/2000/svg",
            width=WIDTH,
            height=HEIGHT,
            viewBox=f"0 0 {WIDTH} {HEIGHT}",
            font_family="system-ui, sans-serif",
        )
    )


def _text(
    x: float,
    y: float,
    text: str,
    *,
    size: int = 11,
    color: str = FAINT,
    anchor: str = "start",
    weight: str | None = None,
) -> Child:
    return element(
        "text",
        text,
        x=round(x, 2),
        y=round(y, 2),
        fill=color,
        font_size=size,
        font_weight=weight,
        text_anchor=anchor,
    )
