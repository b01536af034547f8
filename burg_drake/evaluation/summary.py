"""What a run found, in numbers: counts by object, outcome and stage, rates, CPU time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core.outcome import Outcome, Stage
from burg_drake.core.statistics import wilson_interval
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.table import CPU_COLUMNS, Columns

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
    from rich.segment import Segment
    from rich.table import Table


@dataclass(frozen=True)
class Group:
    """Grasps of one object, or of all.

    Attributes:
        name: the object's name.
        judged: number of grasps.
        outcomes: number of grasps by outcome.
        decided: number of grasps by the stage that decided.
        failed: number of `simulation_failed` by the stage that failed.
    """

    name: str
    judged: int
    outcomes: Counter[Outcome]
    decided: Counter[Stage]
    failed: Counter[Stage]

    @property
    def clear(self) -> int:
        """Grasps that passed the screen of the hand."""
        return self.judged - self.decided[Stage.CLEAR]

    @property
    def reachable(self) -> int:
        """Those that the arm reaches, too; the same as `clear` where it was not asked."""
        return self.clear - self.decided[Stage.REACHABLE]

    @property
    def executed(self) -> int:
        """Those whose trial came to an end."""
        return self.reachable - self.failed[Stage.EXECUTED]

    @property
    def held(self) -> int:
        """Those whose target was held to the end."""
        return sum(count for outcome, count in self.outcomes.items() if outcome.held)

    @property
    def lifted(self) -> int:
        """Those that succeeded: held, and nothing else was disturbed."""
        return self.outcomes[Outcome.LIFTED]

    @property
    def funnel(self) -> dict[str, int]:
        """Counts from the first stage to success; none is larger than the one before."""
        return {
            "candidates": self.judged,
            "clear": self.clear,
            "reachable": self.reachable,
            "executed": self.executed,
            "held": self.held,
            "lifted": self.lifted,
        }

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share of executed grasps that are lifted."""
        return wilson_interval(self.lifted, self.executed)


@dataclass(frozen=True)
class StageCost:
    """CPU time of a stage.

    Attributes:
        name: of the stage.
        grasps: how many it looked at.
        seconds: CPU time in all [s].
        median: CPU time of the median grasp [s]; NaN where it is not known.
    """

    name: str
    grasps: int
    seconds: float
    median: float

    @property
    def rate(self) -> float:
        """Grasps a second of CPU time."""
        return self.grasps / self.seconds if self.seconds > 0.0 else math.nan


@dataclass(frozen=True)
class Summary:
    """A run in numbers.

    Attributes:
        objects: by object, in the order of the scene.
        total: all together.
        costs: by stage, sampling first.
        reach: whether the arm was asked.
    """

    objects: tuple[Group, ...]
    total: Group
    costs: tuple[StageCost, ...]
    reach: bool


def summarize(run: Run) -> Summary:
    """Counts what a run has found so far."""
    columns, document = run.results, run.document
    names = document.grasps.objects
    sampling = document.grasps
    costs = [
        _stage_cost(columns, stage) for stage in Stage if document.reach or stage != "reachable"
    ]
    if sampling.origin == "sampled" and sampling.count:
        costs.insert(0, StageCost("sampling", sampling.count, sampling.cpu, math.nan))
    return Summary(
        objects=tuple(_group(columns, name, columns["object"] == name) for name in names),
        total=_group(columns, "all", np.ones(len(columns["id"]), dtype=bool)),
        costs=tuple(costs),
        reach=document.reach,
    )


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
        yield from _trimmed(console, options, _cost_table(self.summary))


def summary_view(summary: Summary) -> RenderableType:
    """Stages, outcomes and CPU time as tables; where objects are too many, outcomes as a list."""
    return SummaryView(summary)


def percent(value: float) -> str:
    """A share for people."""
    return f"{100 * value:.0f} %" if value in (0.0, 1.0) else f"{100 * value:.1f} %"


def rounded(value: float) -> str:
    """A positive number for people, with three digits and no exponent."""
    return f"{value:.3g}" if value < 1000 else f"{float(f'{value:.3g}'):.0f}"


def duration(seconds: float) -> str:
    """A duration for people, with three digits."""
    if math.isnan(seconds):
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}" if seconds < 1000 else f"{seconds:.0f} s"
    return f"{seconds * 1e6:.3g} µs"


def _group(columns: Columns, name: str, mask: np.ndarray) -> Group:
    outcomes = Counter(Outcome(o) for o in columns["outcome"][mask])
    decided = Counter(Stage(s) for s in columns["stage"][mask])
    failed = columns["stage"][mask & (columns["outcome"] == Outcome.SIMULATION_FAILED)]
    return Group(name, int(mask.sum()), outcomes, decided, Counter(Stage(s) for s in failed))


def _stage_cost(columns: Columns, stage: Stage) -> StageCost:
    cpu = columns[CPU_COLUMNS[stage]]
    cpu = cpu[np.isfinite(cpu)]
    median = float(np.median(cpu)) if len(cpu) else math.nan
    return StageCost(stage.value, len(cpu), float(cpu.sum()), median)


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
    names = [n for n in summary.total.funnel if summary.reach or n != "reachable"]
    table.add_column("object", overflow="fold")
    for name in names:
        table.add_column("grasps" if name == "candidates" else name, justify="right", no_wrap=True)
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
    table.caption = (
        "held: to the end; lifted: held, and no other object disturbed\n"
        "success: lifted of executed; CI: Wilson's interval"
    )
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
