"""The report's section on the scenes of a run over many: their spread, the worst ones, all."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from burg_drake.core.terminal import format_count, format_percent
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    command,
    element,
    section,
    table,
)
from burg_drake.evaluation.report.sections.outcomes import HEAD, group_row, worst_first
from burg_drake.evaluation.results import OutcomeCounts

WORST = 20
"""So many scenes are shown with their outcomes."""
LISTED = 2000
"""So many scenes are listed."""
NAMED = 200
"""Dots of so many scenes tell their names."""
WIDTH, HEIGHT = 480, 190
LEFT, RIGHT, TOP, BOTTOM = 44, 6, 8, 26
"""Size and margins of the chart of all scenes in SVG units."""


def scenes_section(
    scenes: Sequence[OutcomeCounts],
    link: Callable[[str], str | None],
    drill_down: Callable[[str], str],
) -> Html:
    """Success over scenes, worst first.

    Args:
        scenes: in the order of the run.
        link: where the report of a scene is, from the page; None if it has none.
        drill_down: the command that makes the report of a scene.
    """
    ranked = worst_first(scenes)
    shown = ranked[:WORST]
    rows = [group_row(group, name=_name(group.name, link)) for group in shown]
    how: list[Child] = []
    if any(link(group.name) is None for group in ranked):
        how = [element("p", "This command writes the report of one scene:", class_="note")]
        how.append(command(drill_down(ranked[0].name)))
    text = (
        "Success when executed in each scene with its 95 % interval, worst scene first."
        " Scenes in which nothing was executed come first and have no dot."
    )
    more = f" Below are the {WORST} worst." if len(ranked) > WORST else ""
    return section(
        "Outcomes by scene",
        text + more,
        ranked_chart(ranked),
        table(["scene", *HEAD], rows, numbers=(1, 3), style="stacking"),
        *how,
        _all(ranked, link) if len(ranked) > WORST else None,
    )


def ranked_chart(ranked: Sequence[OutcomeCounts]) -> Html:
    """A dot with its interval for each scene, from the worst on the left to the best."""
    step = (WIDTH - LEFT - RIGHT) / max(len(ranked), 1)
    places = [LEFT + (k + 0.5) * step for k in range(len(ranked))]
    tried = [(x, group) for x, group in zip(places, ranked, strict=True) if group.executed]
    whiskers = "".join(
        f"M{x:.1f} {_y(group.interval[0]):.1f}V{_y(group.interval[1]):.1f}" for x, group in tried
    )
    marks: list[Child] = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = f"{_y(share):.1f}"
        marks.append(element("line", x1=LEFT, x2=WIDTH - RIGHT, y1=y, y2=y, class_="grid"))
        text = f"{100 * share:.0f} %"
        marks.append(element("text", text, x=LEFT - 6, y=y, dy="0.35em", class_="end"))
    label = f"{format_count(len(ranked))} scenes, worst to best"
    width = f"stroke-width:{min(max(0.5 * step, 0.5), 2.5):.2f}"
    return element(
        "svg",
        *marks,
        element("path", d=whiskers, class_="whiskers", style=width) if whiskers else None,
        *_dots(tried, step),
        element("text", label, x=LEFT, y=HEIGHT - 6, class_="title"),
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        class_="histogram ranked",
        role="img",
        aria_label=f"Success when executed of {_spoken(ranked)}",
    )


def _dots(tried: Sequence[tuple[float, OutcomeCounts]], step: float) -> list[Html]:
    radius = min(max(0.35 * step, 0.8), 3.2)
    dots = []
    for x, group in tried:
        share = group.lifted / group.executed
        tip = f"{group.name}: {group.lifted} of {group.executed}, {format_percent(share)}"
        name = element("title", tip) if len(tried) <= NAMED else None
        place = {"cx": f"{x:.1f}", "cy": f"{_y(share):.1f}", "r": f"{radius:.1f}"}
        dots.append(element("circle", *([name] if name else []), **place, class_="dot"))
    return dots


def _spoken(ranked: Sequence[OutcomeCounts]) -> str:
    shares = [group.lifted / group.executed for group in ranked if group.executed]
    if not shares:
        return f"{len(ranked)} scenes: nothing was executed"
    return (
        f"{len(ranked)} scenes: from {format_percent(min(shares))} to {format_percent(max(shares))}"
    )


def _y(share: float) -> float:
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * share


def _name(name: str, link: Callable[[str], str | None]) -> Child:
    target = link(name)
    return name if target is None else element("a", name, href=target)


def _all(ranked: Sequence[OutcomeCounts], link: Callable[[str], str | None]) -> Html:
    rows = []
    for group in ranked[:LISTED]:
        low, high = (f"{100 * bound:.0f}" for bound in group.interval)
        share = format_percent(group.lifted / group.executed) if group.executed else "-"
        interval = f"{low} to {high} %" if group.executed else "-"
        cells = (
            format_count(group.judged),
            format_count(group.executed),
            format_count(group.lifted),
            share,
            interval,
        )
        numbers = (element("td", cell, class_="number") for cell in cells)
        name = element("th", _name(group.name, link), scope="row")
        rows.append(element("tr", name, *numbers))
    head = ["scene", "grasps", "executed", "lifted", "success", "95 % interval"]
    title = f"All {format_count(len(ranked))} scenes"
    if len(ranked) > LISTED:
        title = f"The {format_count(LISTED)} worst of {format_count(len(ranked))} scenes"
    summary = element("summary", element("h3", title))
    listed = table(head, rows, numbers=(1, 2, 3, 4, 5))
    return element("details", summary, listed, class_="screen")
