"""How grasps flow from outcome to outcome: columns of steps, and bands between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.report.elements import STYLES
from burg_drake.visualization.style import GROUPS, Html, element, group_of

WIDTH, HEIGHT = 1000, 430
TOP, RIGHT, NODE, GAP = 34, 190, 14, 19
"""Size in SVG units; room for heads and for the last column's names, width of a node, and room
between nodes, in which a name fits."""
STYLE = """
.flow { width: 100%; min-width: 680px; height: auto; }
.flow text { font-size: 13px; fill: var(--ink); paint-order: stroke; stroke: var(--paper);
  stroke-width: 3px; stroke-linejoin: round; }
.flow .head { font-weight: 600; font-size: 14px; }
.flow path { opacity: 0.38; }
.scroll + .scroll { margin-top: 20px; }
"""
Flow = Counter[tuple[Outcome, Outcome]]


@dataclass(frozen=True)
class FlowColumn:
    """A step.

    Attributes:
        title: its name.
        counts: grasps by outcome.
    """

    title: str
    counts: Counter[Outcome]


def flow_chart(
    columns: Sequence[FlowColumn], flows: Sequence[Flow], scale: Sequence[float]
) -> Html:
    """The chart.

    Args:
        columns: one a step.
        flows: between a column and the next; what is in no flow ends there.
        scale: grasps that one of each column's counts stands for, such as 1/5 where each grasp was
            judged in five scenes.
    """
    whole = max((c.counts.total() * s for c, s in zip(columns, scale, strict=True)), default=1.0)
    rows = max(len(_groups(column)) for column in columns)
    unit = (HEIGHT - TOP - GAP * rows) / max(whole, 1e-9)
    step = (WIDTH - RIGHT - NODE) / max(len(columns) - 1, 1)
    places = [_places(c, s * unit) for c, s in zip(columns, scale, strict=True)]
    bands: list[Html] = []
    for k, flow in enumerate(flows):
        bands += _bands(flow, places[k], places[k + 1], k * step, step, scale[k + 1] * unit)
    nodes = [
        part
        for k, column in enumerate(columns)
        for part in _nodes(column, places[k], k * step, scale[k] * unit)
    ]
    return element(
        "svg",
        *bands,
        *nodes,
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        class_="flow",
        role="img",
        aria_label="Flow of grasps between outcomes; the tables below have the numbers",
    )


def _groups(column: FlowColumn) -> dict[str, int]:
    found = {g.name: sum(column.counts[o] for o in g.outcomes) for g in GROUPS}
    return {name: count for name, count in found.items() if count}


def _places(column: FlowColumn, unit: float) -> dict[str, float]:
    """Upper edge of each group's node."""
    y, places = float(TOP), {}
    for name, count in _groups(column).items():
        places[name] = y
        y += count * unit + GAP
    return places


def _nodes(column: FlowColumn, places: dict[str, float], x: float, unit: float) -> list[Html]:
    parts = [element("text", column.title, x=f"{x:.1f}", y=16, class_="head")]
    for name, count in _groups(column).items():
        height = max(count * unit, 1.0)
        tip = element("title", f"{count} {name}")
        y = places[name]
        parts.append(
            element(
                *("rect", tip),
                x=f"{x:.1f}",
                y=f"{y:.1f}",
                width=NODE,
                height=f"{height:.1f}",
                class_=STYLES[name],
            )
        )
        middle = f"{y + height / 2 + 4.5:.1f}"
        parts.append(element("text", f"{count} {name}", x=f"{x + NODE + 6:.1f}", y=middle))
    return parts


def _bands(
    flow: Flow,
    before: dict[str, float],
    after: dict[str, float],
    x: float,
    step: float,
    unit: float,
) -> list[Html]:
    pairs: Counter[tuple[str, str]] = Counter()
    for (a, b), count in flow.items():
        pairs[group_of(a).name, group_of(b).name] += count
    starts, ends = dict(before), dict(after)
    order = [group.name for group in GROUPS]
    parts = []
    for pair in sorted(pairs, key=lambda pair: (order.index(pair[0]), order.index(pair[1]))):
        first, second = pair
        thick = pairs[pair] * unit
        tip = element("title", f"{pairs[pair]}: {first} → {second}")
        shape = _band(x + NODE, starts[first], x + step, ends[second], thick)
        parts.append(element("path", tip, d=shape, class_=STYLES[second]))
        starts[first] += thick
        ends[second] += thick
    return parts


def _band(x0: float, y0: float, x1: float, y1: float, thick: float) -> str:
    middle = (x0 + x1) / 2
    return (
        f"M{x0:.1f},{y0:.1f}C{middle:.1f},{y0:.1f} {middle:.1f},{y1:.1f} {x1:.1f},{y1:.1f}"
        f"V{y1 + thick:.1f}C{middle:.1f},{y1 + thick:.1f} {middle:.1f},{y0 + thick:.1f}"
        f" {x0:.1f},{y0 + thick:.1f}Z"
    )
