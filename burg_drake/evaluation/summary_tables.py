"""What a run found, as tables for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.summary import Group, Summary, duration, percent, rounded

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
    from rich.segment import Segment
    from rich.table import Table

SHORT = {"candidates": "grasps", "reachable": "reach", "planned": "plan"}
"""Names for a narrow terminal."""


@dataclass(frozen=True)
class SummaryView:
    """The summary for a terminal of 80 columns or more, as `rich` prints it."""

    summary: Summary

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.measure import Measurement

        matrix = _outcome_matrix(self.summary)
        wide = Measurement.get(console, options.update(max_width=1000), matrix).maximum
        fits = wide <= options.max_width
        outcomes = matrix if fits else _outcome_list(self.summary)
        yield from _trimmed(console, options, _stage_table(self.summary))
        yield ""
        yield from _trimmed(console, options, outcomes)
        yield ""
        if self.summary.pushes is not None:
            yield f"{self.summary.pushes}\n"
        yield from _trimmed(console, options, _cost_table(self.summary))


def summary_view(summary: Summary) -> RenderableType:
    """Stages, outcomes and CPU time as tables; where objects are too many, outcomes as a list."""
    return SummaryView(summary)


def _trimmed(console: Console, options: ConsoleOptions, table: Table) -> Iterator[Segment]:
    """The lines of a table without trailing blanks."""
    from rich.segment import Segment

    for line in console.render_lines(table, options, pad=False):
        while line and not line[-1].text.strip():
            line.pop()
        if line:
            yield from line[:-1]
            yield Segment(line[-1].text.rstrip(), line[-1].style)
        yield Segment.line()


def _table(title: str, *, gap: int = 2) -> Table:
    """An empty table; `gap` characters, at least 1, are between its columns."""
    from rich import box
    from rich.table import Table

    return Table(
        title=title,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, gap - 1, 0, 0),
        pad_edge=False,
    )


def _stage_table(summary: Summary) -> Table:
    table = _table("Grasps that pass each stage", gap=1)  # 17 characters are left for the objects
    names = summary.steps
    table.add_column("object", overflow="fold")
    for name in names:
        table.add_column(SHORT.get(name, name), justify="right", no_wrap=True)
    table.add_column("success", justify="right", no_wrap=True)
    table.add_column("95 % CI", justify="right", no_wrap=True)
    for group in _rows(summary):
        if group is summary.total and len(summary.objects) > 1:
            table.add_section()
        low, high = group.interval
        share, interval = "-", "-"
        if group.executed:
            share = percent(group.lifted / group.executed)
            interval = f"{100 * low:.0f}-{100 * high:.0f} %"
        counts = [str(group.funnel[name]) for name in names]
        table.add_row(group.name, *counts, share, interval)
    table.caption = "held: to the end; lifted: held, and no other object disturbed\n"
    if summary.mode != "hand":
        table.caption += "reach, plan: the arm can be there; it can move there, in and up\n"
    table.caption += "success: lifted of executed; CI: Wilson's interval"
    table.caption_justify = "left"
    return table


def _outcome_matrix(summary: Summary) -> Table:
    table = _table("Outcomes")
    groups = _rows(summary)
    table.add_column("outcome", no_wrap=True)
    for group in groups:
        table.add_column(group.name, justify="right", no_wrap=True)
    for outcome in _seen(summary):
        counts = [str(group.outcomes[outcome] or "·") for group in groups]
        style = "bold" if outcome is Outcome.LIFTED else None
        table.add_row(outcome.value, *counts, style=style)
    return table


def _outcome_list(summary: Summary) -> Table:
    table = _table("Outcomes")
    table.add_column("object", overflow="fold")
    table.add_column("outcomes")
    for group in _rows(summary):
        found = [f"{group.outcomes[o]} {o.value}" for o in _seen(summary) if group.outcomes[o]]
        table.add_row(group.name, ", ".join(found))
    return table


def _seen(summary: Summary) -> list[Outcome]:
    return [outcome for outcome in Outcome if summary.total.outcomes[outcome]]


def _cost_table(summary: Summary) -> Table:
    table = _table("CPU time")
    table.add_column("stage", no_wrap=True)
    for name in ("grasps", "CPU time", "median", "grasps per CPU second"):
        table.add_column(name, justify="right", no_wrap=True)
    for cost in summary.costs:
        rate = "-" if math.isnan(cost.rate) else rounded(cost.rate)
        table.add_row(
            cost.name, str(cost.grasps), duration(cost.seconds), duration(cost.median), rate
        )
    return table


def _rows(summary: Summary) -> list[Group]:
    return [*summary.objects, summary.total] if len(summary.objects) > 1 else [summary.total]
