"""Sections of the report about counts: outcomes by object, stages, cost."""

from __future__ import annotations

from collections.abc import Sequence

from burg_drake.core.grasps import Outcome, Stage
from burg_drake.core.terminal import (
    format_count as number,
    format_duration,
    format_number,
    format_percent,
)
from burg_drake.evaluation.report.elements import (
    STYLES,
    BarPart,
    Child,
    Html,
    element,
    folded,
    interval_mark,
    join,
    legend,
    section,
    stacked_bar,
    table,
)
from burg_drake.evaluation.results import OutcomeCounts, Summary
from burg_drake.visualization.style import GROUPS

FAILED = Outcome.SIMULATION_FAILED
LOST = {stage: tuple(o for o in Outcome if o.stage is stage and o is not FAILED) for stage in Stage}
STOPPED = {
    "clear": LOST[Stage.CLEAR],
    "reachable": LOST[Stage.REACHABLE],
    "planned": LOST[Stage.PLANNED],
    "executed": (FAILED,),
    "held": tuple(o for o in LOST[Stage.EXECUTED] if not o.held),
    "lifted": (Outcome.LIFTED_DISTURBED, Outcome.LIFTED_TURNED),
}
"""What stops a grasp on its way to each step of the funnel."""


HEAD = ("grasps", "outcomes", "lifted / executed", "share with 95 % interval")
"""Columns of `group_row` behind the name."""
OBJECTS = 40
"""Of more objects, the worst ones are shown."""


def objects_section(summary: Summary) -> Html:
    """Stacked outcomes and success share of each object."""
    head, objects = ["object", *HEAD], list(summary.objects)
    more = ""
    if len(objects) > OBJECTS:
        objects = worst_first(objects)[:OBJECTS]
        more = f" The {OBJECTS} of {len(summary.objects)} objects with the lowest shares are shown."
    rows = [group_row(group) for group in objects]
    if len(objects) > 1:
        rows.append(group_row(summary.total, "total"))
    present = [g for g in GROUPS if any(summary.total.outcomes[o] for o in g.outcomes)]
    return section(
        "Outcomes by object",
        f"How all grasps ended. Shares count only executed grasps.{more}",
        table(head, rows, numbers=(1, 3), style="stacking"),
        legend([(STYLES[g.name], g.name) for g in present]),
        *(element("p", note, class_="notice") for note in summary.notes),
        *([element("p", str(summary.lifts))] if summary.lifts else []),
    )


def worst_first(groups: Sequence[OutcomeCounts]) -> list[OutcomeCounts]:
    """Groups by their success when executed; those of which nothing was executed come first, and
    of equal shares those that are less certain."""

    def rank(group: OutcomeCounts) -> tuple[float, float]:
        return (group.lifted / group.executed if group.executed else -1.0), group.interval[0]

    return sorted(groups, key=rank)


def group_row(group: OutcomeCounts, style: str = "", name: Child = None) -> Html:
    """Grasps of an object, a scene or all, in a row under `HEAD`.

    Args:
        group: to show.
        style: CSS class.
        name: in place of the group's own.
    """
    parts = []
    for outcomes in GROUPS:
        inside = {o: group.outcomes[o] for o in outcomes.outcomes if group.outcomes[o]}
        detail = ", ".join(f"{count} {label(o)}" for o, count in inside.items())
        tip = f"{outcomes.name}: {detail}"
        parts.append(BarPart(sum(inside.values()), STYLES[outcomes.name], tip))
    share: Child = element("span", "nothing executed", class_="faint")
    if group.executed:
        mark = interval_mark(group.lifted / group.executed, *group.interval)
        share = join(mark, f" {format_percent(group.lifted / group.executed)}")
    return element(
        "tr",
        element("th", group.name if name is None else name, scope="row"),
        element("td", number(group.judged), class_="number"),
        element("td", stacked_bar(parts, group.judged), class_="wide"),
        element("td", f"{number(group.lifted)} / {number(group.executed)}", class_="number"),
        element("td", share, class_="estimate"),
        class_=style or None,
    )


def count_section(summary: Summary) -> Html:
    """Matrix of objects and outcomes."""
    seen = [o for o in Outcome if summary.total.outcomes[o]]
    groups = [*summary.objects, *([summary.total] if len(summary.objects) > 1 else [])]
    rows = []
    for group in groups:
        cells = [
            element("td", group.outcomes[o] or "·", class_=_count_style(group.outcomes[o]))
            for o in seen
        ]
        style = "total" if group is summary.total else None
        rows.append(element("tr", element("th", group.name, scope="row"), *cells, class_=style))
    head = ["object", *(label(o) for o in seen)]
    matrix = table(head, rows, numbers=tuple(range(1, len(head))), style="matrix")
    return folded("Counts", "Every grasp ends with exactly one outcome.", matrix)


def _count_style(count: int) -> str:
    return "number" if count else "number zero"


def cost_section(summary: Summary) -> Html:
    """CPU time by stage."""
    head = ["stage", "grasps", "CPU time", "median", "grasps per CPU second"]
    rows = []
    for cost in summary.costs:
        rate = format_number(cost.rate)
        cells: list[Child] = [
            cost.grasps,
            format_duration(cost.seconds),
            format_duration(cost.median),
            rate,
        ]
        numbers = [element("td", cell, class_="number") for cell in cells]
        rows.append(element("tr", element("th", cost.name, scope="row"), *numbers))
    text = "CPU time of the worker processes, without their start."
    if summary.mode != "hand":
        text += " The time for reachable includes the search for motions of the arm."
    if summary.mode == "arm":
        text += " The time for planned is that of timing them."
    return folded("Cost", text, table(head, rows, numbers=(1, 2, 3, 4)))


def label(outcome: Outcome) -> str:
    """An outcome for people."""
    return outcome.value.replace("_", " ")
