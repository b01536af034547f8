"""Legends of views in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.text import Text

    from burg_drake.visualization.style import ColorBar, LegendEntry

CELLS = 2
"""Columns of the terminal that a bin of a colour bar takes."""
LEVELS = " ▁▂▃▄▅▆▇█"


def print_legend(legend: Sequence[LegendEntry | ColorBar]) -> None:
    """Prints what colours stand for; of numbers their histogram, the bar and its numbers."""
    from rich.console import Console
    from rich.text import Text

    from burg_drake.visualization.style import ColorBar

    console = Console()
    for entry in legend:
        if isinstance(entry, ColorBar):
            for line in _bar(entry, with_colors=console.color_system is not None):
                console.print(line, no_wrap=True, crop=False, overflow="ignore")
        else:
            console.print(Text("■ ", style=entry.color) + Text(entry.label, style="default"))


def _bar(bar: ColorBar, with_colors: bool) -> list[Text]:
    from rich.text import Text

    most = max(1, *bar.counts)
    levels = [-(-count * (len(LEVELS) - 1) // most) for count in bar.counts]  # rounded up
    histogram, colors = Text(), Text()
    for level, color in zip(levels, bar.colors, strict=True):
        histogram.append(LEVELS[level] * CELLS, style=color)
        colors.append("█" * CELLS, style=color)
    lines = [Text(bar.title), histogram, *([colors] if with_colors else [])]
    lines.append(Text(tick_line(bar.ticks, CELLS * len(bar.colors))))
    return [*lines, Text(bar.note)] if bar.note else lines


def tick_line(ticks: Sequence[tuple[float, str]], width: int) -> str:
    """Numbers below a bar of `width` columns, each below its place, as far as there is room.

    Args:
        ticks: places along the bar in [0, 1], rising, and texts; the first and last one stay.
    """
    (_, first), *inner, (_, last) = ticks
    line = first
    end = width - len(last)
    for place, text in inner:
        start = round(place * width - len(text) / 2)
        if start > len(line) and start + len(text) < end:
            line = line.ljust(start) + text
    return line.ljust(max(end, len(line) + 1)) + last
