"""Tables of findings for both terminal and page, and plots of margins."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from burg_drake.core import MISSING_NUMBER, TextTable, format_count, format_number
from burg_drake.evaluation import number_cells, section, table
from burg_drake.experiment.comparison.comparison import (
    bracketed_interval,
    estimate_text,
    margin_title,
)
from burg_drake.experiment.comparison.confusion_matrix import Estimate
from burg_drake.experiment.comparison.margin_calibration import Bin, MarginCalibration
from burg_drake.visualization import Child, Html, element, interval_mark, join, nice_step


@dataclass(frozen=True)
class Figure:
    """A cell with an estimate.

    Attributes:
        estimate: the value with its interval.
        percent: whether to show it in per cent.
    """

    estimate: Estimate
    percent: bool = True

    @property
    def texts(self) -> tuple[str, str]:
        """Texts of value and interval."""
        found, percent = self.estimate, self.percent
        interval = bracketed_interval(found, percent=percent) or MISSING_NUMBER
        return estimate_text(found, percent=percent), interval


Cell = str | float | Figure | Html | tuple[str, Html]
"""A text, a count, an estimate, an element of a page, or a text for a terminal with an element."""


@dataclass(frozen=True)
class _Column:
    """A column. `kind` names the method of `FindingTable` that adds it; `interval` says whether a
    terminal shows the intervals of estimates.
    """

    head: str
    kind: Literal["name", "text", "number", "figure", "share", "element"]
    interval: bool = False


@dataclass(eq=False, kw_only=True)
class FindingTable:
    """A table that is filled row by row, with titles and explanations. The first column names the
    subject of each row.

    Attributes:
        title: in a terminal.
        page_title: on a page; `title` if empty.
        caption: explanation below the table in a terminal.
        text: explanation above the table on a page.
        style: CSS class of the table on a page.
        max_rows: rows shown in a terminal; all if None.
        max_page_rows: rows shown on a page; all if None.
    """

    title: str = ""
    page_title: str = ""
    caption: str = ""
    text: str = ""
    style: str = ""
    max_rows: int | None = None
    max_page_rows: int | None = None
    _columns: list[_Column] = field(default_factory=list)
    _rows: list[Sequence[Cell]] = field(default_factory=list)

    def names(self, *heads: str) -> FindingTable:
        """Adds columns of names, which a narrow terminal shortens."""
        return self._add(_Column(head, "name") for head in heads)

    def texts(self, *heads: str) -> FindingTable:
        """Adds columns of texts, which wrap."""
        return self._add(_Column(head, "text") for head in heads)

    def numbers(self, *heads: str) -> FindingTable:
        """Adds columns of counts and texts that are aligned to the right."""
        return self._add(_Column(head, "number") for head in heads)

    def figures(self, *heads: str, interval: bool = True) -> FindingTable:
        """Adds columns of estimates; a page shows their intervals in any case."""
        return self._add(_Column(head, "figure", interval) for head in heads)

    def shares(self, *heads: str, interval: bool = True) -> FindingTable:
        """Adds columns of estimates that a page shows as charts."""
        return self._add(_Column(head, "share", interval) for head in heads)

    def elements(self, *heads: str) -> FindingTable:
        """Adds columns that only a page shows."""
        return self._add(_Column(head, "element") for head in heads)

    def row(self, *cells: Cell) -> None:
        """Adds a row, with a cell for each column."""
        self._rows.append(cells)

    def text_table(self, name: str = "") -> TextTable:
        """The table for a terminal.

        Args:
            name: suffix of the title.
        """
        found = TextTable(f"{self.title}{name}", caption=self.caption)
        for column in self._columns:
            if column.kind == "name":
                found.names(column.head)
            elif column.kind == "text":
                found.texts(column.head)
            elif column.kind != "element":
                found.numbers(column.head, *(["95 % CI"] if column.interval else []))
        rows = self._rows[: self.max_rows]
        for row in rows:
            found.row(*self._terminal_cells(row))
        if len(rows) < len(self._rows) and not self.caption:
            found.caption = f"the first {len(rows)} of {len(self._rows)}; the JSON has all"
        return found

    def section(self, *before: Child) -> Html:
        """The section of a page.

        Args:
            before: elements between the text and the table.
        """
        count, limit = len(self._rows), self.max_page_rows
        more = "" if limit is None or count <= limit else f" The first {limit} of {count}."
        return section(self.page_title or self.title, self.text + more, *before, self.page_table())

    def page_table(self) -> Html:
        """The table of a page without its titles."""
        numbers = [k for k, c in enumerate(self._columns) if c.kind in ("number", "figure")]
        rows = self._rows[: self.max_page_rows]
        lines = [element("tr", *self._page_cells(row)) for row in rows]
        heads = [column.head for column in self._columns]
        return table(heads, lines, numbers=numbers, style=self.style)

    def _add(self, columns: Iterable[_Column]) -> FindingTable:
        self._columns += columns
        return self

    def _terminal_cells(self, row: Sequence[Cell]) -> Iterator[str]:
        for column, cell in zip(self._columns, row, strict=True):
            if isinstance(cell, Figure):
                yield from cell.texts if column.interval else cell.texts[:1]
            elif isinstance(cell, tuple):
                yield cell[0]
            elif column.kind != "element":
                yield cell if isinstance(cell, str) else format_count(round(cell))

    def _page_cells(self, row: Sequence[Cell]) -> Iterator[Html]:
        for k, (column, cell) in enumerate(zip(self._columns, row, strict=True)):
            label = column.head  # shown before the cell on a narrow page
            if isinstance(cell, Figure) and column.kind == "figure":
                yield figure_cell(cell)
            elif isinstance(cell, (Figure, tuple)):
                mark = cell[1] if isinstance(cell, tuple) else share_with_interval(cell.estimate)
                yield element("td", mark, class_="estimate", data_label=label)
            else:
                text = cell if isinstance(cell, str) else format_count(round(cell))
                style = "number" if column.kind == "number" else None
                if k == 0 and self.style != "cases":
                    yield element("th", text, scope="row")
                else:
                    yield element("td", text, class_=style, data_label=label)


def named_row(name: Child, *cells: Html) -> Html:
    """A row of a page's table that begins with a name."""
    return element("tr", element("th", name, scope="row"), *cells)


def cross_table(
    head: str, columns: Sequence[str], rows: Sequence[tuple[str, Sequence[Child]]], style: str = ""
) -> Html:
    """A table of a page with counts by row and column; `head` is the heading of the row names."""
    lines = [named_row(name, *number_cells(cells)) for name, cells in rows]
    return table([head, *columns], lines, numbers=range(1, len(columns) + 1), style=style)


def figure_cell(figure: Figure) -> Html:
    """A figure and its interval, one below the other in little space."""
    found = figure.estimate
    if found.value is None:
        return element("td", found.reason, class_="number faint why")
    interval = bracketed_interval(found, percent=figure.percent)
    bounds = element("small", interval, class_="bounds")
    return element("td", figure.texts[0], " ", bounds, class_="number")


def share_with_interval(estimate: Estimate) -> Child:
    """A share as a dot with its interval, and as text."""
    if estimate.value is None or estimate.low is None or estimate.high is None:
        return element("span", estimate.reason, class_="faint")
    return join(
        interval_mark(estimate.value, estimate.low, estimate.high), f" {100 * estimate.value:.0f} %"
    )


PLOT_SIZE = 330, 210  # width and height of a reliability plot in SVG units
PLOT_LEFT, PLOT_RIGHT = 38, 320  # x of the axes' ends
PLOT_TOP, PLOT_BOTTOM = 24, 172  # y of the shares 1 and 0


def reliability_plot(calibration: MarginCalibration, vertical: str) -> Html:
    """Reliability plot: a dot with its interval for each bin, the isotonic fit as a line, and the
    overall share dashed.

    Args:
        calibration: bins and fit; weighted shares are drawn if known.
        vertical: label of the share.
    """
    title, unit, factor = margin_title(calibration.name)
    ends = [factor * calibration.bins[0].low, factor * calibration.bins[-1].high]
    largest = max(abs(end) for end in ends)
    spread = ends[1] - ends[0]
    step = nice_step((spread if spread > 1e-6 * largest else largest or 1.0) / 5)
    low, high = math.floor(ends[0] / step + 1e-9), math.ceil(ends[1] / step - 1e-9)
    low, high = (low, high) if low < high else (low - 1, high + 1)

    def x(value: float) -> float:
        along = (factor * value - low * step) / ((high - low) * step)
        return PLOT_LEFT + (PLOT_RIGHT - PLOT_LEFT) * along

    named = f"{title} [{unit}]" if unit else title
    axis = [
        element(
            "text",
            f"{k * step:.6g}",
            x=f"{x(k * step / factor):.1f}",
            y=PLOT_BOTTOM + 15,
        )
        for k in range(low, high + 1)
    ]
    return element(
        "svg",
        element("text", vertical, x=4, y=12, class_="title"),
        element("text", named, x=PLOT_RIGHT, y=PLOT_SIZE[1] - 5, class_="title end"),
        *_grid_lines(),
        element("g", *axis, class_="middle"),
        _mean_line((calibration.weighted or calibration.share).value),
        _isotonic_line(calibration, x),
        *(part for row in calibration.bins for part in _bin_marks(row, x, factor, unit)),
        viewBox=f"0 0 {PLOT_SIZE[0]} {PLOT_SIZE[1]}",
        class_="plot",
        role="img",
        aria_label=f"{vertical} over {named}",
    )


def _share_height(share: float) -> float:
    """y of a share in a plot."""
    return PLOT_TOP + (PLOT_BOTTOM - PLOT_TOP) * (1.0 - share)


def _grid_lines() -> list[Html]:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = f"{_share_height(share):.1f}"
        style = "axis" if share == 0.0 else "grid"
        parts.append(element("line", x1=PLOT_LEFT, x2=PLOT_RIGHT, y1=y, y2=y, class_=style))
        label = f"{100 * share:.0f} %" if share in (0.0, 0.5, 1.0) else ""
        parts.append(element("text", label, x=PLOT_LEFT - 5, y=y, dy="0.35em", class_="end"))
    return parts


def _mean_line(share: float | None) -> Html | None:
    if share is None:
        return None
    y = f"{_share_height(share):.1f}"
    return element(
        "g",
        element("line", x1=PLOT_LEFT, x2=PLOT_RIGHT, y1=y, y2=y, class_="base"),
        element("title", f"of all: {100 * share:.1f} %"),
    )


def _isotonic_line(calibration: MarginCalibration, x: Callable[[float], float]) -> Html | None:
    """Line of the isotonic fit, which jumps half way between its steps."""
    points, steps = [], calibration.isotonic
    for k, step in enumerate(steps):
        start = (steps[k - 1].high + step.low) / 2 if k else step.low
        end = (step.high + steps[k + 1].low) / 2 if k + 1 < len(steps) else step.high
        points += [f"{x(value):.1f},{_share_height(step.share):.1f}" for value in (start, end)]
    return element("path", d="M" + " L".join(points), class_="fit") if points else None


def _bin_marks(row: Bin, x: Callable[[float], float], factor: float, unit: str) -> list[Html]:
    share = row.share if row.weighted is None else row.weighted
    place = f"{x(row.mean):.1f}"
    tip = (
        f"{row.successes} of {row.trials} trials, {format_number(factor * row.low)} to"
        f" {format_number(factor * row.high)} {unit}".rstrip()
    )
    shares = (share.value, share.low, share.high)
    value, low, high = (f"{_share_height(v or 0.0):.1f}" for v in shares)
    return [
        element(
            "line", element("title", tip), x1=place, x2=place, y1=low, y2=high, class_="whisker"
        ),
        element("circle", element("title", tip), cx=place, cy=value, r=3.5, class_="dot"),
    ]
