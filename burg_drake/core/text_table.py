"""Tables for terminals of any width."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

Kind = Literal["number", "name", "text"]


@dataclass(frozen=True)
class _Row:
    """Cells of a row; a row without cells is an empty line."""

    cells: tuple[str, ...]
    bold: bool = False


class TextTable:
    """A table that is filled row by row, and printed by `show` or by `rich`."""

    def __init__(self, title: str = "", *, caption: str = "") -> None:
        """Creates a table without columns; title and caption wrap at blanks."""
        self.title, self.caption = title, caption
        self._heads: list[str] = []
        self._kinds: list[Kind] = []
        self._rows: list[_Row] = []

    def names(self, *heads: str) -> TextTable:
        """Adds columns of names, which are shortened in the middle if too long."""
        return self._add("name", heads)

    def texts(self, *heads: str) -> TextTable:
        """Adds columns of texts, which wrap; also for ids, which have to stay complete."""
        return self._add("text", heads)

    def numbers(self, *heads: str) -> TextTable:
        """Adds columns of numbers, with units in the heads; numbers are never cut."""
        return self._add("number", heads)

    def row(self, *cells: str, bold: bool = False) -> None:
        """Adds a row.

        Raises:
            ValueError: the number of cells differs from that of the columns.
        """
        if len(cells) != len(self._heads):
            raise ValueError(f"a row of {len(cells)} cells; there are {len(self._heads)} columns")
        self._rows.append(_Row(tuple(map(_replace_unprintable, cells)), bold))

    def gap(self) -> None:
        """Adds an empty line, for example before a sum."""
        self._rows.append(_Row(()))

    def figures(self) -> Counter[str]:
        """Counts of the cells in columns of numbers."""
        columns = [c for c, kind in enumerate(self._kinds) if kind == "number"]
        return Counter(cell for c in columns for cell in self._cells(c))

    @property
    def width(self) -> int:
        """Width in characters without shortening or wrapping."""
        return sum(self._natural_widths(range(len(self._heads)))) + 2 * (len(self._heads) - 1)

    def lines(self, width: int) -> list[tuple[str, bool]]:
        """The lines, at most `width` wide unless a number is wider, and whether each is bold."""
        lines = [(line, False) for line in _wrap_text(self.title, width)]
        for block in self._split_into_blocks(width):
            if lines:
                lines.append(("", False))
            lines += self._block_lines(block, width)
        if self.caption:
            lines.append(("", False))
            lines += [(line, False) for line in _wrap_text(self.caption, width)]
        return lines

    def show(self) -> None:
        """Prints the table on standard output, as wide as the terminal, 80 without one."""
        from rich.console import Console

        console = Console(markup=False, highlight=False)
        console.print(self, crop=False)
        if self.title or self.caption:
            console.print()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.segment import Segment
        from rich.style import Style

        for text, bold in self.lines(options.max_width):
            yield Segment(text, Style(bold=True) if bold else None)
            yield Segment.line()

    def _add(self, kind: Kind, heads: Iterable[str]) -> TextTable:
        for head in heads:
            self._heads.append(head)
            self._kinds.append(kind)
        return self

    def _cells(self, column: int) -> list[str]:
        return [row.cells[column] for row in self._rows if row.cells]

    def _natural_widths(self, columns: Iterable[int], *, broken: bool = False) -> list[int]:
        """Width of columns without cuts; heads may break at blanks."""
        heads = ["\n".join(self._heads[c].split()) if broken else self._heads[c] for c in columns]
        return [
            max(len(line) for text in (head, *self._cells(c)) for line in text.split("\n"))
            for c, head in zip(columns, heads, strict=True)
        ]

    def _minimum_widths(self, columns: Iterable[int]) -> list[int]:
        # Characters; only shorter names and texts get narrower.
        min_widths = {"name": 16, "text": 20}
        wide = self._natural_widths(columns, broken=True)
        return [
            min(natural, min_widths.get(self._kinds[c], natural))
            for c, natural in zip(columns, wide, strict=True)
        ]

    def _split_into_blocks(self, width: int) -> list[list[int]]:
        """Blocks of columns that fit side by side; the first column is in every block."""
        everything = list(range(len(self._heads)))
        blocks = [everything[:1]]
        for column in everything[1:]:
            least = self._minimum_widths([*blocks[-1], column])
            if sum(least) + len(least) - 1 > width and len(blocks[-1]) > 1:
                blocks.append(everything[:1])
            blocks[-1].append(column)
        return blocks

    def _widths(self, columns: Sequence[int], width: int) -> tuple[list[int], int]:
        """Width of each column, and the number of blanks between them: the first layout that fits
        of uncut columns, broken heads, narrow gaps, and shortened names and texts."""
        wide: list[int] = []
        for broken, gap in ((False, 2), (True, 2), (True, 1)):
            wide = self._natural_widths(columns, broken=broken)
            if sum(wide) + gap * (len(wide) - 1) <= width:
                return wide, gap
        least = self._minimum_widths(columns)
        while sum(wide) + len(wide) - 1 > width:
            widest = max(range(len(wide)), key=lambda k: (wide[k] > least[k], wide[k]))
            if wide[widest] == least[widest]:
                break
            wide[widest] -= 1
        return wide, 1

    def _block_lines(self, columns: Sequence[int], width: int) -> list[tuple[str, bool]]:
        wide, gap = self._widths(columns, width)
        heads = [_wrap_heading(self._heads[c], w) for c, w in zip(columns, wide, strict=True)]
        fitted = [self._fit_cells(c, w) for c, w in zip(columns, wide, strict=True)]
        right = [self._kinds[c] == "number" for c in columns]

        def joined(cells: Sequence[Sequence[str]], *, below: bool) -> list[str]:
            if below:  # heads are aligned at the bottom
                height = max(map(len, cells))
                cells = [[""] * (height - len(cell)) + list(cell) for cell in cells]
            return [
                (" " * gap)
                .join(
                    f"{text:>{w}}" if r else f"{text:<{w}}"
                    for text, w, r in zip(line, wide, right, strict=True)
                )
                .rstrip()
                for line in zip_longest(*cells, fillvalue="")
            ]

        lines = []
        if any(self._heads):
            lines = [(line, True) for line in joined(heads, below=True)]
            lines.append(("─" * (sum(wide) + gap * (len(wide) - 1)), False))
        for row in self._rows:
            cells = [fit[row.cells[c]] for fit, c in zip(fitted, columns, strict=True) if row.cells]
            lines += [(x, row.bold) for x in joined(cells, below=False)] if cells else [("", False)]
        return lines

    def _fit_cells(self, column: int, width: int) -> dict[str, list[str]]:
        """The lines of each cell of a column."""
        cells = dict.fromkeys(self._cells(column))
        if self._kinds[column] == "number":
            return {cell: [cell] for cell in cells}
        if self._kinds[column] == "name":
            short = {cell: _shorten_middle(cell, width) for cell in cells}
            if len(set(short.values())) == len(short):  # else they could not be distinguished
                return {cell: [text] for cell, text in short.items()}
        return {cell: _wrap_text(cell, width) or [""] for cell in cells}


def _replace_unprintable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _shorten_middle(text: str, width: int) -> str:
    if len(text) <= width:
        return text
    front = width // 2
    return text[:front] + "…" + text[len(text) - (width - front - 1) :]


def _wrap_text(text: str, width: int) -> list[str]:
    """Wraps a text; a number stays with its unit."""
    together = re.sub(r"(?<=\d) (?=%|[A-Za-z]{1,3}\b)", "\xa0", text)
    return [
        line.replace("\xa0", " ")
        for part in together.split("\n")
        for line in textwrap.wrap(part, max(width, 1), break_on_hyphens=False) or [""]
        if text
    ]


def _wrap_heading(text: str, width: int) -> list[str]:
    """Wraps a head at blanks."""
    whole = text.split("\n")
    if max(map(len, whole)) <= width:
        return whole
    return textwrap.wrap(" ".join(whole), width, break_long_words=False, break_on_hyphens=False)
