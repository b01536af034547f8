"""The reliability diagram: how often verdicts were confirmed, by their confidence."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from confidence_fit import Judged, Verdicts, summarize_bin

WIDTH, HEIGHT, GAP = 290, 290, 40
LEFT, TOP, BOTTOM, RIGHT = 48, 62, 66, 16
TICKS = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99)
LOW, HIGH = 0.4, 0.997
"""Range that is drawn; what is beyond is at the edge."""
EDGES = (0.8, 0.9, 0.95, 0.98)
"""Of confidence, between the bins."""
SHOWN = ("standard", "mujoco")
"""Engines with a panel."""
STYLE = """
svg { font: 12px system-ui, sans-serif; }
text { fill: #333; } .faint { fill: #777; } .title { font-weight: 600; }
.page { fill: #fff; } .grid { stroke: #e3e3e3; } .one { stroke: #888; stroke-dasharray: 4 3; }
.whisker { stroke: #0072b2; stroke-width: 1.5; } .mark { fill: #0072b2; }
@media (prefers-color-scheme: dark) {
  text { fill: #ddd; } .faint { fill: #999; } .page { fill: #161616; } .grid { stroke: #333; }
  .whisker { stroke: #56b4e9; } .mark { fill: #56b4e9; }
}
"""


def reliability_diagram(verdicts: Verdicts) -> str:
    """The SVG's text: a panel for each engine, of the objects that were held out.

    Args:
        verdicts: by engine.
    """
    engines = [engine for engine in SHOWN if engine in verdicts]
    width = LEFT + len(SHOWN) * (WIDTH + GAP) - GAP + RIGHT
    height = TOP + HEIGHT + BOTTOM
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img"'
        ' aria-label="Reliability diagram of confidence">',
        f"<style>{STYLE}</style>",
        f'<rect class="page" width="{width}" height="{height}"/>',
        _text(LEFT, 22, "Verdicts that the independent model confirms, by confidence", "title"),
    ]
    for k, engine in enumerate(engines):
        mine = [v for v in verdicts[engine] if v.held_out]
        parts += _panel(LEFT + k * (WIDTH + GAP), mine, engine)
    return "\n".join([*parts, "</svg>\n"])


def _panel(left: float, verdicts: Sequence[Judged], engine: str) -> Iterator[str]:
    """One panel."""
    objects = len({v.object for v in verdicts})
    title = f"engine {engine}: {len(verdicts)} grasps, {objects} objects held out"
    yield _text(left, 46, title, "faint")
    for tick in TICKS:
        x, y = left + _place(tick) * WIDTH, TOP + (1.0 - _place(tick)) * HEIGHT
        yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{TOP + HEIGHT}"/>'
        yield f'<line class="grid" x1="{left}" x2="{left + WIDTH}" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield _text(x, TOP + HEIGHT + 17, f"{tick:g}", "faint", "middle")
        yield _text(left - 6, y + 4, f"{tick:g}", "faint", "end")
    yield (f'<line class="one" x1="{left}" y1="{TOP + HEIGHT}" x2="{left + WIDTH}" y2="{TOP}"/>')
    place = np.searchsorted(EDGES, [v.confidence for v in verdicts])
    for k in np.unique(place).tolist():
        one = summarize_bin([v for v, own in zip(verdicts, place, strict=True) if own == k])
        x = left + _place(one.said) * WIDTH
        y, y0, y1 = (TOP + (1.0 - _place(v)) * HEIGHT for v in (one.confirmed, one.low, one.high))
        yield f'<line class="whisker" x1="{x:.1f}" x2="{x:.1f}" y1="{y0:.1f}" y2="{y1:.1f}"/>'
        tip = f"said {one.said:.3f}, confirmed {one.confirmed:.3f} of {one.count}"
        yield f'<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="4"><title>{tip}</title></circle>'
    yield _text(left + WIDTH / 2, TOP + HEIGHT + 38, "confidence", "", "middle")
    yield _text(left + WIDTH / 2, TOP + HEIGHT + 56, "95 % intervals, Wilson's", "faint", "middle")


def _place(share: float) -> float:
    """Where a share is on an axis, 0 to 1: by the logarithm of what it lacks to 1."""
    low, high = math.log(1.0 - LOW), math.log(1.0 - HIGH)
    return (math.log(1.0 - min(max(share, LOW), HIGH)) - low) / (high - low)


def _text(x: float, y: float, words: str, style: str, anchor: str = "start") -> str:
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{words}</text>'
