"""Legends of pages: switches for groups of one colour, and colour bars for numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from burg_drake.visualization.html_page import Html, element, join

BAR_WIDTH = 256  # Width of a colour bar, in pixels.
HISTOGRAM_HEIGHT = 34  # Height of the histogram above a colour bar, in pixels.
BAR_MARGIN = 14
"""Pixels beside a colour bar, for the numbers at its ends."""


@dataclass(frozen=True)
class LegendEntry:
    """A line of the legend that switches what it names on and off.

    Attributes:
        label: what the colour stands for.
        color: as CSS has it.
        paths: Meshcat paths that the entry shows and hides.
        shown: whether they are shown when the page is opened; who draws them hides them if not.
    """

    label: str
    color: str
    paths: tuple[str, ...] = ()
    shown: bool = True

    def html(self) -> Html:
        """The line."""
        checked = "" if self.shown else None
        return element(
            "label",
            element("input", type="checkbox", checked=checked, data_paths=" ".join(self.paths)),
            element("i", style=f"background:{self.color}"),
            self.label,
        )


@dataclass(frozen=True)
class ColorBar:
    """What the colours of numbers stand for: a bar below their histogram, and which part is shown.

    Attributes:
        title: what the numbers are.
        colors: of the bins, lowest first, as CSS has them.
        counts: of the bins.
        ticks: places along the bar in [0, 1], rising from 0 to 1, and what is written there; left
            out where a picture has no room for it, except at the ends.
        paths: Meshcat path of each bin.
        note: below the bar.
    """

    title: str
    colors: tuple[str, ...]
    counts: tuple[int, ...]
    ticks: tuple[tuple[float, str], ...]
    paths: tuple[str, ...]
    note: str = ""

    def html(self) -> Html:
        """The bar, with two sliders that hide what is below and above them."""
        n = len(self.colors)
        limits = [
            element("input", type="range", min=0, max=n, value=value, aria_label=f"{end} shown")
            for end, value in (("lowest", 0), ("highest", n))
        ]
        return element(
            "div",
            element("p", self.title, class_="title"),
            self._picture(),
            element("div", *limits, class_="limits"),
            element("p", self.note) if self.note else None,
            class_="bar",
            data_paths=" ".join(self.paths),
        )

    def _picture(self) -> Html:
        bar_height = 12  # Pixels.
        step = BAR_WIDTH / len(self.colors)
        most = max(1, *self.counts)
        shapes = []
        for k, (color, count) in enumerate(zip(self.colors, self.counts, strict=True)):
            high = HISTOGRAM_HEIGHT * count / most
            x = BAR_MARGIN + k * step
            shapes += [
                _rectangle(x, HISTOGRAM_HEIGHT - high, step, high, color),
                _rectangle(x, HISTOGRAM_HEIGHT + 2, step, bar_height, color),
            ]
        foot = HISTOGRAM_HEIGHT + 2 + bar_height
        for place, text in _ticks_with_room(self.ticks):
            at = f"{BAR_MARGIN + place * BAR_WIDTH:.1f}"
            shapes.append(element("line", x1=at, x2=at, y1=foot, y2=foot + 4))
            anchor = {0.0: "text-anchor: start", 1.0: "text-anchor: end"}.get(place)
            shapes.append(element("text", text, x=at, y=foot + 15, style=anchor))
        width, rendering = BAR_WIDTH + 2 * BAR_MARGIN, "crispEdges"
        view = f"0 0 {width} {foot + 19}"
        return element("svg", *shapes, viewBox=view, width=width, shape_rendering=rendering)


def _ticks_with_room(ticks: Sequence[tuple[float, str]]) -> list[tuple[float, str]]:
    """The ends of a bar, whose texts reach inwards, and the ticks that fit between them."""
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


def legend_html(legend: Sequence[LegendEntry | ColorBar]) -> Html:
    """All entries, one below the other."""
    return join(*(entry.html() for entry in legend))


def _rectangle(x: float, y: float, width: float, height: float, color: str) -> Html:
    place = {"x": f"{x:.2f}", "y": f"{y:.2f}"}
    size = {"width": f"{width:.2f}", "height": f"{height:.2f}"}
    return element("rect", **place, **size, fill=color)


LEGEND_STYLE = f"""
#burg .bar .title {{ margin-top: 6px; }}
#burg .bar svg {{ display: block; margin: 4px 0 0 -{BAR_MARGIN}px; overflow: visible; }}
#burg .bar text {{ font-size: 11px; text-anchor: middle; fill: #444; }}
#burg .bar line {{ stroke: #777; }}
#burg .bar .limits {{ position: relative; width: {BAR_WIDTH}px; height: 18px; }}
#burg .bar .limits input {{ position: absolute; left: -6px; top: 0; width: {BAR_WIDTH + 11}px;
  margin: 0; background: none; appearance: none; pointer-events: none; height: 18px; }}
#burg .bar .limits input::-webkit-slider-thumb {{ pointer-events: auto; appearance: none;
  width: 9px; height: 16px; border: 1px solid #777; border-radius: 3px; background: #fff; }}
#burg .bar .limits input::-moz-range-thumb {{ pointer-events: auto;
  width: 9px; height: 16px; border: 1px solid #777; border-radius: 3px; background: #fff; }}
"""

LEGEND_SCRIPT = """
function show(path, visible) {
  viewer.set_property(path.split("/").filter(Boolean), "visible", visible);
}
for (const box of document.querySelectorAll("#burg label input")) {
  box.addEventListener("change", () => {
    for (const path of box.dataset.paths.split(" ").filter(Boolean)) show(path, box.checked);
  });
}
for (const bar of document.querySelectorAll("#burg .bar")) {
  const paths = bar.dataset.paths.split(" ");
  const [low, high] = bar.querySelectorAll(".limits input");
  for (const end of [low, high]) {
    end.addEventListener("input", () => {
      if (+low.value >= +high.value) end.value = end === low ? +high.value - 1 : +low.value + 1;
      paths.forEach((path, k) => show(path, k >= +low.value && k < +high.value));
    });
  }
}
"""
