"""The summary of a run as tables for a terminal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.core import (
    CONTESTED_CONFIDENCE,
    NO_VALUE,
    Mode,
    Outcome,
    TextTable,
    format_count,
    format_duration,
    format_number,
    format_percent,
)
from burg_drake.evaluation.outcome_counts import OutcomeCounts, Summary

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult


@dataclass(frozen=True)
class SummaryView:
    """The summary for a terminal of any width, as `rich` prints it."""

    summary: Summary

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.segment import Segment
        from rich.text import Text

        matrix = _outcome_matrix(self.summary)
        fits = matrix.width <= options.max_width
        yield _stage_table(self.summary)
        yield ""
        if self.summary.knows_confidence:
            yield _certainty_table(self.summary)
            yield ""
        if self.summary.notes:
            for note in self.summary.notes:
                words, *commands = note.splitlines()
                yield Text(f"note: {words}")
                for command in commands:  # in one piece, so that it can be copied
                    yield Segment(f"    {command}\n")
            yield ""
        yield matrix if fits else _outcome_list(self.summary)
        yield ""
        for found in (self.summary.lifts, self.summary.pushes):
            if found is not None:
                yield f"{found}\n"
        yield _cost_table(self.summary)
        yield ""


def summary_view(summary: Summary) -> RenderableType:
    """Stages, outcomes and CPU time as tables; with many objects, outcomes as a list."""
    return SummaryView(summary)


def _stage_table(summary: Summary) -> TextTable:
    # Short headings for narrow terminals.
    short_names = {"candidates": "grasps", "reachable": "reach", "planned": "plan"}
    names = summary.steps
    table = TextTable("Grasps that pass each stage").names("object")
    table.numbers(*(short_names.get(name, name) for name in names), "success", "95 % CI")
    for group in _groups_with_total(summary):
        if group is summary.total and len(summary.objects) > 1:
            table.gap()
        low, high = group.interval
        rate = ["-", "-"]
        if group.executed:
            share = format_percent(group.lifted / group.executed)
            rate = [share, f"{100 * low:.0f}-{100 * high:.0f} %"]
        table.row(group.name, *(format_count(group.funnel[name]) for name in names), *rate)
    meanings = _step_meanings(summary.mode)
    table.caption = "\n".join(
        [
            *(f"{short_names.get(n, n)}: {meanings[n]}" for n in meanings if n in names),
            "success: share of executed grasps that were lifted; CI: Wilson's 95 % interval",
        ]
    )
    return table


def _step_meanings(mode: Mode) -> dict[str, str]:
    """Meaning of each column of the stage table."""
    reach = "the hand comes in and out without a collision"
    if mode != "hand":
        reach += ", and the arm has a posture for the grasp that collides with nothing"
    return {
        "clear": "the open hand collides with nothing at the grasp",
        "reachable": reach,
        "planned": "the arm has a path there without collision, and can follow approach and lift",
        "executed": "the grasp was simulated",
        "held": "the object is still in the hand at the end",
        "lifted": "held, without turning in the hand or disturbing another object",
    }


def _certainty_table(summary: Summary) -> TextTable:
    table = TextTable("How sure the verdicts of executed grasps are").names("object")
    settled = summary.total.settled > 0
    table.numbers("executed", "lifted", "failed", "contested", *(["settled"] if settled else []))
    for group in _groups_with_total(summary):
        if group is summary.total and len(summary.objects) > 1:
            table.gap()
        numbers = [group.executed, group.surely_lifted, group.surely_lost, group.contested]
        table.row(group.name, *map(format_count, [*numbers, *([group.settled] * settled)]))
    table.caption = (
        "lifted, failed: grasps whose verdict is not contested\n"
        "contested: the simulation is not sure whether the object was held (confidence"
        f" below {CONTESTED_CONFIDENCE:g}); judging again with another engine can settle it"
    )
    if settled:
        table.caption += "\nsettled: judged again by another engine, lifted or failed"
    return table


def _outcome_matrix(summary: Summary) -> TextTable:
    groups = _groups_with_total(summary)
    table = TextTable("Outcomes").texts("outcome").numbers(*(group.name for group in groups))
    for outcome in _occurring_outcomes(summary):
        counts = [
            format_count(n) if (n := group.outcomes[outcome]) else NO_VALUE for group in groups
        ]
        table.row(outcome.value, *counts, bold=outcome is Outcome.LIFTED)
    table.caption = _outcome_meanings(summary)
    return table


def _outcome_list(summary: Summary) -> TextTable:
    table = TextTable("Outcomes").names("object").texts("outcomes")
    for group in _groups_with_total(summary):
        counts = [(group.outcomes[o], o) for o in _occurring_outcomes(summary)]
        table.row(group.name, ", ".join(f"{format_count(n)} {o}" for n, o in counts if n))
    table.caption = _outcome_meanings(summary)
    return table


def _outcome_meanings(summary: Summary) -> str:
    """Meanings of the outcomes that occur, except `lifted`, which the stage table explains."""
    seen = [outcome for outcome in _occurring_outcomes(summary) if outcome is not Outcome.LIFTED]
    return "\n".join(f"{outcome}: {outcome.meaning}" for outcome in seen)


def _occurring_outcomes(summary: Summary) -> list[Outcome]:
    return [outcome for outcome in Outcome if summary.total.outcomes[outcome]]


def _cost_table(summary: Summary) -> TextTable:
    table = TextTable("CPU time").texts("stage")
    table.numbers("grasps", "CPU time", "median", "grasps per CPU second")
    for cost in summary.costs:
        times = (format_duration(cost.seconds), format_duration(cost.median))
        table.row(cost.name, format_count(cost.grasps), *times, format_number(cost.rate))
    table.caption = "CPU time: of all these grasps; median: of one grasp"
    return table


def _groups_with_total(summary: Summary) -> list[OutcomeCounts]:
    return [*summary.objects, summary.total] if len(summary.objects) != 1 else [*summary.objects]
