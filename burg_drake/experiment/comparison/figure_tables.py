"""Tables of a comparison, with the same rows in a terminal and on a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from burg_drake.core import MISSING_NUMBER, Stage, TextTable, format_count, outcome_label
from burg_drake.evaluation import interval_mark, table
from burg_drake.experiment.comparison.comparison import (
    PERCENT_MEASURES,
    Comparison,
    bracketed_interval,
    estimate_text,
    measure_name,
)
from burg_drake.experiment.comparison.confusion_matrix import Agreement
from burg_drake.experiment.comparison.estimates import AGREEMENT_MEASURES, Estimate
from burg_drake.experiment.comparison.group_agreement import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement, PlacementAgreement
from burg_drake.visualization import Child, Html, element, join


@dataclass(frozen=True)
class Figure:
    """A cell with an estimate.

    Attributes:
        estimate: the number with its interval.
        percent: whether it is shown in per cent.
    """

    estimate: Estimate
    percent: bool = True

    @property
    def texts(self) -> tuple[str, str]:
        """Number and interval."""
        found, percent = self.estimate, self.percent
        interval = bracketed_interval(found, percent=percent) or MISSING_NUMBER
        return estimate_text(found, percent=percent), interval


Cell = str | float | Figure
"""A text, a count, or an estimate."""


@dataclass(frozen=True)
class FigureColumn:
    """A column of texts and numbers.

    Attributes:
        head: its heading in a terminal.
        kind: `name`: shortened in a narrow terminal. `text`: wrapped. `number`: aligned to the
            right. `figure`: an estimate with its interval. `share`: the same, drawn on a page.
        page_head: heading on a page; `head` if empty.
        label: what stands before the cell on a narrow page.
        interval: whether the terminal shows the interval.
        page_only: whether it is left out in a terminal.
    """

    head: str
    kind: Literal["name", "text", "number", "figure", "share"]
    page_head: str = ""
    label: str | None = None
    interval: bool = True
    page_only: bool = False


@dataclass(frozen=True)
class FigureTable:
    """A table whose first column says what a row is about."""

    columns: Sequence[FigureColumn]
    rows: Sequence[Sequence[Cell]]

    def text_table(self, title: str) -> TextTable:
        """The table for a terminal."""
        max_rows = 20
        found = TextTable(title)
        for column in self.columns:
            if column.kind == "name":
                found.names(column.head)
            elif column.kind == "text" and not column.page_only:
                found.texts(column.head)
            elif column.kind == "number":
                found.numbers(column.head)
            elif column.kind in ("figure", "share"):
                found.numbers(column.head, *(["95 % CI"] if column.interval else []))
        for row in self.rows[:max_rows]:
            found.row(*self._terminal_cells(row))
        if len(self.rows) > max_rows:
            found.caption = f"the first {max_rows} of {len(self.rows)}; the JSON has all"
        return found

    def html(self, style: str, max_rows: int | None = None) -> Html:
        """The table for a page."""
        columns = self.columns
        rows = [
            named_row(str(row[0]), *map(_page_cell, columns[1:], row[1:]))
            for row in self.rows[:max_rows]
        ]
        numbers = [k for k, c in enumerate(columns) if c.kind in ("number", "figure")]
        return table([c.page_head or c.head for c in columns], rows, numbers=numbers, style=style)

    def _terminal_cells(self, row: Sequence[Cell]) -> Iterator[str]:
        for column, cell in zip(self.columns, row, strict=True):
            if isinstance(cell, Figure):
                yield from cell.texts if column.interval else cell.texts[:1]
            elif not column.page_only:
                yield cell if isinstance(cell, str) else format_count(round(cell))


def _page_cell(column: FigureColumn, cell: Cell) -> Html:
    if isinstance(cell, Figure):
        if column.kind == "figure":
            return figure_cell(cell.estimate, percent=cell.percent)
        mark = share_with_interval(cell.estimate)
        return element("td", mark, class_="estimate", data_label=column.label)
    text = cell if isinstance(cell, str) else format_count(round(cell))
    style = {"number": "number", "name": "faint"}.get(column.kind)
    return element("td", text, class_=style, data_label=column.label)


def named_row(name: Child, *cells: Html) -> Html:
    """A row of a page's table that begins with a name."""
    return element("tr", element("th", name, scope="row"), *cells)


def number_cells(values: Iterable[Child]) -> list[Html]:
    """Cells of a page's table that are aligned to the right."""
    return [element("td", value, class_="number") for value in values]


def labelled_row(heads: Sequence[str], cells: Sequence[Child]) -> Html:
    """A row of a page's table; on narrow pages each cell stands beside its heading."""
    named = zip(heads, cells, strict=True)
    return element("tr", *(element("td", cell, data_label=head) for head, cell in named))


def figure_cell(found: Estimate, *, percent: bool) -> Html:
    """A figure and its interval, below each other where there is little room."""
    if found.value is None:
        return element("td", found.reason, class_="number faint why")
    bounds = element("small", bracketed_interval(found, percent=percent), class_="bounds")
    return element("td", estimate_text(found, percent=percent), " ", bounds, class_="number")


def share_with_interval(found: Estimate) -> Child:
    """A share as a dot with its interval, and in figures."""
    if found.value is None or found.low is None or found.high is None:
        return element("span", found.reason, class_="faint")
    return join(interval_mark(found.value, found.low, found.high), f" {100 * found.value:.0f} %")


Named = Sequence[tuple[str, Judgement]]
"""The judgement of each run; the name is empty if there is only one."""


def named_agreements(judged: Named) -> list[tuple[str, Agreement]]:
    """Agreement of the selected trials, and of all grasps where that is known."""
    found = []
    for name, judgement in judged:
        suffix = f", {name}" if name else ""
        found.append((f"selected trials{suffix}", judgement.selected))
        if judgement.all_grasps is not None:
            found.append((f"all grasps{suffix}", judgement.all_grasps))
    return found if len(found) > 1 else [("value", found[0][1])]


def measure_table(comparison: Comparison, judged: Named) -> FigureTable:
    """All measures with their intervals."""
    columns = named_agreements(judged)
    rows: list[list[Cell]] = []
    for key in AGREEMENT_MEASURES:
        percent = key in PERCENT_MEASURES
        figures = [Figure(found.figure(key), percent) for _, found in columns]
        rows.append([measure_name(comparison, key), *figures])
    heads = [FigureColumn(name, "figure") for name, _ in columns]
    return FigureTable([FigureColumn("figure", "text"), *heads], rows)


def unpredictable_table(judged: Judgement) -> FigureTable:
    """Figures with and without failures that the hand alone does not predict."""
    measures = ("precision", "recall", "accuracy")
    assert judged.unpredictable is not None
    pairs = [("trials", judged.selected, judged.unpredictable.selected)]
    if judged.all_grasps is not None and judged.unpredictable.all_grasps is not None:
        pairs = [("selected trials", *pairs[0][1:])]
        pairs.append(("all grasps", judged.all_grasps, judged.unpredictable.all_grasps))
    rows: list[list[Cell]] = [
        [f"{name}, {which}", *(Figure(found.figure(key)) for key in measures)]
        for name, every, without in pairs
        for which, found in (("with", every), ("without", without))
    ]
    heads = [FigureColumn(key, "figure") for key in measures]
    return FigureTable([FigureColumn("of", "text"), *heads], rows)


def group_table(head: str, groups: Sequence[FactorGroup]) -> FigureTable:
    """Counts and shares by object, scene or placement."""
    counts = ("trials", "TP", "FP", "FN", "TN")
    columns = [
        FigureColumn(head, "name"),
        *(FigureColumn(name, "number", label=name) for name in counts),
        FigureColumn("right", "share", label="right"),
        FigureColumn("precision", "share", label="precision", interval=False),
        FigureColumn("recall", "share", label="recall", interval=False),
    ]
    rows: list[list[Cell]] = [
        [group.name, a.trials, *a.cells, *map(Figure, (a.accuracy, a.precision, a.recall))]
        for group in groups
        for a in [group.agreement]
    ]
    return FigureTable(columns, rows)


def placement_groups(
    placement: PlacementAgreement, within: str, beyond: str
) -> tuple[FactorGroup, ...]:
    """Trials by the placement of their objects, as `group_table` takes them.

    Args:
        placement: the trials.
        within, beyond: names of the first two groups.
    """
    return (
        FactorGroup(name=within, agreement=placement.within),
        FactorGroup(name=beyond, agreement=placement.beyond),
        FactorGroup(name="not all measured", agreement=placement.unmeasured),
    )


def verdict_table(comparison: Comparison, judged: Judgement) -> FigureTable:
    """Successes on the robot, or in the second run, by verdict and body in the way."""
    first, second = "simulated", "succeeded"
    if comparison.kind == "runs":
        first, second = "first run", "success in the second"
    columns = [
        FigureColumn(first, "text"),
        FigureColumn("body in the way", "name"),
        FigureColumn("stage", "text", page_only=True),
        FigureColumn("trials", "number", label="trials"),
        FigureColumn(second, "share", f"{second}, 95 % interval", "succeeded"),
    ]
    rows: list[list[Cell]] = [
        [outcome_label(row.outcome), row.blocker, row.stage, row.trials, Figure(row.successes)]
        for row in judged.stopped
    ]
    return FigureTable(columns, rows)


CONFIDENCE_HEADING = "confidence of the first run"


def run_agreement_table(head: str, groups: Sequence[FactorGroup]) -> FigureTable:
    """Agreement of two runs on what is held, by object or confidence."""
    columns = [
        FigureColumn(head, "name"),
        FigureColumn("grasps", "number", label="grasps"),
        FigureColumn("alike", "share", "alike, 95 % interval", "alike"),
        FigureColumn("kappa", "number", "Cohen's kappa", "kappa"),
    ]
    rows: list[list[Cell]] = [
        [group.name, a.trials, Figure(a.accuracy), estimate_text(a.kappa, percent=False)]
        for group in groups
        for a in [group.agreement]
    ]
    return FigureTable(columns, rows)


def deciding_stages(counts: Mapping[str, Mapping[str, int]]) -> list[str]:
    """The stages of the second run that occur, in their order."""
    return [stage.value for stage in Stage if any(stage.value in row for row in counts.values())]
