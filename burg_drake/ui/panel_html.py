"""Texts of panels as HTML, and the colours of statuses."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from dataclasses import dataclass

from burg_drake.visualization import Child, Html, element, join

Rgb8 = tuple[int, int, int]


@dataclass(frozen=True)
class StatusStyle:
    """How a status of an instance is shown.

    Attributes:
        color: red, green, blue as bytes.
        words: for people.
    """

    color: Rgb8
    words: str

    @property
    def hex(self) -> str:
        """The colour as HTML has it."""
        return "#" + bytes(self.color).hex()


STATUS_STYLES: dict[str, StatusStyle] = {
    "ok": StatusStyle((46, 160, 67), "ok"),
    "collision": StatusStyle((214, 40, 40), "in collision"),
    "out_of_bounds": StatusStyle((236, 90, 180), "out of bounds"),
    "in_ground": StatusStyle((140, 80, 30), "in the ground"),
    "hovering": StatusStyle((64, 140, 230), "hovering"),
    "sunken": StatusStyle((64, 140, 230), "sunk into the table"),
}
"""Style by status; green, red and pink as in Rudorfer et al. (2022), blue for warnings."""

UNCHECKED_STYLE = StatusStyle((120, 120, 120), "not checked")
"""Style of an instance without a status."""
FIXED_COLOR: Rgb8 = (150, 155, 162)
"""sRGB of background objects and obstacles."""


def status_style(status: str) -> StatusStyle:
    """How a status is shown."""
    return STATUS_STYLES.get(status, UNCHECKED_STYLE)


def paragraph(*children: Child) -> Html:
    """A paragraph of a panel."""
    return element("div", *children, class_="bd-box")


def title_html(text: str) -> Html:
    """The name of what a panel is about."""
    return element("span", text, class_="bd-title")


def small_heading(text: str) -> Html:
    """A small heading."""
    return element("div", text, class_="bd-head")


def secondary_text(text: Child) -> Html:
    """A line that stands back."""
    return element("div", text, class_="bd-quiet")


def color_dot(color: str) -> Html:
    """A small disc in a colour as HTML has it."""
    return element("span", class_="bd-dot", style=f"background:{color}")


def status_chip(status: str, count: int) -> Html:
    """How many instances have a status."""
    style = status_style(status)
    return element("span", color_dot(style.hex), f"{count} {style.words}", class_="bd-chip")


def html_list(items: Iterable[Child]) -> Html:
    """A list."""
    return element("ul", *(element("li", item) for item in items), class_="bd-list")


def html_table(heads: Iterable[str], rows: Iterable[Iterable[Child]], *, numbers: int = 0) -> Html:
    """A table.

    Args:
        heads: of its columns.
        rows: their cells.
        numbers: how many columns, from the right, have numbers.
    """
    names = list(heads)
    classes = [None] * (len(names) - numbers) + ["bd-number"] * numbers

    def row(cells: Iterable[Child], kind: str) -> Html:
        pairs = zip(cells, classes, strict=True)
        return element("tr", *(element(kind, cell, class_=name) for cell, name in pairs))

    return element("table", row(names, "th"), *(row(r, "td") for r in rows), class_="bd-table")


def notice_html(text: str) -> Html:
    """A line that the user should see."""
    return element("div", text, class_="bd-notice")


def picture_html(png: bytes | None, kind: str) -> str:
    """A picture on a button; a blank in its place if there is none (yet)."""
    if png is None:
        return str(element("span", class_=kind))
    source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    return str(element("img", class_=kind, src=source))


def count_with_noun(count: int, noun: str) -> str:
    """Such as `1 object` and `2 objects`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def join_html(*children: Child) -> str:
    """Pieces one after the other."""
    return str(join(*children))
