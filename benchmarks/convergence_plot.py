"""The picture of the convergence study: an SVG that reads on light and dark pages."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

WIDTH, HEIGHT, GAP = 250, 230, 34
LEFT, TOP, BOTTOM, RIGHT = 46, 64, 50, 14
LOW, HIGH = 0.9, 1.3
"""Range of the ratios that are drawn; beyond it, an open mark at the edge tells the value."""
RADII = {"payload": 6.0}
"""Of marks that others would hide."""
NAMES = {
    "payload": "payload that friction holds",
    "sliding": "force of sliding pads",
    "torsion": "torsion that friction holds",
    "patch": "patch area on a ball",
}
STYLE = """
svg { font: 12px system-ui, sans-serif; }
text { fill: #333; } .faint { fill: #777; } .title { font-weight: 600; }
.page { fill: #fff; } .grid { stroke: #ddd; } .one { stroke: #888; stroke-dasharray: 4 3; }
.used { fill: #f1f1f1; } .line { fill: none; stroke-width: 2; }
.payload { stroke: #0072b2; } .sliding { stroke: #009e73; } .torsion { stroke: #d55e00; }
.patch { stroke: #aa4499; } .mark { stroke-width: 2; }
.mark.payload { fill: #0072b2; } .mark.sliding { fill: #009e73; }
.mark.torsion { fill: #d55e00; } .mark.patch { fill: #aa4499; } .mark.open { fill: #fff; }
@media (prefers-color-scheme: dark) {
  text { fill: #ddd; } .faint { fill: #999; } .page { fill: #161616; } .grid { stroke: #383838; }
  .one { stroke: #888; } .used { fill: #242424; }
  .payload { stroke: #56b4e9; } .sliding { stroke: #2cc295; } .torsion { stroke: #f0823c; }
  .patch { stroke: #d98cc8; } .mark.payload { fill: #56b4e9; } .mark.sliding { fill: #2cc295; }
  .mark.torsion { fill: #f0823c; } .mark.patch { fill: #d98cc8; } .mark.open { fill: #161616; }
}
"""


@dataclass(frozen=True)
class Panel:
    """One axis.

    Attributes:
        title: what is varied.
        labels: its values.
        series: ratios to the closed form by quantity, one a label.
        used: index of the value that the package uses, if it is among them.
    """

    title: str
    labels: Sequence[str]
    series: Mapping[str, Sequence[float]]
    used: int | None


def plot(panels: Sequence[Panel]) -> str:
    """The SVG's text."""
    width = LEFT + len(panels) * (WIDTH + GAP) - GAP + RIGHT
    height = TOP + HEIGHT + BOTTOM
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img"'
        ' aria-label="Simulated quantities over their closed forms">',
        f"<style>{STYLE}</style>",
        f'<rect class="page" width="{width}" height="{height}"/>',
        '<text class="title" x="12" y="22">Simulated / closed form <tspan class="faint"'
        ' font-weight="400">(shaded: as in the package)</tspan></text>',
        *legend(),
    ]
    for i, panel in enumerate(panels):
        parts += [f'<g transform="translate({LEFT + i * (WIDTH + GAP)},{TOP})">', *drawn(panel, i)]
        parts.append("</g>")
    return "\n".join([*parts, "</svg>"]) + "\n"


def legend() -> Iterator[str]:
    """Colours and what they stand for, in a row."""
    x = 12.0
    for name, text in NAMES.items():
        yield f'<line class="line {name}" x1="{x}" x2="{x + 20}" y1="42" y2="42"/>'
        yield mark(name, x + 10, 42, inside=True)
        yield f'<text x="{x + 27}" y="46">{text}</text>'
        x += 27 + 6.6 * len(text) + 22


def drawn(panel: Panel, index: int) -> Iterator[str]:
    """Axis, lines and marks of a panel."""
    step = WIDTH / len(panel.labels)
    xs = [(i + 0.5) * step for i in range(len(panel.labels))]
    if panel.used is not None:
        yield (
            f'<rect class="used" x="{panel.used * step:.1f}" width="{step:.1f}"'
            f' height="{HEIGHT}"><title>as in the package</title></rect>'
        )
    for tick in (0.9, 1.0, 1.1, 1.2, 1.3):
        kind = "one" if tick == 1.0 else "grid"
        yield f'<line class="{kind}" x1="0" x2="{WIDTH}" y1="{y(tick)}" y2="{y(tick)}"/>'
        if index == 0:
            at = y(tick) + 4
            yield f'<text class="faint" x="-8" y="{at}" text-anchor="end">{tick:.1f}</text>'
    for x, label in zip(xs, panel.labels, strict=True):
        yield f'<text x="{x:.1f}" y="{HEIGHT + 18}" text-anchor="middle">{label}</text>'
    yield (
        f'<text class="title" x="{WIDTH / 2}" y="{HEIGHT + 38}" text-anchor="middle">'
        f"{panel.title}</text>"
    )
    for name, values in panel.series.items():
        known = [(x, v) for x, v in zip(xs, values, strict=True) if not math.isnan(v)]
        points = " ".join(f"{x:.1f},{y(v):.1f}" for x, v in known)
        yield f'<polyline class="line {name}" points="{points}"/>'
        for x, value in known:
            inside = LOW <= value <= HIGH
            yield mark(name, x, y(value), inside=inside, tip=f"{value:.3f}")
            if not inside:
                at = y(value) + (4 if value > HIGH else -6)
                yield f'<text x="{x + 9:.1f}" y="{at}">{value:.2f}</text>'


def mark(name: str, x: float, at: float, *, inside: bool, tip: str = "") -> str:
    """A dot, open where the value is beyond the axis."""
    kind = name if inside else f"{name} open"
    title = f"<title>{tip}</title>" if tip else ""
    radius = RADII.get(name, 4.0)
    return f'<circle class="mark {kind}" cx="{x:.1f}" cy="{at:.1f}" r="{radius}">{title}</circle>'


def y(value: float) -> float:
    """Height of a ratio in the panel."""
    share = (min(max(value, LOW), HIGH) - LOW) / (HIGH - LOW)
    return round(HEIGHT * (1 - share), 1)
