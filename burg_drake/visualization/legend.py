"""Legends of pages: switches for groups of one colour, and colour bars for numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from burg_drake.visualization.html_page import (
    Html,
    element,
    svg_line,
    svg_rectangle,
    svg_text,
)

BAR_WIDTH = 256  # Width of a colour bar, in pixels.
HISTOGRAM_HEIGHT = 34  # Height of the histogram above a colour bar, in pixels.
BAR_MARGIN = 14
"""Pixels beside a colour bar, for the numbers at its ends."""


@dataclass(frozen=True)
class LegendEntry:
    """A line of the legend that shows and hides what it names.

    Attributes:
        label: what the colour stands for.
        color: CSS colour.
        paths: Meshcat paths that the entry shows and hides.
        shown: whether the paths are visible when the page is opened; if not, the caller hides them.
    """

    label: str
    color: str
    paths: tuple[str, ...] = ()
    shown: bool = True


@dataclass(frozen=True)
class ColorBar:
    """Colour bar of a number below its histogram, with a selection of the visible range.

    Attributes:
        title: name of the number.
        colors: CSS colours of the bins, lowest first.
        counts: counts of the bins.
        ticks: positions along the bar, rising from 0 to 1, and their texts; texts without room are
            left out, except at the ends.
        paths: Meshcat path of each bin.
        note: text below the bar.
    """

    title: str
    colors: tuple[str, ...]
    counts: tuple[int, ...]
    ticks: tuple[tuple[float, str], ...]
    paths: tuple[str, ...]
    note: str = ""

    width = BAR_WIDTH
    margin = BAR_MARGIN

    def picture(self) -> Html:
        """The bar, below the histogram, with its ticks, as SVG."""
        bar_height = 12  # Pixels.
        step = BAR_WIDTH / len(self.colors)
        most = max(1, *self.counts)
        shapes = []
        for k, (color, count) in enumerate(zip(self.colors, self.counts, strict=True)):
            high = HISTOGRAM_HEIGHT * count / most
            x = BAR_MARGIN + k * step
            shapes += [
                svg_rectangle(x, HISTOGRAM_HEIGHT - high, step, high, fill=color),
                svg_rectangle(x, HISTOGRAM_HEIGHT + 2, step, bar_height, fill=color),
            ]
        foot = HISTOGRAM_HEIGHT + 2 + bar_height
        for place, text in _ticks_with_room(self.ticks):
            x = round(BAR_MARGIN + place * BAR_WIDTH, 1)
            shapes.append(svg_line(x, foot, x, foot + 4))
            anchor = {0.0: "text-anchor: start", 1.0: "text-anchor: end"}.get(place)
            shapes.append(svg_text(text, x, foot + 15, style=anchor))
        width, rendering = BAR_WIDTH + 2 * BAR_MARGIN, "crispEdges"
        view = f"0 0 {width} {foot + 19}"
        return element("svg", *shapes, viewBox=view, width=width, shape_rendering=rendering)


def _ticks_with_room(ticks: Sequence[tuple[float, str]]) -> list[tuple[float, str]]:
    """Both end ticks of a bar, whose texts extend inwards, and the ticks that fit between them."""
    character_width = 7  # Pixels, of the widest character, and the least gap between two texts.
    first, *inner, last = ticks
    kept = [first]
    end = float(character_width * len(first[1]))
    for place, text in inner:
        middle, half = place * BAR_WIDTH, character_width * len(text) / 2
        limit = BAR_WIDTH - character_width * len(last[1])
        if middle - half >= end + character_width and middle + half + character_width <= limit:
            kept.append((place, text))
            end = middle + half
    return [*kept, last]
